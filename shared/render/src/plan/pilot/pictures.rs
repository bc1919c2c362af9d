//! The pilot's small pictures of a plan: how noisy they are, what they take, and what light they miss.

use crate::parallel;
use crate::plan::RenderPlan;
use crate::plan::engine::{Engine, PassImage};
use crate::plan::frustum::Frustum;
use crate::world::Scene;
use beamfarm_image::film::Film;
use beamfarm_image::job::MAX_PASSES;

/// Sets of photons.
const SETS: usize = 4;
/// Scale of its radii: about that of a hundred passes.
pub(super) const SCALE: f64 = 0.3;
/// Least that evenness leaves of a variance. The passes of a job gain more by it than those of half a pilot.
const MOST_EVEN: f64 = 0.2;
/// What relMSE adds to the square of the reference.
const DARK: f64 = 0.01;
/// Pixels on each side of one that say how bright it is.
const AROUND: usize = 2;
/// Blocks along each side, in which light is looked for that others found.
const BLOCKS: usize = 8;
/// Light is missing where less than this share of what others are sure of was found: blocks of pictures of different
/// sizes are not quite the same.
const MISSED: f64 = 0.8;
/// It certainly is, too, where the whole image is darker than this share of that.
const DIMMER: f64 = 0.95;
/// Standard error of the image's mean, relative to that, above which nothing is sure.
const UNSURE: f64 = 0.3;
/// By how much what is missing may change what a plan is worth before it is in doubt.
const DOUBTFUL: f64 = 1.3;
/// Light counts as found above so many of its standard errors, by [`SETS`] pictures each: Student's t with three
/// degrees of freedom is above that once in seventy.
const SURE: f64 = 4.0;

/// What a camera ray, a block of segments, a photon's ray, a photon that is stored and a beam's evaluation take,
/// nanoseconds of a core: fits to the scenes of this repository.
const CAMERA_RAY: f64 = 550.0;
const BLOCK_OF_SEGMENTS: f64 = 200.0;
const PHOTON_RAY: f64 = 800.0;
const PHOTON: f64 = 1200.0;
const BEAM: f64 = 7000.0;
const EVALUATION: f64 = 150.0;
/// What it takes to aim a photon: all discs on its way count for the density that it starts with.
const AIMED: f64 = 2000.0;

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
    /// Means over the image.
    pub variances: Variances,
    /// Work of camera paths, nanoseconds of a core.
    pub camera_work: f64,
    /// Work of a photon path.
    pub photon_work: f64,
}

/// How much is rendered for a plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// Pictures by other camera paths for each set of photons, an even number; without photons twice as many in all.
    pub cameras: usize,
    /// Photon paths of a set.
    pub paths: u32,
}

/// A plan's pictures.
pub(super) struct Pictures {
    balance: Balance,
    /// Mean and square of its standard error, of each block and channel, and at last of the whole image.
    blocks: Vec<[f64; 2]>,
    /// Samples of the image, and photon paths, that the means are of.
    samples: f64,
    paths: f64,
    /// Width and height.
    pub size: [u32; 2],
    /// Counted work of the camera, and of photons, nanoseconds of a core.
    pub work: [f64; 2],
}

/// What the pictures of a plan are worth, beside what others found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Judged {
    pub balance: Balance,
    /// More of which would tell it better, if most of what is known is that light is missing.
    pub wants: Option<More>,
}

/// What pictures may want more of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum More {
    Photons,
    CameraPaths,
}

