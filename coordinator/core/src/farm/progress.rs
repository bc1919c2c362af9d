//! How far a job is.

use crate::ledger::{Failure, WorkerView};
use beamfarm_image::job::PassStats;
use std::time::Duration;

/// How a job ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// All passes are done.
    Complete,
    /// Someone called [`super::Farm::stop`].
    Stopped,
    /// A pass could not be rendered; those before it are done.
    Failed(Failure),
}

/// A worker without the job's engine that tried to register.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unable {
    /// The name it gives itself. Comes from outside.
    pub name: String,
    /// Its own reason why it lacks the engine.
    pub reason: String,
    /// How often it tried.
    pub times: u64,
}

/// How far a job is.
#[derive(Clone, Debug, Default)]
pub struct Progress {
    /// Passes [first pass, prefix) are complete. If the first pass is zero, the image is made of them.
    pub prefix: u64,
    /// Passes that count, including those beyond a gap.
    pub passes: u64,
    /// End of the job's passes, exclusive.
    pub limit: u64,
    /// Whether the job is paused.
    pub paused: bool,
    /// How long the job has been paused since it started.
    pub paused_for: Duration,
    /// Workers that are connected.
    pub workers: u32,
    /// Workers that have ever registered.
    pub registered: u32,
    /// Statistics over all passes that count.
    pub stats: PassStats,
    /// Repeated deliveries of a block with the same bits that were not requested as checks.
    pub duplicates: u64,
    /// Deliveries that were refused.
    pub refused: u64,
    /// Attempts at a block that failed.
    pub failures: u64,
    /// Leases that ended without a result.
    pub lost_leases: u64,
    /// Blocks whose bits are in dispute: two workers delivered different bits, and no third has decided. None should be
    /// left at the end.
    pub divergent: u64,
    /// Blocks that another worker rendered again with the same bits.
    pub audits: u64,
    /// Blocks that are still to be rendered again as a check.
    pub audits_pending: u64,
    /// Passes that were taken back because of their worker. They have been or will be rendered again.
    pub dropped: u64,
    /// Workers in order of registration; of those that are gone, the last few hundred.
    pub workers_seen: Vec<WorkerView>,
    /// The most recent workers without the job's engine.
    pub unable: Vec<Unable>,
}
