//! Checks a delivered block before it counts.

use crate::ledger::PixelHash;
use beamfarm_image::error::ImageError;
use beamfarm_image::exr::{decode_block, node_hashes};
use beamfarm_image::job::{Block, PassStats};
use beamfarm_image::look::Look;
use beamfarm_image::merge::Node;
use beamfarm_image::radius::Schedule;
use beamfarm_proto::{FileHash, Job, LeaseId, VERSION, WireError, WireHash, WorkerId, wire};

/// The header of a submission.
#[derive(Clone, Copy, Debug)]
pub struct Claim {
    /// The sender.
    pub worker: WorkerId,
    /// The lease.
    pub lease: LeaseId,
    /// The passes.
    pub block: Block,
    /// Size of the EXR in bytes.
    pub size: u64,
    /// Its hash.
    pub hash: FileHash,
    /// Statistics of rendering.
    pub stats: PassStats,
}

impl Claim {
    /// The header that a worker sent.
    pub fn of(worker: WorkerId, header: wire::SubmitHeader) -> Result<Self, WireError> {
        Ok(Self {
            worker,
            lease: LeaseId(header.lease),
            block: header.block.unwrap_or_default().try_into()?,
            size: header.size,
            hash: FileHash::from_wire(&header.hash, "header.hash")?,
            stats: header.stats.unwrap_or_default().into(),
        })
    }
}

/// Why a block does not count.
#[derive(Debug, thiserror::Error)]
pub enum Flaw {
    /// Damaged in transit; worth sending again.
    #[error("the bytes are not those that were sent")]
    Damaged,
    /// Not a block image of this job: the worker's fault.
    #[error("{0}")]
    Foreign(String),
    /// A block image of this job with invalid pixels: the pass's fault.
    #[error("{0}")]
    Pixels(String),
}

/// A block that passed the checks.
pub struct Examined {
    /// The block.
    pub node: Node,
    /// Hash of its radiance, for display.
    pub pixels: String,
    /// Its [`node_hash`](beamfarm_image::exr::node_hash): equal if and only if the bits are.
    pub hash: PixelHash,
    /// Brightness statistics, per pass.
    pub look: Look,
}

/// The block in these bytes, if it matches the claim and belongs to the job.
pub fn examine(job: &Job, schedule: &Schedule, claim: &Claim, bytes: &[u8]) -> Result<Examined, Flaw> {
    if FileHash::of(bytes) != claim.hash {
        return Err(Flaw::Damaged);
    }
    let (node, meta) = match decode_block(bytes, job.width, job.height, &job.layers) {
        Ok(decoded) => decoded,
        Err(error @ ImageError::Merge(_)) => return Err(Flaw::Pixels(error.to_string())),
        Err(error) => return Err(Flaw::Foreign(error.to_string())),
    };
    let foreign = |field: &str, found: String, expected: String| {
        Err(Flaw::Foreign(format!("{field} is {found}; expected {expected}")))
    };
    if meta.version != VERSION {
        return foreign("version", meta.version, VERSION.into());
    }
    if meta.scene != job.scene {
        return foreign("scene", meta.scene.to_string(), job.scene.to_string());
    }
    if meta.block != claim.block {
        return foreign("block", meta.block.to_string(), claim.block.to_string());
    }
    if meta.seed != job.settings.seed {
        let expected = job.settings.seed.to_string();
        return foreign("seed", meta.seed.to_string(), expected);
    }
    if meta.engine != job.settings.engine {
        let expected = job.settings.engine.identity();
        return foreign("engine", meta.engine.identity(), expected);
    }
    let radius_scale = schedule.scale(claim.block.start());
    for (field, found, expected) in [
        ("alpha", meta.alpha, job.settings.alpha),
        ("radius scale", meta.radius_scale, radius_scale),
    ] {
        if found.to_bits() != expected.to_bits() {
            return foreign(field, found.to_string(), expected.to_string());
        }
    }
    if claim.stats.non_finite > 0 {
        let count = claim.stats.non_finite;
        return Err(Flaw::Pixels(format!("{count} pixel values are not finite")));
    }
    let (pixels, hash) = node_hashes(&node);
    // Derived from the file's hash, so that nobody can predict which rows are sampled.
    let look = Look::of(&node, usize::from(claim.hash.0[0]));
    Ok(Examined {
        node,
        pixels,
        hash,
        look,
    })
}
