//! EXR in and out: block images on the wire, final images on disk.

use crate::job::{Block, SceneHash};

/// What a block image says about itself.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockMeta {
    /// The scene.
    pub scene: SceneHash,
    /// Which passes.
    pub block: Block,
    /// The job's seed.
    pub seed: u64,
    /// The job's alpha.
    pub alpha: f64,
    /// Radius scale of the block's first pass.
    pub radius_scale: f64,
    /// Version of the program.
    pub version: String,
}
