//! What finds which light, and how many photon paths a pass traces, where the scene does not say: found by a pilot.
//!
//! A pass with M paths has the variance c + p / M, c of what its camera paths draw by chance and p of photons, and
//! takes the work a + b M. The error after a given time goes as the product of the two, which is least at
//!
//! ```text
//! M = sqrt(p a / (c b)).
//! ```
//!
//! The pilot renders small images of the same photons by other camera paths and of other photons by the same ones. Work
//! is counted, not timed: every machine finds the same number. It does so for each way to find the scene's light that
//! may be the best, and takes the one of the least product.

use crate::budget::shrunk;
use crate::estimators::widest_kernel;
use crate::parallel;
use crate::pass::{CameraWork, PassImage, PassPhotons};
use crate::plan::RenderPlan;
use crate::world::{Scene, SceneDescription};
use beamfarm_image::film::Film;
use beamfarm_image::job::{Budget, Finder, Finders, JobSettings, MAX_PASSES};

/// Sets of photons, and of camera paths.
const SETS: usize = 4;
/// Paths of a set.
const PATHS: u32 = 3_000;
/// Pixels of its image along the longer side, at most.
const SIDE: u32 = 48;
/// Of pictures that would take longer than [`LONGEST`].
const SHORT_SIDE: f64 = 24.0;
/// Counted work of the camera paths of one plan's pictures, nanoseconds of a core.
const LONGEST: f64 = 1e9;
/// Scale of its radii: about that of a hundred passes.
const SCALE: f64 = 0.3;
/// What relMSE adds to the square of the reference.
const DARK: f64 = 0.01;
/// Beams in media that ask for kernels narrower than this share of the scene's are not tried.
const NARROWEST: f32 = 0.2;
/// Pixels on each side of one that say how bright it is.
const AROUND: usize = 2;
/// What others must be better by than what is best for most scenes: the pilot is noisy.
const MARGIN: f64 = 0.9;
/// The worst pixels, one in so many, do not count: what they say is chance. Not more, or rare photons, whose kernels
/// are small here, would be all that is left out.
const WILD: usize = 400;
/// The same for what most of the picture is like. Where a few pixels have nearly all of the error, what they say of one
/// way to find light against another is chance still.
const UNEVEN: usize = 10;
/// As much of the error is everywhere, seen or not: light that is hardly ever found leaves most pixels free of noise.
const UNSEEN: f64 = 1e-3;
/// Fewest and most paths that are chosen.
const LEAST: f64 = 500.0;
const MOST: f64 = 500_000.0;

/// What a camera ray, a block of segments, a photon's ray, a photon that is stored and a beam's evaluation take,
/// nanoseconds of a core: fits to the scenes of this repository.
const CAMERA_RAY: f64 = 600.0;
const BLOCK: f64 = 1500.0;
const PHOTON_RAY: f64 = 400.0;
const PHOTON: f64 = 600.0;
const BEAM: f64 = 9000.0;
const EVALUATION: f64 = 50.0;

/// Variances relative to the square of the image plus 0.01, as relMSE is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variances {
    /// Of camera paths.
    pub camera: f64,
    /// Of photons, times their number of paths.
    pub photons: f64,
}

/// What the pilot found, of a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balance {
    /// Of all pixels but the worst one in 400.
    pub variances: Variances,
    /// Of all but the worst tenth.
    pub most: Variances,
    /// Work of camera paths, nanoseconds of a core.
    pub camera_work: f64,
    /// Work of a photon path.
    pub photon_work: f64,
}

/// What a pilot tried.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// With as many photon paths as are best, or as were said.
    pub settings: JobSettings,
    /// What it found.
    pub balance: Balance,
}

impl Candidate {
    /// Relative error times time: the geometric mean of that of the whole picture and that of most of it.
    pub fn cost(&self) -> f64 {
        self.balance.cost(self.settings.paths_per_pass)
    }
}

/// What a pilot chose among.
#[derive(Clone, Debug)]
pub struct Choice {
    /// The first is what is best for most scenes.
    pub candidates: Vec<Candidate>,
    /// Number of the one that was taken.
    pub best: usize,
}

