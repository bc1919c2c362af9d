//! Passes against the path tracer, on one scene or on thousands.
//!
//! Both render the same number of independent images; their means are compared over the whole, over blocks of 8 x 8
//! pixels, and for each part of the light. Tails are heavy, so a scene that differs is rendered four times as long with
//! other random numbers before it counts. If it still differs, it is examined with much smaller radii: a bias of
//! kernels goes away with them, a fault does not.

pub mod bias;
pub mod images;
pub mod many;
pub mod outliers;
pub mod shrink;

use beamfarm_render::world::Scene;
use bias::{Allowance, Difference, SHRINKING, STRICT, differences};
use images::{Draws, Images, part_names};
use outliers::{Outliers, are_of_scene, outliers};
use std::fmt;

/// How long to examine.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// The number of passes and of the path tracer's images.
    pub images: u64,
    /// The path tracer's samples per image.
    pub samples: u64,
    /// Probability of calling a right scene wrong, if images are normally distributed.
    pub significance: f64,
    /// A render that would take longer than this many seconds is not begun.
    pub seconds: f64,
}

/// The first pass compared. It has about half of the first pass's radii.
const EARLY: u64 = 128;
/// The first pass compared with small radii.
const LATE: u64 = 8192;
/// How many times as long a scene that differs is rendered.
const LONGER: u64 = 4;
/// How many times as many samples the path tracer gets before passes are called too bright.
const MORE_SAMPLES: u64 = 16;

/// Seeds of the path tracer's pictures with few samples that show whether outliers belong to the scene.
const CONTROLS: [u64; 4] = [4, 5, 6, 7];

/// The verdict on a scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// No difference.
    Right,
    /// There was a difference, but not in the longer renders.
    Noise,
    /// A bias that goes away with the radii, and that is within the allowance for the first passes' radii.
    Shrinks(Difference),
    /// One side is too dark by what only a few images hold: undecided.
    Unknown(Difference),
    /// The means differ.
    Biased {
        /// With the radii of the first passes.
        early: Difference,
        /// With much smaller radii; none where they no longer differ.
        late: Option<Difference>,
        /// How many there are.
        count: usize,
    },
    /// A few pixels hold most of an error that is too large.
    Fireflies(Outliers),
    /// The scene may differ, but was not rendered as long as needed to decide. Holds the difference, unless it is
    /// outliers.
    TooLong(Option<Difference>),
}

impl Verdict {
    /// Whether it is a fault of the passes.
    pub fn is_fault(&self) -> bool {
        matches!(self, Self::Biased { .. } | Self::Fireflies(_))
    }

    /// Whether the passes are known to be right.
    pub fn is_settled(&self) -> bool {
        match self {
            Self::Right | Self::Noise | Self::Shrinks(_) | Self::TooLong(None) => true,
            Self::Unknown(_) | Self::TooLong(Some(_)) | Self::Biased { .. } | Self::Fireflies(_) => false,
        }
    }

    /// As one word.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Noise => "noise",
            Self::Shrinks(_) => "shrinks",
            Self::Unknown(_) => "unknown",
            Self::Biased { late: None, .. } => "SLOW",
            Self::Biased { .. } => "BIASED",
            Self::Fireflies(_) => "FIREFLIES",
            Self::TooLong(_) => "too long",
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())?;
        match self {
            Self::Right | Self::Noise | Self::TooLong(None) => Ok(()),
            Self::Shrinks(difference) | Self::Unknown(difference) | Self::TooLong(Some(difference)) => {
                write!(f, ": {difference}")
            }
            Self::Biased {
                early,
                late: None,
                count,
            } => {
                write!(f, ": {early}, {count} such, none with small radii")
            }
            Self::Biased {
                early,
                late: Some(late),
                count,
            } => {
                write!(f, ": {early}, {count} such; with small radii {late}")
            }
            Self::Fireflies(Outliers { ratio, pixels, share }) => write!(
                f,
                ": {pixels} pixels hold {:.0} % of the error, {ratio:.1} times that of the path tracer",
                100.0 * share
            ),
        }
    }
}

