//! Who works for any of a coordinator's jobs. A job whose blocks are to be checked can have those as judges who were
//! never there.

use beamfarm_proto::Fingerprint;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Workers that are remembered; of more, those that were seen last.
const WORKERS: usize = 16384;

/// By what workers are known, and when they were last heard of.
#[derive(Debug, Default)]
pub struct Crew {
    seen: Mutex<BTreeMap<Fingerprint, Instant>>,
}

impl Crew {
    /// A sign of life.
    pub fn seen(&self, worker: Fingerprint) {
        let mut seen = self.workers();
        seen.insert(worker, Instant::now());
        if seen.len() > WORKERS {
            let mut times: Vec<Instant> = seen.values().copied().collect();
            let (_, middle, _) = times.select_nth_unstable(WORKERS / 2);
            let middle = *middle;
            seen.retain(|_, time| *time >= middle);
        }
    }

    /// It has signed off.
    pub fn left(&self, worker: Fingerprint) {
        self.workers().remove(&worker);
    }

    /// Whether one like this was heard of within the last while.
    pub fn has(&self, within: Duration, is_it: impl Fn(&Fingerprint) -> bool) -> bool {
        let seen = self.workers();
        let mut there = seen.iter().filter(|(_, time)| time.elapsed() < within);
        there.any(|(worker, _)| is_it(worker))
    }

    fn workers(&self) -> MutexGuard<'_, BTreeMap<Fingerprint, Instant>> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
