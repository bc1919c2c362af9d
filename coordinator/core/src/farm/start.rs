//! What a job starts with, and the entries for its ledger file.

use super::Target;
use crate::ledger::{PixelHash, Who};
use beamfarm_image::job::{Block, PassStats};
use beamfarm_image::merge::{Errors, TreeSum};
use std::time::{Duration, SystemTime};
use tokio::sync::mpsc;

/// What a job starts with: nothing, for a new one.
#[derive(Debug, Default)]
pub struct Start {
    /// The sum of the passes that are done, with the job's size and layers.
    pub sum: Option<TreeSum>,
    /// Blocks that earlier runs of the job rendered. Those that are not in the sum are rendered again and compared. If
    /// a block is listed twice with different bits, the first counts and other workers decide. Passes in the sum that
    /// none of these blocks covers count as well, but nobody can later be convicted for them.
    pub done: Vec<DoneBlock>,
    /// Workers that earlier runs of the job shut out for wrong pixels.
    pub convicted: Vec<Who>,
    /// When the image is good enough; `None`: only when all passes are done.
    pub target: Option<Target>,
    /// Prefixes that were tested, with their errors.
    pub tested: Vec<(u64, Errors)>,
    /// Statistics of the passes in the sum.
    pub stats: PassStats,
    /// Time spent on the job until now.
    pub before: Duration,
    /// Receives what becomes of blocks. Unbounded, as nothing may be lost; an entry takes a few hundred bytes.
    pub entries: Option<mpsc::UnboundedSender<Entry>>,
}

/// A block that an earlier run of the job accepted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DoneBlock {
    /// Its passes.
    pub block: Block,
    /// Hash of its pixels.
    pub hash: PixelHash,
    /// The worker that rendered it.
    pub worker: Who,
    /// Whether another worker confirmed it.
    pub audited: bool,
}

/// What became of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EntryState {
    /// It counts.
    Done,
    /// An attempt to render it failed.
    Failed,
    /// Another worker rendered it again, with the same bits.
    Audited,
    /// It counted and was taken back because its worker is not trusted; it will be rendered again.
    Dropped,
    /// A worker was shut out for wrong pixels; the entry's block has no meaning.
    ShutOut,
}

impl EntryState {
    /// The word in the ledger file.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Audited => "audited",
            Self::Dropped => "dropped",
            Self::ShutOut => "shut-out",
        }
    }
}

/// A line for the ledger file.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// When it happened.
    pub time: SystemTime,
    /// The block.
    pub block: Block,
    /// What became of it.
    pub state: EntryState,
    /// The worker that rendered, failed or confirmed it.
    pub worker: Who,
    /// Radius scale of the block's first pass.
    pub radius_scale: f64,
    /// Hash of its pixels; `None` for a failure.
    pub hash: Option<PixelHash>,
    /// Time between lease and result. Zero when dropped.
    pub took: Duration,
    /// What the failing worker reported, or why a worker is shut out.
    pub message: Option<String>,
}