impl Pictures {
    /// Render them. Deterministic: by scene and plan alone, in passes that no job has. `pixels`: of the image that they
    /// are for.
    ///
    /// Of a scene that is interrupted meanwhile they say nothing.
    pub fn new(engine: &impl Engine, scene: &Scene, plan: &RenderPlan, pixels: f64, effort: Effort) -> Self {
        let more = effort.paths / plan.settings.paths_per_pass.max(1);
        let mut plan = plan.clone();
        plan.settings.paths_per_pass = effort.paths;
        plan.surface_paths = plan.surface_paths.saturating_mul(more.max(1));
        plan.view = Frustum::of(scene);
        let last = |k: usize| MAX_PASSES - 1 - k as u64;
        // Two halves, which are even by themselves and independent of each other.
        let turn = |camera: usize, cameras: usize| match camera < cameras / 2 {
            true => last(SETS + camera),
            false => MAX_PASSES / 2 - 1 - camera as u64,
        };
        let (sets, cameras) = match plan.has_photons() {
            true => (SETS, effort.cameras),
            false => (1, 2 * effort.cameras.max(SETS / 2)),
        };
        let photons = parallel::map(sets, |set| engine.photons(scene, &plan, last(set)));
        let images = parallel::map(sets * cameras, |i| {
            let picture = engine.picture(&photons[i / cameras], scene, &plan, turn(i % cameras, cameras));
            picture.unwrap_or_else(|_| PassImage::black(scene))
        });
        let mean =
            |count: &dyn Fn(&PassImage) -> u64| images.iter().map(count).sum::<u64>() as f64 / images.len() as f64;
        let share = pixels / images[0].film.pixels.len() as f64;
        let camera = CAMERA_RAY * mean(&|i| i.camera.rays) + BLOCK_OF_SEGMENTS * mean(&|i| i.camera.blocks);
        let evaluations = EVALUATION * mean(&|i| i.camera.evaluations);
        let surfaces = PHOTON_RAY * mean(&|i| i.photon_rays) + PHOTON * mean(&|i| i.stats.surface_photons);
        let beams = BEAM * mean(&|i| i.stats.beams);
        let starts = plan
            .targets
            .as_ref()
            .map_or(0.0, |_| AIMED * f64::from(plan.surface_paths));
        let surfaces = surfaces + starts;
        let paths = f64::from(effort.paths);
        let films: Vec<Film> = images.into_iter().map(|image| image.film).collect();
        let variances = variances(&films, cameras);
        let blocks = blocks(&films, cameras);
        Self {
            samples: (films.len() * films[0].pixels.len()) as f64,
            blocks,
            size: [films[0].width, films[0].height],
            paths: sets as f64 * paths,
            work: [
                (camera + evaluations) * films.len() as f64,
                (surfaces + beams) * sets as f64,
            ],
            balance: Balance {
                variances: Variances {
                    photons: variances.photons * paths,
                    ..variances
                },
                camera_work: share * camera,
                photon_work: surfaces / f64::from(plan.surface_paths) + (beams + share * evaluations) / paths,
            },
        }
    }

    /// Whether chance decides how bright the image is, and so how noisy it seems.
    fn is_unsure(&self) -> bool {
        let whole = self.blocks[3 * BLOCKS * BLOCKS..].iter();
        let [mean, squared_error] = whole.fold([0.0; 2], |sum, of| [sum[0] + of[0], sum[1] + of[1]]);
        // Of the sum of three channels that go together.
        libm::sqrt(3.0 * squared_error) > UNSURE * mean
    }

    /// Whether the whole image lacks light that others found.
    fn is_dimmer_than(&self, found: &[f64]) -> bool {
        let whole = 3 * BLOCKS * BLOCKS;
        let here: f64 = self.blocks[whole..].iter().map(most).sum();
        here < DIMMER * found[whole..].iter().sum::<f64>()
    }

    /// Counted work of a pass of the image with so many photon paths, nanoseconds of a core.
    pub fn work_of_pass(&self, paths: u32) -> f64 {
        self.balance.camera_work + self.balance.photon_work * f64::from(paths)
    }