impl Choice {
    /// Let a pilot choose what the settings do not say. `paths`: as many as a pass is to have, whatever is best.
    /// `None`: there is nothing to choose.
    pub fn new(description: &SceneDescription, settings: JobSettings, paths: Option<u32>) -> Option<Self> {
        let mut scene = Scene::new(shrunk(description, SIDE));
        let mut plans = plans_of(&scene, settings);
        if plans.len() == 1 && (paths.is_some() || !plans[0].has_photons()) {
            return None;
        }
        let too_long = work_of_pictures(&scene, &plans[0]) / LONGEST;
        if too_long > 1.0 {
            let side = (f64::from(SIDE) / too_long.sqrt()).max(SHORT_SIDE);
            scene = Scene::new(shrunk(description, side as u32));
            plans = plans_of(&scene, settings);
        }
        let pixels = f64::from(description.camera.width) * f64::from(description.camera.height);
        let candidates = plans.iter().map(|plan| {
            let balance = Balance::new(&scene, plan, pixels);
            let settings = JobSettings {
                paths_per_pass: paths.unwrap_or_else(|| balance.paths()),
                finders: plan.settings.finders,
                ..settings
            };
            Candidate { settings, balance }
        });
        let candidates: Vec<Candidate> = candidates.collect();
        let mut best = 0;
        for (number, candidate) in candidates.iter().enumerate() {
            let margin = if best == 0 { MARGIN } else { 1.0 };
            if candidate.cost() < margin * candidates[best].cost() {
                best = number;
            }
        }
        Some(Self { candidates, best })
    }

    /// The settings that were found best.
    pub fn settings(&self) -> JobSettings {
        self.candidates[self.best].settings
    }
}

/// Plans of the pilot's passes, the first of them by what is best for most scenes.
fn plans_of(scene: &Scene, settings: JobSettings) -> Vec<RenderPlan> {
    let plan = |finders| {
        let budget = Some(Budget {
            passes: MAX_PASSES,
            scale: SCALE,
        });
        let settings = JobSettings {
            seed: 0,
            budget,
            paths_per_pass: PATHS,
            finders,
            ..settings
        };
        RenderPlan::new(scene, settings)
    };
    let said = settings.finders;
    let mut plans = vec![plan(said)];
    // Who sees what is for rules to say.
    if scene.description().rules.is_some() {
        return plans;
    }
    let mut others = Vec::new();
    let ceiling = plans[0].radii.smooth_ceiling;
    if said.media.is_none() && (NARROWEST * ceiling..ceiling).contains(&widest_kernel(scene)) {
        let media = Some(Finder::Photons);
        others.push(Finders { media, ..said });
    }
    if plans[0].has_photons() {
        let by = |said: Option<Finder>, finder| said.or(Some(finder));
        let media = by(said.media, Finder::Paths);
        others.push(Finders { media, ..said });
        // Not by photons alone: where few of them come, but bright ones, pictures as small as these see none.
        if plans[0].estimators.specular {
            let caustics = by(said.caustics, Finder::Paths);
            others.push(Finders {
                media,
                caustics,
                ..said
            });
        }
    }
    for finders in others {
        let other = plan(finders);
        if plans.iter().all(|plan| plan.estimators != other.estimators) {
            plans.push(other);
        }
    }
    plans
}

/// Counted work of the camera paths of all pictures by a plan, from that of one.
fn work_of_pictures(scene: &Scene, plan: &RenderPlan) -> f64 {
    let image = PassPhotons::new(scene, plan, MAX_PASSES - 1).render(scene, plan, MAX_PASSES - 1, None);
    let CameraWork {
        rays,
        evaluations,
        blocks,
    } = image.camera;
    let pictures = if plan.has_photons() { SETS * SETS } else { SETS };
    pictures as f64 * (CAMERA_RAY * rays as f64 + BLOCK * blocks as f64 + EVALUATION * evaluations as f64)
}

