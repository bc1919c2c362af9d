//! Densities from formulas, for scenes without volume files. They are sampled once, at scene load. From then on they
//! are grids like any other, with exact bounds, and the renderer shows their trilinear interpolation.

use super::bricks::{BRICK, Core, RawDensity};
use crate::parallel;
use crate::world::texture::TexturePoint;
use crate::world::texture::graph::{Place, Program};
use glam::{DAffine3, DVec3, IVec3};
use noise::{NoiseFn, Perlin};
use std::sync::Arc;

/// A density as the product of the given factors. Lengths are in units of the recipe's own space; y is up.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// Opposite corners of its box.
    pub corners: [DVec3; 2],
    /// Spacing of samples.
    pub voxel: f64,
    /// Falls off with height.
    pub height: Option<Height>,
    /// Sum of soft-edged balls.
    pub blobs: Vec<Blob>,
    /// Clumps.
    pub noise: Option<Noise>,
    /// A graph, evaluated in the recipe's own space; "generated" coordinates are those of the box.
    pub graph: Option<Arc<Program>>,
}

/// 1 up to y = `base`, above it exp(-(y - base) / scale).
#[derive(Clone, Copy, Debug)]
pub struct Height {
    /// Height above which it falls off.
    pub base: f64,
    /// Height over which the density falls by e.
    pub scale: f64,
}

/// A Gaussian: `density` exp(-d^2 / (2 radius^2)) at distance d.
#[derive(Clone, Copy, Debug)]
pub struct Blob {
    /// Centre.
    pub center: DVec3,
    /// Standard deviation.
    pub radius: f64,
    /// Density at the centre.
    pub density: f64,
}

/// max(0, 1 + contrast n), with n gradient noise (Perlin 2002) summed over octaves. Each octave has half the size and
/// `gain` times the strength of the one before. Normalised to [-1, 1], and rarely beyond [-0.5, 0.5].
#[derive(Clone, Copy, Debug)]
pub struct Noise {
    /// Size of the largest clumps.
    pub size: f64,
    /// Number of octaves.
    pub octaves: u32,
    /// Ratio of strength from octave to octave.
    pub gain: f64,
    /// Overall strength.
    pub contrast: f64,
    /// Other seeds give other clumps.
    pub seed: u32,
}

/// Most samples of a recipe, including those that fill up the last bricks: 1 GiB.
const MAX_SAMPLES: f64 = 268_435_456.0;
/// Most samples along an axis.
const MAX_ALONG: f64 = 1_048_576.0;
/// Most cells of the finest noise between the origin and the farthest corner.
const MAX_CELLS: f64 = 1e6;

/// Why a recipe cannot be sampled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecipeError {
    /// Its box has no inside.
    #[error("expected more than `min`, {min}, on every axis, found {max}")]
    Corners {
        /// One corner.
        min: DVec3,
        /// The other.
        max: DVec3,
    },
    /// More samples than fit into memory.
    #[error(
        "{:.3e} x {:.3e} x {:.3e} samples at a distance of {voxel}; expected at most {MAX_ALONG} along an axis and, in bricks of \
         8 x 8 x 8, {MAX_SAMPLES} in all", count.x, count.y, count.z
    )]
    Samples {
        /// Samples along each axis.
        count: DVec3,
        /// Their spacing.
        voxel: f64,
    },
    /// Clumps too small for the box.
    #[error(
        "expected at least {least:.3e}, for {octaves} octaves in a box that reaches as far as this one, found {size}"
    )]
    Noise {
        /// Size of the largest clumps.
        size: f64,
        /// Octaves.
        octaves: u32,
        /// Smallest size that is supported.
        least: f64,
    },
}

/// A graph's input at a point of a density's own space, given its relative position in the box, by axis.
pub fn point(own: DVec3, share: DVec3) -> TexturePoint {
    TexturePoint {
        place: Place {
            world: own.as_vec3(),
            own: own.as_vec3(),
            generated: share.as_vec3(),
            ..Place::NOWHERE
        },
        ..TexturePoint::default()
    }
}

