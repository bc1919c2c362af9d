//! What a job has reached, for whoever keeps it.

use super::Farm;
use beamfarm_image::job::PassStats;
use beamfarm_image::merge::{Errors, TreeSum};

/// All that another coordinator needs to go on with a job, at one moment.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// The passes that are there.
    pub sum: TreeSum,
    /// Prefixes that were tested, and their errors.
    pub tested: Vec<(u64, Errors)>,
    /// Counters of the passes.
    pub stats: PassStats,
    /// Time that the job has taken without its pauses, seconds.
    pub seconds: f64,
}

impl Farm {
    /// What is there now. Shares the images, so it takes no time.
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