impl Balance {
    /// Render small images. Deterministic: by scene and plan alone, in passes that no job has. `pixels`: of the image
    /// that they are for.
    fn new(scene: &Scene, plan: &RenderPlan, pixels: f64) -> Self {
        let last = |k: usize| MAX_PASSES - 1 - k as u64;
        let sets = if plan.has_photons() { SETS } else { 1 };
        let photons = parallel::map(sets, |set| PassPhotons::new(scene, plan, last(set)));
        // By photons, then by camera paths.
        let images = parallel::map(sets * SETS, |i| {
            photons[i / SETS].render(scene, plan, last(SETS + i % SETS), None)
        });
        // Without photons the same for all of them.
        let film = |set: usize, camera: usize| &images[set % sets * SETS + camera].film;
        let films = std::array::from_fn(|set| std::array::from_fn(|camera| film(set, camera)));
        let [variances, most] = variances(&films).map(|of| Variances {
            photons: of.photons * f64::from(PATHS),
            ..of
        });
        let paths = f64::from(plan.surface_paths);
        let mean =
            |count: &dyn Fn(&PassImage) -> u64| images.iter().map(count).sum::<u64>() as f64 / images.len() as f64;
        let share = pixels / films[0][0].pixels.len() as f64;
        Self {
            variances,
            most,
            camera_work: share * (CAMERA_RAY * mean(&|i| i.camera.rays) + BLOCK * mean(&|i| i.camera.blocks)),
            photon_work: (PHOTON_RAY * mean(&|i| i.photon_rays) + PHOTON * mean(&|i| i.stats.surface_photons)) / paths
                + (BEAM * mean(&|i| i.stats.beams) + share * EVALUATION * mean(&|i| i.camera.evaluations))
                    / f64::from(PATHS),
        }
    }

    /// The number of paths with the least error after a given time.
    pub fn paths(&self) -> u32 {
        let Variances { camera, photons } = self.variances;
        let square = photons * self.camera_work / (camera * self.photon_work);
        // Without any variance there is nothing to choose.
        let paths = if square.is_nan() { LEAST } else { square.sqrt() };
        let paths = paths.clamp(LEAST, MOST);
        // Two digits say all that is known.
        let unit = libm::pow(10.0, libm::floor(libm::log10(paths)) - 1.0);
        (libm::round(paths / unit) * unit) as u32
    }

    /// Relative error times time with so many paths, to be compared with that of others.
    pub fn cost(&self, paths: u32) -> f64 {
        let paths = f64::from(paths);
        let variance = |of: Variances| of.camera + of.photons / paths;
        let all = variance(self.variances);
        let variance = libm::sqrt(all * (variance(self.most) + UNSEEN * all));
        variance * (self.camera_work + self.photon_work * paths)
    }
}

/// Variances by camera paths and by one set of photons, of all but the worst pixels and of most. `films`: by photons,
/// then by camera paths.
fn variances(films: &[[&Film; SETS]; SETS]) -> [Variances; 2] {
    let n = SETS as f64;
    let count = films[0][0].pixels.len();
    let smooth = smoothed(films);
    let mut pixels: Vec<[f64; 2]> = (0..count)
        .map(|i| {
            let mut sums = [0.0; 2];
            for (channel, smooth) in smooth[i].iter().enumerate() {
                let at = |photons: usize, camera: usize| f64::from(films[photons][camera].pixels[i][channel]);
                // For each camera, the variance over photons; then that over cameras of their means.
                let of_camera: [[f64; 2]; SETS] =
                    std::array::from_fn(|camera| moments(std::array::from_fn(|photons| at(photons, camera))));
                let [_, camera] = moments(of_camera.map(|[mean, _]| mean));
                let photons = of_camera.iter().map(|[_, variance]| variance).sum::<f64>() / n;
                let weight = 1.0 / (smooth * smooth + DARK);
                sums[0] += weight * camera;
                sums[1] += weight * photons;
            }
            sums
        })
        .collect();
    let mut means = [[0.0; 2]; 2];
    for which in 0..2 {
        pixels.sort_by(|a, b| a[which].total_cmp(&b[which]));
        for (means, out) in means.iter_mut().zip([WILD, UNEVEN]) {
            let kept = count - count / out;
            means[which] = pixels[..kept].iter().map(|pixel| pixel[which]).sum::<f64>() / (3 * kept) as f64;
        }
    }
    means.map(|[camera, photons]| Variances { camera, photons })
}

/// The mean of all images around each pixel: by its own few samples alone bright ones would weigh themselves down.
fn smoothed(films: &[[&Film; SETS]; SETS]) -> Vec<[f64; 3]> {
    let (width, height) = (films[0][0].width as usize, films[0][0].height as usize);
    let all: Vec<&Film> = films.iter().flatten().copied().collect();
    let around = |i: usize, end: usize| i.saturating_sub(AROUND)..(i + AROUND + 1).min(end);
    let mean = |i: usize| {
        let mut sum = [0.0; 3];
        let mut samples = 0.0;
        for y in around(i / width, height) {
            for x in around(i % width, width) {
                for film in &all {
                    let pixel = film.pixels[y * width + x].map(f64::from);
                    sum.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += value);
                    samples += 1.0;
                }
            }
        }
        sum.map(|sum| sum / samples)
    };
    (0..width * height).map(mean).collect()
}

