//! Jobs: what a pass needs besides its scene, and the names of what the farm exchanges.

mod engine;

pub use engine::{EngineChoice, EngineKind};

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// BLAKE3 of a scene bundle: the scene file and every asset that it names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SceneHash(pub [u8; 32]);

impl fmt::Display for SceneHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// Text that is not 64 hexadecimal digits.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a scene hash: expected 64 hexadecimal digits")]
pub struct SceneHashError(String);

impl FromStr for SceneHash {
    type Err = SceneHashError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let error = || SceneHashError(text.chars().take(80).collect());
        blake3::Hash::from_hex(text)
            .map(|hash| Self(*hash.as_bytes()))
            .map_err(|_| error())
    }
}

/// How the radius scale depends on the pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ScheduleKind {
    /// Shrink once per pass.
    #[default]
    Pass,
    /// Shrink as if after every beam, so that the number of paths per pass does not matter.
    Beam,
}

impl fmt::Display for ScheduleKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pass => "pass",
            Self::Beam => "beam",
        })
    }
}

/// When to aim photons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Targeting {
    /// For lights where aiming makes far less noise.
    #[default]
    Auto,
    /// Never.
    Off,
    /// For every light that is seen from somewhere.
    On,
    /// As `On`, and photons that miss all targets are dropped. Biased: light that the targets do not know of is
    /// missing.
    Reject,
}

/// What finds light that reaches what the camera sees indirectly.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Technique {
    /// Photons that are looked up where camera paths end.
    Photons,
    /// Camera paths that go on.
    Paths,
}

impl fmt::Display for Technique {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Photons => "photons",
            Self::Paths => "paths",
        })
    }
}

/// What finds each kind of light. Either technique is correct, but their noise after a given time differs. `None`: what
/// is best for most similar scenes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Techniques {
    /// In media: photon beams along the camera's own segments, or camera paths that are scattered.
    pub media: Option<Technique>,
    /// On surfaces: photons at the second vertex, or camera paths that go on.
    pub surfaces: Option<Technique>,
    /// Behind specular surfaces alone: photons, or camera paths for lights that they meet often enough. If not set:
    /// both, balanced, for lights that are not all around. If photons find all light of surfaces or media, they find
    /// this as well.
    pub caustics: Option<Technique>,
    /// Aim photons at what the camera sees, wherever there is something to aim at. If not set, the scene decides.
    pub aimed: Option<bool>,
}

/// The techniques that are set: `media by paths, caustics by photons`.
impl fmt::Display for Techniques {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let said = [
            ("media", self.media),
            ("surfaces", self.surfaces),
            ("caustics", self.caustics),
        ];
        let said = said
            .into_iter()
            .filter_map(|(of, technique)| Some(format!("{of} by {}", technique?)));
        let aimed = self.aimed.map(|aimed| match aimed {
            true => "photons aimed".to_owned(),
            false => "photons not aimed".to_owned(),
        });
        f.write_str(&said.chain(aimed).collect::<Vec<_>>().join(", "))
    }
}

/// Constant radii for a known number of passes, so that the error after these passes is least.
///
/// Variance falls as one over the radius, and the square of the bias grows with it. Both are convex, so among all
/// schedules with the same mean the constant one is best. Passes beyond the number shrink the radius again, so the
/// image still converges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// Number of passes.
    pub passes: u64,
    /// Radius scale of all these passes.
    pub scale: f64,
}

impl fmt::Display for Budget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} passes at {}", self.passes, self.scale)
    }
}

impl FromStr for Budget {
    type Err = String;

    /// Reads the text that [`Budget`]'s `Display` writes, without losing a bit.
    fn from_str(text: &str) -> Result<Self, String> {
        let error = || format!("`{text}`: expected `N passes at SCALE`");
        let (passes, scale) = text.split_once(" passes at ").ok_or_else(error)?;
        Ok(Self {
            passes: passes.parse().map_err(|_| error())?,
            scale: scale.parse().map_err(|_| error())?,
        })
    }
}

/// What a pass depends on besides the scene and its own index. Equal on every machine of a job.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JobSettings {
    /// Seed of the whole job.
    pub seed: u64,
    /// Trade of variance against bias, in (0, 1).
    pub alpha: f64,
    /// Radius schedule.
    pub schedule: ScheduleKind,
    /// Radii for a known number of passes, which replace the schedule up to there.
    pub budget: Option<Budget>,
    /// Photon paths that a pass emits. All photon flux is divided by this number.
    pub paths_per_pass: u32,
    /// The scene's own number of paths per pass. Base radii are meant for it if the radius shrinks once per beam.
    pub reference_paths: u32,
    /// What finds scattered light.
    pub techniques: Techniques,
    /// What renders the passes.
    pub engine: EngineKind,
}

/// What samples of the reference integrator depend on besides the scene and their own index.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReferenceSettings {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Most scatterings of a path, by surfaces and media together; `None`: no bound, which is the truth.
    pub max_depth: Option<u32>,
}

/// Settings with which no pass can be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// The schedule does not converge.
    #[error("alpha is {0}; expected a number between 0 and 1, both excluded")]
    Alpha(f64),
    /// The budget gives no radii.
    #[error(
        "the budget is {0}; expected at least 1 and at most 2^53 passes at a scale above 0 and at most {MAX_SCALE}"
    )]
    Budget(Budget),
    /// No photon would be emitted.
    #[error("{field} is 0; expected at least 1")]
    NoPaths {
        /// `paths_per_pass` or `reference_paths`.
        field: &'static str,
    },
}

