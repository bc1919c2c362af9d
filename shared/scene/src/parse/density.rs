//! Grids of numbers, from files or recipes.

use super::{Fault, given};
use crate::values::*;
use schemars::JsonSchema;
use serde::Deserialize;

/// A volume file, or a recipe.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DensityRecord {
    /// .vdb or .vol, relative to the scene file.
    pub file: Option<Spanned<String>>,
    /// Name of a grid in the file. Default: density, or the only one.
    pub grid: Option<Spanned<String>>,
    /// Lower corner of the box that a recipe fills.
    pub min: Option<Spanned<Vector>>,
    /// Upper corner of the box that a recipe fills.
    pub max: Option<Spanned<Vector>>,
    /// Spacing of samples, scene units. Default: the longest side / 64.
    pub voxel: Option<Spanned<Number<Positive>>>,
    /// Density that falls off with height.
    pub height: Option<Spanned<HeightRecord>>,
    /// A sum of Gaussians.
    pub blobs: Option<Spanned<Vec<BlobRecord>>>,
    /// Fractal noise.
    pub noise: Option<Spanned<NoiseRecord>>,
    /// One of `textures` as another factor; its coordinates are in the density's own space.
    pub texture: Option<Spanned<String>>,
    /// Which output of that texture. Default: the first.
    pub output: Option<Spanned<String>>,
}

impl DensityRecord {
    pub fn check(&self) -> Result<(), Fault> {
        let given = given!(self, grid, min, max, voxel, height, blobs, noise, texture, output);
        let (takes, message): (&[&str], _) = match self.file {
            Some(_) => (
                &["grid"],
                "a density takes only `grid` beside `file`; `min`, `max` and the rest describe one without a file",
            ),
            None => (
                &["min", "max", "voxel", "height", "blobs", "noise", "texture", "output"],
                "it names one of the grids of a `file`, and this density has none",
            ),
        };
        for (field, span) in given {
            if let Some(span) = span
                && !takes.contains(&field)
            {
                return Err(Fault::new(span, message));
            }
        }
        Ok(())
    }
}

/// 1 up to y = base, above it exp(-(y - base) / scale).
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeightRecord {
    /// Height where the falloff begins, scene units. Default: 0.
    pub base: Option<Number<Finite>>,
    /// Height over which the density falls to 1/e, scene units.
    pub scale: Number<Positive>,
}

/// density exp(-d^2 / (2 radius^2)) at distance d from the centre.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BlobRecord {
    /// Centre of the Gaussian.
    pub center: Vector,
    /// Standard deviation, scene units.
    pub radius: Number<Positive>,
    /// Density at the centre. Default: 1.
    pub density: Option<Number<NonNegative>>,
}

/// max(0, 1 + contrast n), with the noise n.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoiseRecord {
    /// Wavelength of the coarsest octave, scene units.
    pub size: Spanned<Number<Positive>>,
    /// Octaves, 1 to 12. Default: 4.
    #[schemars(range(min = 1, max = 12))]
    pub octaves: Option<Spanned<u32>>,
    /// Ratio of each octave's strength to that of the octave before. Default: 0.5.
    pub gain: Option<Number<Unit>>,
    /// Strength. Default: 1.
    pub contrast: Option<Number<NonNegative>>,
    /// Seed. Default: 0.
    pub seed: Option<u32>,
}