impl Recipe {
    /// Samples the recipe. Deterministic.
    pub fn sample(&self) -> Result<RawDensity, RecipeError> {
        let [low, high] = self.corners;
        let size = high - low;
        if !size.cmpgt(DVec3::ZERO).all() {
            return Err(RecipeError::Corners { min: low, max: high });
        }
        // Samples at the centres of voxels, which fill the box.
        let count = (size / self.voxel).round().max(DVec3::ONE);
        let filled_up = (count / BRICK as f64).ceil() * BRICK as f64;
        if !(count.max_element() <= MAX_ALONG && filled_up.element_product() <= MAX_SAMPLES) {
            return Err(RecipeError::Samples {
                count,
                voxel: self.voxel,
            });
        }
        if let Some(noise) = &self.noise {
            let farthest = low.abs().max(high.abs()).max_element();
            let least = farthest * libm::exp2(noise.octaves as f64) / MAX_CELLS;
            if noise.size < least {
                return Err(RecipeError::Noise {
                    size: noise.size,
                    octaves: noise.octaves,
                    least,
                });
            }
        }
        let step = size / count;
        let count = count.as_ivec3();
        let to_object = DAffine3::from_translation(low)
            * DAffine3::from_scale(step)
            * DAffine3::from_translation(DVec3::splat(0.5));
        let perlin = self.noise.map(|noise| Perlin::new(noise.seed));
        let bricks = (count + (BRICK as i32 - 1)) / BRICK as i32;
        let core = |index: i32| {
            let brick = IVec3::new(
                index % bricks.x,
                index / bricks.x % bricks.y,
                index / (bricks.x * bricks.y),
            );
            let samples = std::array::from_fn(|i| {
                let within = IVec3::new(i as i32 & 7, i as i32 >> 3 & 7, i as i32 >> 6);
                let sample = (brick * BRICK as i32 + within).min(count - 1);
                let at = to_object.transform_point3(sample.as_dvec3());
                self.density(at, perlin.as_ref()) as f32
            });
            (brick.to_array(), Core::Samples(Box::new(samples)))
        };
        let cores = parallel::map(bricks.element_product() as usize, |index| core(index as i32));
        Ok(RawDensity {
            cores: cores.into_iter().collect(),
            samples: [IVec3::ZERO, count - 1],
            domain: [DVec3::splat(-0.5), count.as_dvec3() - 0.5],
            to_object,
        })
    }

    /// The density at a point.
    fn density(&self, p: DVec3, perlin: Option<&Perlin>) -> f64 {
        let mut density = 1.0;
        if let Some(height) = &self.height {
            density *= libm::exp(-((p.y - height.base) / height.scale).max(0.0));
        }
        if !self.blobs.is_empty() {
            let one = |b: &Blob| {
                let d2 = p.distance_squared(b.center) / (b.radius * b.radius);
                b.density * libm::exp(-0.5 * d2)
            };
            density *= self.blobs.iter().map(one).sum::<f64>();
        }
        if let (Some(noise), Some(perlin)) = (&self.noise, perlin) {
            let (mut sum, mut total, mut strength) = (0.0, 0.0, 1.0);
            let mut q = p / noise.size;
            for _ in 0..noise.octaves {
                sum += strength * perlin.get(q.to_array());
                total += strength;
                strength *= noise.gain;
                // Twice as fine, and shifted, so that the octaves' lattices do not coincide.
                q = q * 2.0 + DVec3::new(0.371, 0.713, 0.159);
            }
            density *= (1.0 + noise.contrast * sum / total).max(0.0);
        }
        if let Some(graph) = &self.graph {
            let [low, high] = self.corners;
            let at = point(p, (p - low) / (high - low));
            density *= f64::from(graph.eval(&at).x);
        }
        density
    }
}
