//! Where a job stands.

use crate::ledger::Failure;
use beamfarm_image::job::{Block, PassStats};
use beamfarm_proto::WorkerId;
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
    /// Workers with a connection.
    pub workers: u32,
    /// Workers that ever registered.
    pub registered: u32,
    /// Counters, over all passes that counted.
    pub stats: PassStats,
    /// Deliveries of a block that was there already, with the same bits, and which nobody had asked to be rendered again.
    pub duplicates: u64,
    /// Deliveries that were refused.
    pub refused: u64,
    /// Attempts at a block that failed.
    pub failures: u64,
    /// Leases that ended without a result.
    pub lost_leases: u64,
    /// Blocks whose bits are in dispute: delivered twice with different bits, and nobody has decided yet who is right. Any at
    /// the end is one too many.
    pub divergent: u64,
    /// Blocks that another worker rendered again with the same bits.
    pub audits: u64,
    /// Blocks that shall be rendered again and were not yet.
    pub audits_pending: u64,
    /// Passes that counted and do so no more, because of who rendered them. Rendered again meanwhile, or soon.
    pub dropped: u64,
    /// Workers, in the order of their registration; of those that are gone, the last few hundred.
    pub workers_seen: Vec<WorkerView>,
}

/// A worker as others see it.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkerView {
    /// Its number.
    pub id: WorkerId,
    /// What it calls itself: the machine, say. Comes from outside.
    pub name: String,
    /// Rendering threads.
    pub threads: u32,
    /// Passes of it that count.
    pub passes: u64,
    /// Time that it takes for a pass, averaged over the last few; `None` before the first.
    pub seconds_per_pass: Option<f64>,
    /// Time since its last sign of life.
    pub last_seen: Duration,
    /// Blocks of it that another worker rendered again with the same bits.
    pub audits_passed: u64,
    /// Blocks of it that others rendered with other bits.
    pub audits_failed: u64,
    /// What it is at.
    pub state: WorkerState,
    /// The block that it was given first of those that it holds, and how many passes of it are rendered.
    pub rendering: Option<(Block, u64)>,
}

/// What a worker is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkerState {
    /// Holds leases.
    Working,
    /// Is there and waits.
    Idle,
    /// Waits because its last attempts failed.
    BackingOff,
    /// Signed off, or its connection broke.
    Gone,
    /// Gets nothing any more: it sent wrong pixels, or nothing but failures.
    ShutOut,
}

impl WorkerState {
    /// One or two words, for people.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Working => "working",
            Self::Idle => "idle",
            Self::BackingOff => "backing off",
            Self::Gone => "gone",
            Self::ShutOut => "shut out",
        }
    }
}
