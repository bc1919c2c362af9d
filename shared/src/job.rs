//! Jobs: what a pass needs to know beside its scene, and the names of things that the farm hands around.

use serde::{Deserialize, Serialize};
use std::fmt;

/// BLAKE3 of a scene bundle: the scene file and every asset that it names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SceneHash(pub [u8; 32]);

impl fmt::Display for SceneHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// How the radius scale depends on the pass: once a pass, or as if it shrank after every beam.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ScheduleKind {
    /// Shrink once a pass.
    #[default]
    Pass,
    /// Shrink once a beam, so that the number of paths in a pass does not matter.
    Beam,
}

/// What a pass depends on beside the scene and its own index. Equal on every machine of a job.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JobSettings {
    /// Seed of the whole job.
    pub seed: u64,
    /// Trade of variance against bias, in (0, 1).
    pub alpha: f64,
    /// Radius schedule.
    pub schedule: ScheduleKind,
    /// Photon paths that one pass emits: the normaliser of all photon flux.
    pub paths_per_pass: u32,
}

/// An aligned block of passes: a node of the summation tree. Covers [index << level, (index + 1) << level).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Block {
    /// Height in the tree: the block holds 2^level passes.
    pub level: u32,
    /// Position among the blocks of its level, from zero.
    pub index: u64,
}

impl Block {
    /// The block that holds one pass.
    pub fn leaf(pass_index: u64) -> Self {
        Self {
            level: 0,
            index: pass_index,
        }
    }
    /// First pass.
    pub fn start(&self) -> u64 {
        self.index << self.level
    }
    /// Number of passes.
    pub fn len(&self) -> u64 {
        1 << self.level
    }
    /// A block is never empty.
    pub fn is_empty(&self) -> bool {
        false
    }
    /// The passes, half-open.
    pub fn passes(&self) -> std::ops::Range<u64> {
        self.start()..self.start() + self.len()
    }
    /// The block one level up that holds this one.
    pub fn parent(&self) -> Self {
        Self {
            level: self.level + 1,
            index: self.index >> 1,
        }
    }
    /// The other child of the parent.
    pub fn sibling(&self) -> Self {
        Self {
            level: self.level,
            index: self.index ^ 1,
        }
    }
}

/// What passes counted while they were rendered. Never part of the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PassStats {
    /// Photon paths emitted.
    pub paths: u64,
    /// Photon beams stored.
    pub beams: u64,
    /// Surface photons stored.
    pub surface_photons: u64,
    /// Beam and camera segment pairs whose kernel and radiometry were evaluated.
    pub beam_evaluations: u64,
    /// Pixel values that were NaN or infinite; a pass with any is refused.
    pub non_finite: u64,
}

impl std::ops::AddAssign for PassStats {
    fn add_assign(&mut self, o: Self) {
        self.paths += o.paths;
        self.beams += o.beams;
        self.surface_photons += o.surface_photons;
        self.beam_evaluations += o.beam_evaluations;
        self.non_finite += o.non_finite;
    }
}