/// Mean and variance.
fn moments(values: [f64; SETS]) -> [f64; 2] {
    let n = SETS as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    [mean, squares / (n - 1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Purpose, Sampler};

    fn made(camera: f64, photons: f64) -> Balance {
        let variances = Variances { camera, photons };
        Balance {
            variances,
            most: variances,
            camera_work: 4e6,
            photon_work: 1500.0,
        }
    }

    #[test]
    fn the_number_of_paths_has_the_least_cost() {
        for balance in [made(0.1, 300.0), made(2.0, 5000.0), made(0.01, 9000.0)] {
            let paths = balance.paths();
            let least = balance.cost(paths);
            let others = (1..200).map(|k| (LEAST * libm::pow(1.04, f64::from(k))) as u32);
            // Two digits of it are kept, and the cost is flat there.
            assert!(
                others.map(|other| balance.cost(other)).all(|cost| cost > 0.998 * least),
                "{paths}"
            );
        }
    }

    /// A tenth more by chance in the few pixels that have all of the error, against a tenth of it in the others.
    #[test]
    fn a_few_pixels_do_not_decide() {
        let balance = |all: f64, most: f64| Balance {
            most: Variances {
                camera: most,
                photons: 0.0,
            },
            ..made(all, 0.0)
        };
        assert!(balance(1.1, 0.005).cost(1000) < 0.5 * balance(1.0, 0.05).cost(1000));
        // Light that is hardly ever found is no light without noise.
        assert!(balance(100.0, 0.0).cost(1000) > balance(1.0, 0.1).cost(1000));
        assert_eq!(balance(0.0, 0.0).cost(1000), 0.0);
    }

    #[test]
    fn images_without_noise_have_paths() {
        assert_eq!(made(0.0, 0.0).paths(), LEAST as u32);
        assert_eq!(made(0.1, 0.0).paths(), LEAST as u32);
        assert_eq!(made(0.0, 0.1).paths(), MOST as u32);
    }

    /// Two by two of each: what photons add and what camera paths add are told apart.
    #[test]
    fn variances_are_told_apart() {
        let film = |photons: usize, camera: usize| {
            let mut film = Film::new(2, 1);
            let [p, c] = [photons, camera].map(|set| [-1.0, 1.0][set % 2]);
            film.pixels.fill([(2.0 + 0.1 * p + 0.03 * c) as f32; 3]);
            film
        };
        let films: [[Film; SETS]; SETS] = std::array::from_fn(|p| std::array::from_fn(|c| film(p, c)));
        let [Variances { camera, photons }, _] = variances(&films.each_ref().map(|row| row.each_ref()));
        // Of +-1 in turns, the sample variance of four is 4/3.
        let weight = 4.0 / 3.0 / (4.0 + DARK);
        assert!((camera / (9e-4 * weight) - 1.0).abs() < 1e-3, "{camera}");
        assert!((photons / (1e-2 * weight) - 1.0).abs() < 1e-3, "{photons}");
    }

    /// Light in drops of 8, by which a pixel of few samples looks bright: mean 1, variance 7. Without the few brightest
    /// pixels, and with the weight of a mean that is noisy itself, within a third.
    #[test]
    fn rare_light_is_noise() {
        let film = |camera: u64| {
            let mut sampler = Sampler::new(1, camera, Purpose::Test, 0);
            let mut film = Film::new(32, 32);
            let drop = |_: &mut [f32; 3]| [if sampler.next_1d() < 0.125 { 8.0 } else { 0.0 }; 3];
            let drops: Vec<[f32; 3]> = film.pixels.iter_mut().map(drop).collect();
            film.pixels = drops;
            film
        };
        let films: [Film; SETS] = std::array::from_fn(|camera| film(camera as u64));
        let [Variances { camera, photons }, _] = variances(&[films.each_ref(); SETS]);
        assert!((camera / 7.0 - 1.0).abs() < 0.33, "{camera}");
        assert_eq!(photons, 0.0);
    }
}
