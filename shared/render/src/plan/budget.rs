//! Radii for a known number of passes, found by a pilot.
//!
//! The mean square error of the average of N passes at radius scale c is
//!
//! ```text
//! (v / c + w) / N + b^2 c^(2 p),
//! ```
//!
//! where v is the variance that goes as one over the radius (of beams, and of surface photons, for which the area takes
//! the scale) and w the variance of all else. The bias grows as c^p: p = 2 where the light that a beam blurs is smooth,
//! p = 1 at edges and for surface photons, and less at the bright rims of caustics, which make most of an image's bias;
//! p = 3/4 is taken. The pilot renders small images with the same photons at two scales. Their variances give v, their
//! difference b. The error is least at c = (v / (2 p b^2 N))^(1 / (2 p + 1)), so a pilot that is wrong by half changes
//! c by a fifth.

use crate::plan::RenderPlan;
use crate::plan::engine::{Engine, PassImage};
use crate::world::Scene;
use crate::world::SceneDescription;
use crate::world::filter::PixelFilter;
use beamfarm_image::film::Film;
use beamfarm_image::job::{Budget, JobSettings, MAX_PASSES};

/// Passes of the pilot at each scale.
const PASSES: u64 = 4;
/// Scales of the pilot.
const SCALES: [f64; 2] = [0.5, 2.0];
/// p: the bias grows as this power of the scale.
const POWER: f64 = 0.75;
/// Most pixels of the pilot's image along its longer side: enough for a mean over the image, few enough to be cheap.
const SIDE: u32 = 160;
/// The term that relMSE adds to the square of the reference.
pub(super) const DARK: f64 = 0.01;
/// Range of scales to choose from: not far below those of the pilot, and no radii beyond the base radii, because
/// searching more beams takes more time than their lower variance saves.
const CHOICE: [f64; 2] = [1.0 / 16.0, 1.0];

/// What the pilot found, as means over the image. Errors are relative to the square of the image plus 0.01, as in
/// relMSE.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pilot {
    /// Variance of a pass at scale one: the part that goes as one over the scale.
    pub variance: f64,
    /// All other variance of a pass.
    pub rest: f64,
    /// Square of the bias at scale one. At least its own standard error, so that a pilot that saw nothing does not make
    /// radii large.
    pub squared_bias: f64,
}

impl Pilot {
    /// Render the pilot. Deterministic: it depends on scene and settings alone, and uses pass indices that no job has.
    pub fn new(engine: &impl Engine, description: &SceneDescription, settings: JobSettings) -> Self {
        let scene = Scene::new(shrunk(description, SIDE));
        let plan = |scale| {
            let budget = Some(Budget {
                passes: MAX_PASSES,
                scale,
            });
            RenderPlan::new(&scene, JobSettings { budget, ..settings })
        };
        let plans = SCALES.map(plan);
        let passes = (0..PASSES).map(|k| {
            plans.each_ref().map(|plan| {
                // If the scene is interrupted meanwhile, the pictures say nothing.
                let pass = engine.pass(&scene, plan, MAX_PASSES - 1 - k);
                pass.unwrap_or_else(|_| PassImage::black(&scene)).film
            })
        });
        Self::of(&passes.collect::<Vec<_>>())
    }

    /// The result, from passes at [`SCALES`].
    fn of(passes: &[[Film; 2]]) -> Self {
        let count = passes.len() as f64;
        let values = passes.first().map_or(0, |films| films[0].pixels.len() * 3);
        let at = |film: &Film, i: usize| f64::from(film.pixels[i / 3][i % 3]);
        let mut variances = [0.0; 2];
        // Square of the mean difference, minus the share of noise.
        let (mut step, mut step_squares) = (0.0, 0.0);
        for i in 0..values {
            let [small, large] = [0, 1].map(|k| sums(passes.iter().map(|films| at(&films[k], i))));
            let mean = (small[0] + large[0]) / (2.0 * count);
            let weight = 1.0 / (mean * mean + DARK) / values as f64;
            for (variance, [sum, squares]) in variances.iter_mut().zip([small, large]) {
                *variance += weight * (squares - sum * sum / count) / (count - 1.0);
            }
            let differences = passes.iter().map(|[small, large]| at(large, i) - at(small, i));
            let [sum, squares] = sums(differences);
            let square = weight * (sum * sum - squares) / (count * (count - 1.0));
            step += square;
            step_squares += square * square;
        }
        // v / c + w at the two scales.
        let inverses = SCALES.map(f64::recip);
        let variance = (variances[0] - variances[1]) / (inverses[0] - inverses[1]);
        let variance = variance.max(0.0);
        let growth = libm::pow(SCALES[1], POWER) - libm::pow(SCALES[0], POWER);
        Self {
            variance,
            rest: (variances[1] - variance * inverses[1]).max(0.0),
            squared_bias: step.max(step_squares.sqrt()) / (growth * growth),
        }
    }

