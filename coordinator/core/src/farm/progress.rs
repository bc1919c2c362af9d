//! Where a job stands.

use crate::ledger::{Failure, WorkerView};
use beamfarm_image::job::PassStats;
use std::time::Duration;

/// How a job ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// All passes are there.
    Complete,
    /// Someone called [`super::Farm::stop`].
    Stopped,
    /// A pass could not be rendered; those before it are there.
    Failed(Failure),
}

/// A worker that wanted to register and does not offer the job's engine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unable {
    /// What it calls itself. Comes from outside.
    pub name: String,
    /// Why it does not, in its words.
    pub reason: String,
    /// How often it came.
    pub times: u64,
}

/// Where a job stands.
#[derive(Clone, Debug, Default)]
pub struct Progress {
    /// Passes [first pass, prefix) are complete: what an image can be made of when the first is zero.
    pub prefix: u64,
    /// Passes that counted, with those beyond a gap.
    pub passes: u64,
    /// First pass that the job will not have.
    pub limit: u64,
    /// Nobody is given passes at the moment.
    pub paused: bool,
    /// Time since the job began in which it was.
    pub paused_for: Duration,
    /// Workers with a connection.
    pub workers: u32,
    /// Workers that ever registered.
    pub registered: u32,
    /// Counters, over all passes that counted.
    pub stats: PassStats,
    /// Deliveries of a block that was there already, with the same bits, and which nobody had asked to be rendered
    /// again.
    pub duplicates: u64,
    /// Deliveries that were refused.
    pub refused: u64,
    /// Attempts at a block that failed.
    pub failures: u64,
    /// Leases that ended without a result.
    pub lost_leases: u64,
    /// Blocks whose bits are in dispute: delivered twice with different bits, and nobody has decided yet who is right.
    /// Any at the end is one too many.
    pub divergent: u64,
    /// Blocks that another worker rendered again with the same bits.
    pub audits: u64,
    /// Blocks that shall be rendered again and were not yet.
    pub audits_pending: u64,
    /// Passes that counted and do so no more, because of who rendered them. Rendered again meanwhile, or soon.
    pub dropped: u64,
    /// Workers, in the order of their registration; of those that are gone, the last few hundred.
    pub workers_seen: Vec<WorkerView>,
    /// The last of those that do not offer the job's engine.
    pub unable: Vec<Unable>,
}
