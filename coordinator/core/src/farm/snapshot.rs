//! The state of a job, for whoever stores it.

use super::Farm;
use beamfarm_image::job::PassStats;
use beamfarm_image::merge::{Errors, TreeSum};

/// Everything another coordinator needs to continue a job, at one moment.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// The sum of the passes that are done.
    pub sum: TreeSum,
    /// Prefixes that were tested, with their errors.
    pub tested: Vec<(u64, Errors)>,
    /// Statistics of the passes.
    pub stats: PassStats,
    /// Time spent on the job without its pauses, seconds.
    pub seconds: f64,
}

impl Farm {
    /// The current state. Shares the images, so it takes no time.
    pub fn snapshot(&self) -> Snapshot {
        let tested = self.tested();
        let worked = self.started.elapsed().saturating_sub(self.paused_for());
        Snapshot {
            sum: self.sum().clone(),
            tested: tested.errors().to_vec(),
            stats: self.state().progress.stats,
            seconds: (self.before + worked).as_secs_f64(),
        }
    }
}