/// Both renderers' images of a scene.
struct Pair {
    names: Vec<String>,
    passes: Images,
    reference: Images,
}

impl Pair {
    fn new(scene: &Scene, draws: &Draws) -> Self {
        Self {
            names: part_names(scene),
            passes: Images::of_passes(scene, draws),
            reference: Images::of_reference(scene, draws),
        }
    }

    fn differences(&self, allowance: &Allowance, significance: f64) -> Vec<Difference> {
        let both = [&self.passes, &self.reference];
        differences(&self.names, both, allowance, significance)
    }

    fn outliers(&self) -> Option<Outliers> {
        outliers(&self.passes, &self.reference)
    }
}

/// Compares the renderers on a scene. A scene that passes the first look is not examined further.
pub fn examine(scene: &Scene, effort: &Effort) -> Verdict {
    let draws = Draws {
        seed: 1,
        images: effort.images,
        first_pass: EARLY,
        samples: effort.samples,
    };
    let first = Pair::new(scene, &draws);
    let found = first.differences(&STRICT, effort.significance);
    if found.is_empty() && first.outliers().is_none() {
        return Verdict::Right;
    }
    let is_too_long = |seconds: f64| seconds > effort.seconds;
    if is_too_long(LONGER as f64 * (first.passes.seconds + first.reference.seconds)) {
        return Verdict::TooLong(found.into_iter().next());
    }
    let draws = Draws {
        seed: 2,
        images: LONGER * effort.images,
        ..draws
    };
    let mut pair = Pair::new(scene, &draws);
    let mut found = pair.differences(&STRICT, effort.significance);
    // The path tracer has tails as well, which few samples may not show.
    let first = found.iter().find(|d| !d.is_heavy);
    let is_dark = first.map(|difference| difference.passes < difference.reference);
    if is_dark == Some(false) || is_dark.is_none() && pair.outliers().is_some() {
        if is_too_long(MORE_SAMPLES as f64 * pair.reference.seconds) {
            return Verdict::TooLong(found.into_iter().next());
        }
        let samples = MORE_SAMPLES * effort.samples;
        pair.reference = Images::of_reference(scene, &Draws { samples, ..draws });
        found = pair.differences(&STRICT, effort.significance);
    }
    // And so have the passes.
    if found.iter().any(|d| !d.is_heavy && d.passes < d.reference) {
        if is_too_long(LONGER as f64 * pair.passes.seconds) {
            return Verdict::TooLong(found.into_iter().next());
        }
        let images = LONGER * draws.images;
        pair.passes = Images::of_passes(
            scene,
            &Draws {
                seed: 3,
                images,
                ..draws
            },
        );
        found = pair.differences(&STRICT, effort.significance);
    }
    let surely: Vec<&Difference> = found.iter().filter(|d| !d.is_heavy).collect();
    let Some(early) = surely.first().copied().cloned() else {
        let controls = CONTROLS.map(|seed| Draws {
            seed,
            samples: 1,
            ..draws
        });
        let controls = controls.iter().map(|draws| Images::of_reference(scene, draws));
        let outliers = pair.outliers();
        let outliers = outliers.filter(|found| !are_of_scene(found, controls, &pair.reference));
        return match (outliers, found.into_iter().next()) {
            (Some(outliers), _) => Verdict::Fireflies(outliers),
            (None, Some(difference)) => Verdict::Unknown(difference),
            (None, None) => Verdict::Noise,
        };
    };
    if is_too_long(pair.passes.seconds) {
        return Verdict::TooLong(found.into_iter().next());
    }
    let large = pair.differences(&SHRINKING, effort.significance);
    let is_large = large.iter().any(|d| !d.is_heavy);
    pair.passes = Images::of_passes(
        scene,
        &Draws {
            first_pass: LATE,
            ..draws
        },
    );
    let still = pair.differences(&STRICT, effort.significance);
    let late = still.into_iter().find(|d| !d.is_heavy);
    match (late, is_large) {
        (None, false) => Verdict::Shrinks(early),
        (late, _) => Verdict::Biased {
            early,
            late,
            count: surely.len(),
        },
    }
}
