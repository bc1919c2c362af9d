//! When the image is good enough.
//!
//! The error is tested only where [`beamfarm_image::merge::next_boundary`] says so: at prefixes of 2, 3, 4, 6, 8, 12,
//! ... passes, each separately and in order, whatever has arrived meanwhile. The same scene and seed therefore end with
//! the same pass on any farm, and few tests mean few chances to stop too early by luck.

use super::Farm;
use beamfarm_image::merge::{Average, Errors};
use std::sync::{MutexGuard, PoisonError};
use tracing::{debug, info};

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Relative standard error, as a fraction.
    pub error: f64,
    /// The percentile of the image's blocks that it applies to; `None`: the image as a whole.
    pub percentile: Option<u32>,
}

impl Target {
    /// Whether an image is good enough.
    pub fn is_met_by(&self, errors: &Errors) -> bool {
        errors.at(self.percentile) <= self.error
    }
}

/// The prefixes that were tested.
#[derive(Debug, Default)]
pub(super) struct Tested {
    errors: Vec<(u64, Errors)>,
    /// The prefix that met the target, and the number of passes that had been requested.
    stopped_at: Option<(u64, u64)>,
}

impl Tested {
    pub fn new(errors: Vec<(u64, Errors)>) -> Self {
        Self {
            errors,
            stopped_at: None,
        }
    }

    pub fn errors(&self) -> &[(u64, Errors)] {
        &self.errors
    }
}

impl Farm {
    /// Test the boundaries that the prefix has reached. A test takes as long as a few copies of the image: do not call
    /// it from a thread that serves others.
    pub(super) fn look(&self) {
        self.look_at(&mut self.tested());
    }

    fn look_at(&self, tested: &mut Tested) {
        if let Some((passes, asked)) = tested.stopped_at {
            if self.sum().fence() == Some(passes) {
                return;
            }
            // Passes of a worker that is no longer trusted were taken out of the prefix.
            tested.stopped_at = None;
            self.state().ledger.set_limit(asked);
            self.opened.notify_waiters();
        }
        loop {
            let sum = self.sum().clone();
            let Some(fence) = sum.fence().filter(|fence| *fence <= sum.prefix()) else {
                return;
            };
            let average = sum.average_of(fence);
            drop(sum);
            let errors = average.map_or(Errors::UNKNOWN, |average| average.errors());
            debug!("{fence} passes: relative standard error {}", errors.image);
            let is_met = self.target.is_some_and(|target| target.is_met_by(&errors));
            let mut sum = self.sum();
            if sum.fence() != Some(fence) || fence > sum.prefix() {
                // Passes were taken out meanwhile.
                continue;
            }
            if is_met {
                info!("the error is small enough at {fence} passes");
                let mut state = self.state();
                tested.stopped_at = Some((fence, state.ledger.limit()));
                state.ledger.set_limit(fence);
                return;
            }
            sum.lift_fence();
            tested.errors.retain(|(passes, _)| *passes < fence);
            tested.errors.push((fence, errors));
        }
    }

    /// The average for the image: of the complete prefix, or of the one that met the target. Contains nothing before
    /// the first pass. Takes as long as a few copies of the image.
    pub fn average(&self) -> Option<Average> {
        let mut tested = self.tested();
        // The job may end while another thread is about to test.
        self.look_at(&mut tested);
        let stopped_at = tested.stopped_at;
        let sum = self.sum().clone();
        drop(tested);
        match stopped_at {
            Some((passes, _)) => sum.average_of(passes),
            None => sum.average(),
        }
    }

    /// The prefix at which the error met the target.
    pub fn stopped_at(&self) -> Option<u64> {
        self.tested().stopped_at.map(|(passes, _)| passes)
    }

    pub(super) fn tested(&self) -> MutexGuard<'_, Tested> {
        self.tested.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
