//! By what workers are known: whoever registers gets a key, which all its other calls must show. Numbers of workers, as
//! logs and the page have them, open nothing.

use beamfarm_proto::WorkerId;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use tonic::Status;

/// The keys of a coordinator's workers. One that was restarted knows none of those given out before.
#[derive(Default)]
pub(crate) struct Keys {
    workers: Mutex<HashMap<u64, WorkerId>>,
}

impl Keys {
    /// A key that nobody can guess. `knows`: whether a worker is still remembered; the keys of others open nothing.
    pub fn issue(&self, worker: WorkerId, knows: impl Fn(WorkerId) -> bool) -> Result<u64, Status> {
        let key = getrandom::u64().map_err(|error| Status::internal(format!("no random numbers: {error}")))?;
        let mut workers = self.workers.lock().unwrap_or_else(PoisonError::into_inner);
        if workers.len() == workers.capacity() {
            workers.retain(|_, worker| knows(*worker));
        }
        match workers.insert(key, worker) {
            None => Ok(key),
            // Once in 2^64 attempts. The other one has to register again.
            Some(_) => Err(Status::unavailable("two workers have the same key")),
        }
    }

    /// Whose key it is.
    pub fn worker(&self, key: u64) -> Result<WorkerId, Status> {
        let workers = self.workers.lock().unwrap_or_else(PoisonError::into_inner);
        let known = workers.get(&key).copied();
        known.ok_or_else(|| Status::not_found("no worker with this key is registered here"))
    }
}