    /// What is known of the plan. `found`: what light there is at least, by block.
    ///
    /// Light that the pictures miss, as others found it, comes in drops that are rarer than one in all that was drawn
    /// for them: the square of what is missing, times that number, is the least that their variance can be.
    pub fn judged(&self, found: &[f64]) -> Judged {
        let of_block = |(block, found): (&[f64; 2], &f64)| {
            let missing = (MISSED * found - most(block)).max(0.0);
            missing * missing / (found * found + DARK)
        };
        let parts: Vec<f64> = self.blocks.iter().zip(found).map(of_block).collect();
        let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len().max(1) as f64;
        let (blocks, whole) = parts.split_at(3 * BLOCKS * BLOCKS);
        let (blocks, whole) = (mean(blocks), mean(whole));
        let mut balance = self.balance;
        let samples_of_block = self.samples / (BLOCKS * BLOCKS) as f64;
        // Whatever mends it at less cost.
        let by_photons = self.balance.photon_work > 0.0
            && self.paths * self.balance.photon_work < samples_of_block * self.balance.camera_work;
        match by_photons {
            true => balance.variances.photons += blocks.max(whole) * self.paths,
            false => balance.variances.camera += (blocks * samples_of_block).max(whole * self.samples),
        }
        let paths = balance.paths();
        let wants = match by_photons {
            true => More::Photons,
            false => More::CameraPaths,
        };
        let misses = balance.cost(paths) > DOUBTFUL * self.balance.cost(paths) || self.is_dimmer_than(found);
        Judged {
            wants: (misses || self.is_unsure()).then_some(wants),
            balance,
        }
    }
}

/// The most that a block may hold by what was found there: where that is noisy nothing is missing, it counts as noise.
fn most([mean, squared_error]: &[f64; 2]) -> f64 {
    mean + SURE * libm::sqrt(*squared_error)
}

/// Light that there is at least, of each block and channel: the most that the pictures of any plan are sure of.
pub(super) fn found<'a>(all: impl Iterator<Item = &'a Pictures>) -> Vec<f64> {
    let mut found = vec![0.0; 3 * (BLOCKS * BLOCKS + 1)];
    for pictures in all {
        for (found, [mean, squared_error]) in found.iter_mut().zip(&pictures.blocks) {
            *found = f64::max(*found, mean - SURE * libm::sqrt(*squared_error));
        }
    }
    found
}

/// Mean and square of its standard error, of each block and channel: that of sets of photons and that of camera paths,
/// of which all sets have the same. `films`: by photons, then by camera paths, so many for each set of photons.
fn blocks(films: &[Film], cameras: usize) -> Vec<[f64; 2]> {
    let sets = films.len() / cameras;
    let mut blocks = Vec::new();
    for pixels in each_block(films[0].width as usize, films[0].height as usize) {
        for channel in 0..3 {
            let of_film = |film: &Film| {
                let values = pixels.iter().map(|&pixel| f64::from(film.pixels[pixel][channel]));
                values.sum::<f64>() / pixels.len() as f64
            };
            let of_films: Vec<f64> = films.iter().map(of_film).collect();
            let of_set = |set: usize| of_films[set * cameras..(set + 1) * cameras].iter().sum::<f64>() / cameras as f64;
            let of_camera = |camera: usize| of_films.iter().skip(camera).step_by(cameras).sum::<f64>() / sets as f64;
            let [mean, photons] = moments(&(0..sets).map(of_set).collect::<Vec<_>>());
            let [_, camera] = moments(&(0..cameras).map(of_camera).collect::<Vec<_>>());
            blocks.push([mean, photons / sets as f64 + camera / cameras as f64]);
        }
    }
    blocks
}

