//! What a job begins with, and what it tells whoever keeps its ledger file.

use super::Target;
use crate::ledger::{PixelHash, Who};
use beamfarm_image::job::{Block, PassStats};
use beamfarm_image::merge::{Errors, TreeSum};
use std::time::{Duration, SystemTime};
use tokio::sync::mpsc;

/// What a job begins with: nothing, for a new one.
#[derive(Debug, Default)]
pub struct Start {
    /// The sum of the passes that are there. Of the job's size and layers.
    pub sum: Option<TreeSum>,
    /// Blocks that were rendered in earlier lives of the job. Those that are not part of the sum are rendered again and
    /// compared with what they were. Where a block is named twice, with different bits, the first counts, and others
    /// have to decide. Passes of the sum that no block of these covers count as well; nobody is found out later to have
    /// rendered them wrong.
    pub done: Vec<DoneBlock>,
    /// Workers that earlier lives of the job shut out for wrong pixels.
    pub convicted: Vec<Who>,
    /// When the image is good enough; `None`: only when all passes are there.
    pub target: Option<Target>,
    /// Prefixes that were looked at, and their errors.
    pub tested: Vec<(u64, Errors)>,
    /// Counters of the passes of the sum.
    pub stats: PassStats,
    /// Time that the job has taken until now.
    pub before: Duration,
    /// Who is told what becomes of blocks. Unbounded, as nothing of it may be lost; an entry takes some hundred bytes.
    pub entries: Option<mpsc::UnboundedSender<Entry>>,
}

/// A block that an earlier life of the job took in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DoneBlock {
    /// Which passes.
    pub block: Block,
    /// Hash of its pixels.
    pub hash: PixelHash,
    /// The worker that rendered it.
    pub worker: Who,
    /// Whether another worker had confirmed it.
    pub audited: bool,
}

/// What became of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EntryState {
    /// It counts.
    Done,
    /// An attempt at it failed.
    Failed,
    /// Another worker rendered it again, with the same bits.
    Audited,
    /// It counted and does so no more, because its worker is not to be trusted; it will be rendered again.
    Dropped,
    /// Nothing became of this block, which is any: its worker is shut out for wrong pixels.
    ShutOut,
}

impl EntryState {
    /// As the ledger file has it.
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
    /// Radius scale of its first pass.
    pub radius_scale: f64,
    /// Hash of its pixels; `None` for a failure.
    pub hash: Option<PixelHash>,
    /// Time between lease and result. Zero when dropped.
    pub took: Duration,
    /// What a failing worker said, or why one is shut out.
    pub message: Option<String>,
}
