//! Keys of workers: a worker gets a key when it registers and must show it in all other calls. The worker numbers in
//! logs and on the page grant no access.

use beamfarm_proto::{Fingerprint, WorkerId};
use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use tonic::Status;

/// A worker at a job of the coordinator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Seat {
    /// The job's number.
    pub job: u64,
    /// The worker's number there.
    pub worker: WorkerId,
}

/// A worker at its job, and at its earlier jobs.
#[derive(Clone, Debug)]
pub(crate) struct Seats {
    /// The fingerprint that identifies it.
    pub own: Fingerprint,
    pub now: Seat,
    pub before: Vec<Seat>,
}

impl Seats {
    /// Its number at a job, if it was ever there.
    pub fn at(&self, job: u64) -> Option<WorkerId> {
        let mut seats = [self.now].into_iter().chain(self.before.iter().copied());
        seats.find(|seat| seat.job == job).map(|seat| seat.worker)
    }
}

/// The keys of a coordinator's workers. A restarted coordinator knows none of the earlier ones.
#[derive(Default)]
pub(crate) struct Keys {
    workers: Mutex<HashMap<u64, Seats>>,
}

impl Keys {
    /// Issue a key that cannot be guessed. `knows`: whether a worker is still remembered; keys of other workers are
    /// removed.
    pub fn issue(&self, seats: Seats, knows: impl Fn(Seat) -> bool) -> Result<u64, Status> {
        let key = getrandom::u64().map_err(|error| Status::internal(format!("no random numbers: {error}")))?;
        let mut workers = self.workers();
        if workers.len() == workers.capacity() {
            workers.retain(|_, seats| knows(seats.now));
        }
        match workers.insert(key, seats) {
            None => Ok(key),
            // Once in 2^64 attempts. The other worker has to register again.
            Some(_) => Err(Status::unavailable("two workers have the same key")),
        }
    }

    /// The owner of the key.
    pub fn seats(&self, key: u64) -> Result<Seats, Status> {
        self.known(key).ok_or_else(unknown)
    }

    /// The owner of the key, if any.
    pub fn known(&self, key: u64) -> Option<Seats> {
        self.workers().get(&key).cloned()
    }

    fn workers(&self) -> MutexGuard<'_, HashMap<u64, Seats>> {
        self.workers.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The answer to an unknown worker.
pub(crate) fn unknown() -> Status {
    Status::not_found("no worker with this key is registered here")
}