impl JobSettings {
    /// Refuse settings that allow no schedule.
    pub fn check(&self) -> Result<(), SettingsError> {
        if !(self.alpha > 0.0 && self.alpha < 1.0) {
            return Err(SettingsError::Alpha(self.alpha));
        }
        if let Some(budget) = self.budget
            && !((1..=MAX_PASSES).contains(&budget.passes) && budget.scale > 0.0 && budget.scale <= MAX_SCALE)
        {
            return Err(SettingsError::Budget(budget));
        }
        let paths = [
            ("paths_per_pass", self.paths_per_pass),
            ("reference_paths", self.reference_paths),
        ];
        match paths.into_iter().find(|(_, count)| *count == 0) {
            Some((field, _)) => Err(SettingsError::NoPaths { field }),
            None => Ok(()),
        }
    }
}

/// Largest radius scale of a [`Budget`].
const MAX_SCALE: f64 = 100.0;

/// Most passes of a job. Every count of passes below it is exact in an f64.
pub const MAX_PASSES: u64 = 1 << 53;

/// An aligned block of passes: a node of the summation tree. Covers [index << level, (index + 1) << level).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Block {
    /// Height in the tree: the block holds 2^level passes.
    pub level: u32,
    /// Position among the blocks of its level, from zero.
    pub index: u64,
}

impl Block {
    /// A block, if it lies within [`MAX_PASSES`]. Use this for input from outside.
    pub fn new(level: u32, index: u64) -> Option<Self> {
        let fits = level <= MAX_PASSES.ilog2() && index < MAX_PASSES >> level;
        fits.then_some(Self { level, index })
    }
    /// The block that holds one pass.
    pub fn leaf(pass_index: u64) -> Self {
        Self {
            level: 0,
            index: pass_index,
        }
    }
    /// Whether the block lies within [`MAX_PASSES`]. If not, its other methods may overflow.
    pub fn is_valid(&self) -> bool {
        Self::new(self.level, self.index).is_some()
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

impl fmt::Display for Block {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.is_valid() {
            write!(f, "block {} of level {}", self.index, self.level)
        } else if self.level == 0 {
            write!(f, "pass {}", self.index)
        } else {
            write!(f, "passes {}..{}", self.start(), self.passes().end)
        }
    }
}

/// Counters from rendering passes. Never part of the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PassStats {
    /// Photon paths emitted.
    pub paths: u64,
    /// Photon beams stored.
    pub beams: u64,
    /// Bytes of the beams, of the transmittance along them, and of the tree that finds them.
    pub beam_bytes: u64,
    /// Surface photons stored.
    pub surface_photons: u64,
    /// Pairs of beam and camera segment whose kernel and radiometry were evaluated.
    pub beam_evaluations: u64,
    /// Pixel values that were NaN or infinite; a pass with any is refused.
    pub non_finite: u64,
}

impl PassStats {
    /// Memory per beam on average, with the transmittance along it and its part of the tree. NaN without beams.
    pub fn bytes_per_beam(&self) -> f64 {
        self.beam_bytes as f64 / self.beams as f64
    }
}

impl std::ops::AddAssign for PassStats {
    fn add_assign(&mut self, o: Self) {
        self.paths += o.paths;
        self.beams += o.beams;
        self.beam_bytes += o.beam_bytes;
        self.surface_photons += o.surface_photons;
        self.beam_evaluations += o.beam_evaluations;
        self.non_finite += o.non_finite;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scene_hash_is_read_as_it_is_written() {
        let hash = SceneHash(std::array::from_fn(|i| 7 * i as u8));
        assert_eq!(hash.to_string().parse(), Ok(hash));
        for bad in [
            "",
            "00",
            &"0".repeat(63),
            &"0".repeat(66),
            &"g".repeat(64),
            &"é".repeat(32),
        ] {
            let error = bad.parse::<SceneHash>().unwrap_err();
            assert!(error.to_string().contains("64 hexadecimal digits"), "{bad}");
        }
    }

    #[test]
    fn blocks_stay_within_the_largest_job() {
        assert_eq!(
            Block::new(0, MAX_PASSES - 1).map(|block| block.passes().end),
            Some(MAX_PASSES)
        );
        assert_eq!(Block::new(53, 0).map(|block| block.len()), Some(MAX_PASSES));
        for (level, index) in [(0, MAX_PASSES), (53, 1), (54, 0), (64, 0), (u32::MAX, u64::MAX)] {
            assert_eq!(Block::new(level, index), None);
            assert!(!Block { level, index }.to_string().is_empty());
        }
        assert_eq!(Block::leaf(3).to_string(), "pass 3");
        assert_eq!(Block { level: 2, index: 3 }.to_string(), "passes 12..16");
    }

    #[test]
    fn settings_without_a_schedule_are_refused() {
        let good = JobSettings {
            seed: 0,
            alpha: 0.5,
            schedule: ScheduleKind::Pass,
            budget: None,
            paths_per_pass: 1,
            reference_paths: 1,
            techniques: Techniques::default(),
            engine: EngineKind::default(),
        };
        assert_eq!(good.check(), Ok(()));
        for alpha in [0.0, 1.0, -0.5, f64::NAN, f64::INFINITY] {
            let error = JobSettings { alpha, ..good }.check().unwrap_err();
            assert!(error.to_string().starts_with("alpha is "), "{error}");
        }
        let settings = JobSettings {
            paths_per_pass: 0,
            ..good
        };
        assert_eq!(
            settings.check(),
            Err(SettingsError::NoPaths {
                field: "paths_per_pass"
            })
        );
        let settings = JobSettings {
            reference_paths: 0,
            ..good
        };
        assert_eq!(
            settings.check(),
            Err(SettingsError::NoPaths {
                field: "reference_paths"
            })
        );
    }
}