    /// The expected mean square error of this many passes at a scale, as relMSE.
    pub fn error(&self, passes: u64, scale: f64) -> f64 {
        (self.variance / scale + self.rest) / passes as f64 + self.squared_bias * libm::pow(scale, 2.0 * POWER)
    }

    /// The radii of least error after this many passes.
    pub fn budget(&self, passes: u64) -> Budget {
        let [least, most] = CHOICE;
        let ratio = self.variance / (2.0 * POWER * self.squared_bias * passes as f64);
        let scale = match ratio.is_finite() && self.variance > 0.0 {
            true => libm::pow(ratio, 1.0 / (2.0 * POWER + 1.0)),
            // The pilot saw nothing that depends on radii, or the number of passes is not finite and will be refused.
            false => 1.0,
        };
        Budget {
            passes,
            scale: scale.clamp(least, most),
        }
    }
}

/// The scene with at most `side` pixels along the image's longer side, each of them as sharp.
pub(crate) fn shrunk(description: &SceneDescription, side: u32) -> SceneDescription {
    let mut small = description.clone();
    let camera = &mut small.camera;
    let shrink = f64::from(camera.width.max(camera.height)) / f64::from(side);
    if shrink > 1.0 {
        let side = |pixels: u32| ((f64::from(pixels) / shrink) as u32).max(1);
        camera.resize(side(camera.width), side(camera.height));
        camera.filter = narrowed(camera.filter, shrink as f32);
    }
    small
}

/// The filter for an image with 1 / `shrink` times the pixels per row: blur that averages out within a large pixel
/// shows in small ones.
fn narrowed(filter: PixelFilter, shrink: f32) -> PixelFilter {
    match filter {
        // The tent of the same standard deviation.
        PixelFilter::Box => PixelFilter::Tent {
            radius: std::f32::consts::FRAC_1_SQRT_2 / shrink,
        },
        PixelFilter::Tent { radius } => PixelFilter::Tent {
            radius: radius / shrink,
        },
        PixelFilter::Gaussian { stddev } => PixelFilter::Gaussian {
            stddev: stddev / shrink,
        },
    }
}

/// Sum and sum of squares.
fn sums(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([0.0; 2], |[sum, squares], x| [sum + x, squares + x * x])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Passes of two pixels with known noise and bias: alternating +-`noise` / sqrt(c), and `bias` c^p.
    fn made(bias: f64, noise: f64) -> Pilot {
        let film = |scale: f64, sign: f64| {
            let mut film = Film::new(2, 1);
            let value = 2.0 + sign * noise / scale.sqrt() + bias * libm::pow(scale, POWER);
            film.pixels.fill([value as f32; 3]);
            film
        };
        let passes = (0..PASSES).map(|k| {
            let sign = [1.0, -1.0][k as usize % 2];
            SCALES.map(|scale| film(scale, sign))
        });
        Pilot::of(&passes.collect::<Vec<_>>())
    }

    #[test]
    fn variance_and_bias_of_made_passes_are_found() {
        let pilot = made(0.05, 0.01);
        // The mean over the passes, which weights them.
        let mean: f64 = 2.0 + 0.05 * SCALES.map(|c| libm::pow(c, POWER)).iter().sum::<f64>() / 2.0;
        let weight = 1.0 / (mean * mean + DARK);
        // The sample variance of four values alternating between +-1 is 4/3, and so is that of their differences.
        let variance = weight * 1e-4 * 4.0 / 3.0;
        assert!((pilot.variance / variance - 1.0).abs() < 1e-3, "{pilot:?}");
        assert!(pilot.rest < 1e-3 * variance, "{pilot:?}");
        let growth = libm::pow(2.0, POWER) - libm::pow(0.5, POWER);
        let noise = 0.01 * (2f64.sqrt() - 0.5f64.sqrt());
        let squared = weight * (0.05 * 0.05 - noise * noise / 3.0 / (growth * growth));
        assert!((pilot.squared_bias / squared - 1.0).abs() < 1e-3, "{pilot:?}");
    }

    #[test]
    fn the_budget_has_the_least_error() {
        for (bias, noise) in [(0.05, 0.01), (0.01, 0.1), (0.2, 0.5)] {
            let pilot = made(bias, noise);
            for passes in [1, 16, 1000] {
                let Budget { scale, .. } = pilot.budget(passes);
                let least = pilot.error(passes, scale);
                let others = (1..400).map(|k| CHOICE[0] * libm::pow(1.0105, f64::from(k)));
                for other in others.filter(|other| *other < CHOICE[1]) {
                    assert!(least <= pilot.error(passes, other) * (1.0 + 1e-12), "{other}");
                }
            }
        }
    }

    #[test]
    fn images_without_noise_or_without_bias_have_radii() {
        for pilot in [made(0.0, 0.0), made(0.1, 0.0), made(0.0, 0.1)] {
            let Budget { scale, .. } = pilot.budget(64);
            assert!((CHOICE[0]..=CHOICE[1]).contains(&scale), "{pilot:?}");
        }
    }
}