/// Variances by camera paths and by one set of photons. `films`: by photons, then by camera paths, so many for each set
/// of photons.
///
/// Camera paths of several passes are drawn evenly, so that their means vary by less than each of them would tell. By
/// how much, the means of two independent halves say.
fn variances(films: &[Film], cameras: usize) -> Variances {
    let smooth = smoothed(films);
    let sets = films.len() / cameras;
    let of_pixel = |pixel: usize| {
        let mut sums = [0.0; 3];
        for (channel, smooth) in smooth[pixel].iter().enumerate() {
            let at =
                |photons: usize, camera: usize| f64::from(films[photons * cameras + camera].pixels[pixel][channel]);
            // For each camera, the variance over photons; then that over cameras of their means.
            let of_camera = |camera| moments(&(0..sets).map(|set| at(set, camera)).collect::<Vec<_>>());
            let of_cameras: Vec<[f64; 2]> = (0..cameras).map(of_camera).collect();
            let means: Vec<f64> = of_cameras.iter().map(|[mean, _]| *mean).collect();
            let [_, camera] = moments(&means);
            let photons = of_cameras.iter().map(|[_, variance]| variance).sum::<f64>() / cameras as f64;
            let weight = 1.0 / (smooth * smooth + DARK) / 3.0;
            let (one, other) = means.split_at(cameras / 2);
            let mean = |half: &[f64]| half.iter().sum::<f64>() / half.len().max(1) as f64;
            let apart = mean(one) - mean(other);
            sums[0] += weight * camera;
            sums[1] += weight * photons;
            sums[2] += weight * (0.5 * apart * apart * one.len() as f64);
        }
        sums
    };
    let pixels = films[0].pixels.len();
    let sums = (0..pixels).map(of_pixel);
    let [camera, photons, of_halves] = sums.fold([0.0; 3], |sum, of| std::array::from_fn(|i| sum[i] + of[i]));
    let evenness = match cameras / 2 > 1 && camera > 0.0 {
        true => (of_halves / camera).clamp(MOST_EVEN, 1.0),
        false => 1.0,
    };
    Variances {
        camera: evenness * camera / pixels as f64,
        photons: photons / pixels as f64,
    }
}

/// The pixels of each block, which share some where there are few, and at last those of the whole image.
fn each_block(width: usize, height: usize) -> impl Iterator<Item = Vec<usize>> {
    let span = |block: usize, side: usize| {
        let first = block * side / BLOCKS;
        first..((block + 1) * side / BLOCKS).max(first + 1)
    };
    let pixels = move |row: usize, column: usize| {
        let rows = span(row, height);
        rows.flat_map(|y| span(column, width).map(move |x| y * width + x))
            .collect()
    };
    let blocks = (0..BLOCKS).flat_map(move |row| (0..BLOCKS).map(move |column| pixels(row, column)));
    blocks.chain(std::iter::once((0..width * height).collect()))
}

/// The mean of all images around each pixel: by its own few samples alone bright ones would weigh themselves down.
fn smoothed(films: &[Film]) -> Vec<[f64; 3]> {
    let (width, height) = (films[0].width as usize, films[0].height as usize);
    let around = |i: usize, end: usize| i.saturating_sub(AROUND)..(i + AROUND + 1).min(end);
    let mean = |i: usize| {
        let mut sum = [0.0; 3];
        let mut samples = 0.0;
        for y in around(i / width, height) {
            for x in around(i % width, width) {
                for film in films {
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

/// Mean and variance; of one value none.
fn moments(values: &[f64]) -> [f64; 2] {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    [mean, squares / (n - 1.0).max(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Purpose, Sampler};

    /// Two by two of each: what photons add and what camera paths add are told apart. Halves of camera paths that have
    /// the same mean are as even as counts.
    #[test]
    fn variances_are_told_apart() {
        let film = |photons: usize, camera: f32| {
            let mut film = Film::new(2, 1);
            let p = [-1.0, 1.0][photons % 2];
            film.pixels.fill([2.0 + 0.1 * p + 0.03 * camera; 3]);
            film
        };
        for (cameras, evenness) in [([-1.0, -1.0, 1.0, 1.0], 1.0), ([-1.0, 1.0, -1.0, 1.0], MOST_EVEN)] {
            let films: Vec<Film> = (0..16).map(|i| film(i / 4, cameras[i % 4])).collect();
            let Variances { camera, photons } = variances(&films, 4);
            // Of +-1 in turns, the sample variance of four is 4/3.
            let weight = 4.0 / 3.0 / (4.0 + DARK);
            assert!((camera / (9e-4 * weight * evenness) - 1.0).abs() < 1e-3, "{camera}");
            assert!((photons / (1e-2 * weight) - 1.0).abs() < 1e-3, "{photons}");
        }
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
        let films: Vec<Film> = (0..4).map(film).collect();
        let Variances { camera, photons } = variances(&films, 4);
        assert!((camera / 7.0 - 1.0).abs() < 0.33, "{camera}");
        assert_eq!(photons, 0.0);
    }
}
