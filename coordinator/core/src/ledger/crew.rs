//! The workers of all jobs of a coordinator. A job can call workers from other jobs to check its blocks.

use beamfarm_proto::Fingerprint;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The most workers remembered; the most recently seen are kept.
const WORKERS: usize = 16384;

/// Workers by fingerprint, with the time when they were last heard of.
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

    /// The worker signed off.
    pub fn left(&self, worker: Fingerprint) {
        self.workers().remove(&worker);
    }

    /// Whether a worker that meets `is_it` was heard of within this time.
    pub fn has(&self, within: Duration, is_it: impl Fn(&Fingerprint) -> bool) -> bool {
        let seen = self.workers();
        let mut there = seen.iter().filter(|(_, time)| time.elapsed() < within);
        there.any(|(worker, _)| is_it(worker))
    }

    fn workers(&self) -> MutexGuard<'_, BTreeMap<Fingerprint, Instant>> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
