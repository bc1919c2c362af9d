//! The pilot's small pictures of a plan: how noisy they are, what they cost, and what light they miss.

use super::SIDES;
use crate::parallel;
use crate::plan::RenderPlan;
use crate::plan::aov::{LayerPlan, light_layers};
use crate::plan::budget::DARK;
use crate::plan::engine::{Engine, PassImage};
use crate::plan::frustum::Frustum;
use crate::world::Scene;
use crate::world::medium::Medium;
use beamfarm_image::film::Film;
use beamfarm_image::job::MAX_PASSES;
use beamfarm_image::layer::Layer;

/// Sets of photons per plan.
const SETS: usize = 4;
/// Radius scale of the pictures: about that of a hundred passes.
pub(super) const SCALE: f64 = 0.3;
/// Least factor on a variance for evenness. The passes of a job gain more from it than half a pilot's.
const MOST_EVEN: f64 = 0.2;
/// Least variance of camera paths, as a share of that of one set of photons: less cannot be told from none. Plans found
/// with it have 0.92 times the variance x time of those found when all variance between camera paths' means over sets
/// counted as theirs. This is a mean over eight scenes; `ocean` has 0.56, and a room behind a pane 0.64.
const LEAST_CAMERA: f64 = 0.02;
/// How many pixels on each side of one tell how bright it is, in the largest pictures.
const AROUND: usize = 2;
/// Blocks along each side, in which to look for light that other plans found.
const BLOCKS: usize = 8;
/// Index at which the values of the whole image follow those of the blocks, by channel.
const WHOLE: usize = 3 * BLOCKS * BLOCKS;
/// Light is missing where less than this share was found of what others are sure of: blocks of pictures of different
/// sizes differ a little.
const MISSED: f64 = 0.8;
/// It is also missing if the whole image is certainly darker than this share of another plan's.
const DIMMER: f64 = 0.95;
/// What a part of the light may lack on top of that, as a share of the whole image.
const LITTLE: f64 = 0.01;
/// Most groups of lights to look at one by one.
const GROUPS: usize = 16;
/// If the standard error of the image's mean, relative to the mean, is above this, nothing is sure.
const UNSURE: f64 = 0.3;
/// A plan is in doubt if missing light changes its cost by more than this factor.
const DOUBTFUL: f64 = 1.3;
/// Light counts as found above this many standard errors, from [`SETS`] pictures each: Student's t with three degrees
/// of freedom exceeds it once in seventy.
const SURE: f64 = 4.0;

/// Work of a camera ray, a block of segments, a photon's ray, a stored photon, a beam and an evaluation of a beam,
/// nanoseconds of a core: fitted to the scenes of this repository.
const CAMERA_RAY: f64 = 550.0;
const BLOCK_OF_SEGMENTS: f64 = 200.0;
const PHOTON_RAY: f64 = 800.0;
const PHOTON: f64 = 1200.0;
const BEAM: f64 = 7000.0;
const EVALUATION: f64 = 150.0;
/// Work of aiming a photon, and of each disc on its way, which counts for the density that it starts with.
const AIMED: f64 = 1500.0;
const DISC: f64 = 25.0;

/// Variances relative to the square of the image plus 0.01, as in relMSE.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variances {
    /// Variance from camera paths.
    pub camera: f64,
    /// Variance from photons, times the number of photon paths.
    pub photons: f64,
}

/// What the pilot found about a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balance {
    /// Means over the image.
    pub variances: Variances,
    /// Work of camera paths, nanoseconds of a core.
    pub camera_work: f64,
    /// Work of a photon path, nanoseconds of a core.
    pub photon_work: f64,
}

/// How much to render for a plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// Pictures with different camera paths for each set of photons, an even number. Without photons, twice as many in
    /// all.
    pub cameras: usize,
    /// Photon paths of a set.
    pub paths: u32,
}

/// Mean and square of its standard error of a whole image, by channel.
type Whole = [[f64; 2]; 3];

/// A plan's pictures.
pub(super) struct Pictures {
    noise: Noise,
    /// Photon paths in a set.
    paths_of_set: f64,
    /// Work of a pass's camera paths, and of one photon path, nanoseconds of a core.
    camera_work: f64,
    photon_work: f64,
    /// Mean and squared standard error, of each block and channel, then of the whole image.
    blocks: Vec<[f64; 2]>,
    /// The same of the whole image for each part of the light, by channel. What hardly counts in the whole may be all
    /// the light of a place, or come so seldom that only the noise of other parts shows.
    parts: Vec<Whole>,
    /// Samples of the image, and photon paths, that the means are taken over.
    samples: f64,
    paths: f64,
    /// Counted work of the camera, and of photons, nanoseconds of a core.
    pub work: [f64; 2],
}

/// What a plan's pictures are worth, given what others found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Judged {
    pub balance: Balance,
    /// What to draw more of for a better judgement, if missing light makes up most of what is known.
    pub wants: Option<More>,
    /// The whole image certainly lacks light that others found.
    pub lacks: bool,
}

/// What pictures may want more of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum More {
    Photons,
    CameraPaths,
}

impl Pictures {
    /// Render the pictures. Deterministic: they depend on scene and plan alone, and use pass indices that no job has.
    /// `pixels`: of the image that they are for.
    ///
    /// If the scene is interrupted meanwhile, they say nothing.
    pub fn new(engine: &impl Engine, scene: &Scene, plan: &RenderPlan, pixels: f64, effort: Effort) -> Self {
        let more = effort.paths / plan.settings.paths_per_pass.max(1);
        let mut plan = plan.clone();
        plan.settings.paths_per_pass = effort.paths;
        plan.surface_paths = plan.surface_paths.saturating_mul(more.max(1));
        plan.view = Frustum::of(scene);
        let parts = layers_of_parts(scene);
        plan.layers = LayerPlan::of(scene, &parts.concat());
        let last = |k: usize| MAX_PASSES - 1 - k as u64;
        // Two halves, each even by itself and independent of the other.
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
        let of_start = plan
            .targets
            .as_ref()
            .map_or(0.0, |targets| AIMED + DISC * f64::from(targets.work(plan.emitters())));
        let starts = of_start * f64::from(plan.surface_paths);
        let surfaces = surfaces + starts;
        let paths = f64::from(effort.paths);
        let parts = parts_of(&images, &parts, cameras);
        let films: Vec<Film> = images.into_iter().map(|image| image.film).collect();
        Self {
            parts,
            samples: (films.len() * films[0].pixels.len()) as f64,
            blocks: blocks(&films, cameras),
            noise: Noise::new(&films, cameras),
            paths: sets as f64 * paths,
            paths_of_set: paths,
            camera_work: share * camera,
            photon_work: surfaces / f64::from(plan.surface_paths) + (beams + share * evaluations) / paths,
            work: [
                (camera + evaluations) * films.len() as f64,
                (surfaces + beams) * sets as f64,
            ],
        }
    }

    /// Width and height.
    pub fn size(&self) -> [usize; 2] {
        self.noise.size
    }

    /// Whether chance decides how bright the image is, and so how noisy it seems.
    fn is_unsure(&self) -> bool {
        let whole = self.blocks[WHOLE..].iter();
        let [mean, squared_error] = whole.fold([0.0; 2], |sum, of| [sum[0] + of[0], sum[1] + of[1]]);
        // The standard error of the sum of three correlated channels.
        libm::sqrt(3.0 * squared_error) > UNSURE * mean
    }

    /// The values of the whole image, and those of each part.
    fn wholes(&self) -> impl Iterator<Item = Whole> {
        let beauty = std::array::from_fn(|channel| self.blocks[WHOLE + channel]);
        std::iter::once(beauty).chain(self.parts.iter().copied())
    }

    /// What the whole image certainly lacks, by channel, compared with the pictures that have most more: as a whole, or
    /// in the part that lacks most.
    fn missing(&self, found: &Found) -> [f64; 3] {
        let mut most = [0.0f64; 3];
        for (part, whole) in self.wholes().enumerate() {
            for (channel, [mean, squared_error]) in whole.into_iter().enumerate() {
                let may = match part {
                    0 => 0.0,
                    _ => LITTLE * found.blocks[WHOLE + channel],
                };
                let beside = |wholes: &Vec<Whole>| {
                    let [other, squared_error_of_other] = wholes[part][channel];
                    let squared_error = squared_error + DIMMER * DIMMER * squared_error_of_other;
                    DIMMER * other - mean - SURE * libm::sqrt(squared_error) - may
                };
                most[channel] = found.wholes.iter().map(beside).fold(most[channel], f64::max);
            }
        }
        most
    }

    /// Counted work of a pass of the image with this many photon paths, nanoseconds of a core.
    pub fn work_of_pass(&self, paths: u32) -> f64 {
        self.camera_work + self.photon_work * f64::from(paths)
    }

    /// Judges the plan. `found`: the light that there is at least, by block.
    ///
    /// Light that others found and these pictures miss comes in drops rarer than one in everything that was drawn for
    /// them. The square of what is missing, times that number, is the least that their variance can be.
    pub fn judged(&self, found: &Found) -> Judged {
        let variances = self.noise.variances(&found.seen_as(self.size()));
        let known = Balance {
            variances: Variances {
                photons: variances.photons * self.paths_of_set,
                ..variances
            },
            camera_work: self.camera_work,
            photon_work: self.photon_work,
        };
        let of_block = |(block, found): (&[f64; 2], &f64)| {
            let missing = (MISSED * found - most(block)).max(0.0);
            missing * missing / (found * found + DARK)
        };
        let blocks = self.blocks[..WHOLE].iter().zip(&found.blocks);
        let blocks = blocks.map(of_block).sum::<f64>() / WHOLE as f64;
        let of_whole = |(missing, found): (f64, &f64)| missing * missing / (found * found + DARK);
        let missing = self.missing(found);
        let whole = missing.into_iter().zip(&found.blocks[WHOLE..]);
        let whole = whole.map(of_whole).sum::<f64>() / 3.0;
        let mut balance = known;
        let samples_of_block = self.samples / (BLOCKS * BLOCKS) as f64;
        // Whichever fills the gap at less cost.
        let by_photons = self.photon_work > 0.0 && self.paths * self.photon_work < samples_of_block * self.camera_work;
        match by_photons {
            true => balance.variances.photons += blocks.max(whole) * self.paths,
            false => balance.variances.camera += (blocks * samples_of_block).max(whole * self.samples),
        }
        let paths = balance.paths();
        let wants = match by_photons {
            true => More::Photons,
            false => More::CameraPaths,
        };
        let lacks = missing.iter().any(|missing| *missing > 0.0);
        let misses = lacks || balance.cost(paths) > DOUBTFUL * known.cost(paths);
        Judged {
            wants: (misses || self.is_unsure()).then_some(wants),
            lacks,
            balance,
        }
    }
}

/// The most light that a block may hold, given what was found there: in a noisy block nothing is missing, because it
/// counts as noise.
fn most([mean, squared_error]: &[f64; 2]) -> f64 {
    mean + SURE * libm::sqrt(*squared_error)
}

/// Light that there is at least: the most that any plan's pictures are sure of.
pub(super) struct Found {
    /// By block and channel, then of the whole image.
    blocks: Vec<f64>,
    /// By plan: its pictures' values of the whole image and of each part of the light.
    wholes: Vec<Vec<Whole>>,
    /// By pixel of the largest pictures: the likely brightness.
    size: [usize; 2],
    pixels: Vec<[f64; 3]>,
}

impl Found {
    pub fn new<'a>(all: impl Iterator<Item = &'a Pictures> + Clone) -> Self {
        let mut blocks = vec![0.0; WHOLE + 3];
        for pictures in all.clone() {
            for (found, [mean, squared_error]) in blocks.iter_mut().zip(&pictures.blocks) {
                *found = f64::max(*found, mean - SURE * libm::sqrt(*squared_error));
            }
        }
        Self {
            blocks,
            wholes: all.clone().map(|pictures| pictures.wholes().collect()).collect(),
            ..Self::of_noise(all.map(|pictures| &pictures.noise))
        }
    }

    fn of_noise<'a>(all: impl Iterator<Item = &'a Noise> + Clone) -> Self {
        let sizes = all.clone().map(|noise| noise.size);
        let size = sizes.max_by_key(|[width, height]| width * height).unwrap_or_default();
        let mut pixels = vec![[0.0f64; 3]; size[0] * size[1]];
        let count = all.clone().count() as f64;
        for (i, found) in pixels.iter_mut().enumerate() {
            let mut mean = [0.0; 3];
            for noise in all.clone() {
                let [likely, least] = noise.around[pixel_of(i, size, noise.size)];
                *found = std::array::from_fn(|channel| found[channel].max(least[channel]));
                mean = std::array::from_fn(|channel| mean[channel] + likely[channel] / count);
            }
            // If all are noisy, each lower bound is far below what is there.
            *found = std::array::from_fn(|channel| found[channel].max(mean[channel]));
        }
        Self {
            blocks: Vec::new(),
            wholes: Vec::new(),
            size,
            pixels,
        }
    }

    /// Whether any light was found.
    pub fn any(&self) -> bool {
        self.blocks.iter().any(|light| *light > 0.0)
    }

    /// The same, by pixel of smaller pictures.
    fn seen_as(&self, size: [usize; 2]) -> Vec<[f64; 3]> {
        let mut sums = vec![([0.0; 3], 0.0f64); size[0] * size[1]];
        for (i, light) in self.pixels.iter().enumerate() {
            let (sum, count) = &mut sums[pixel_of(i, self.size, size)];
            *sum = std::array::from_fn(|channel| sum[channel] + light[channel]);
            *count += 1.0;
        }
        sums.iter()
            .map(|(sum, count)| sum.map(|sum| sum / count.max(1.0)))
            .collect()
    }
}

/// The pixel of pictures of another size in which the middle of this one lies.
fn pixel_of(pixel: usize, from: [usize; 2], to: [usize; 2]) -> usize {
    let along = |at: usize, axis: usize| (2 * at + 1) * to[axis] / (2 * from[axis]);
    along(pixel / from[0], 1) * to[0] + along(pixel % from[0], 0)
}

/// Mean and squared standard error of each block and channel. `films`: ordered by photons, then by camera paths,
/// `cameras` for each set of photons.
fn blocks(films: &[Film], cameras: usize) -> Vec<[f64; 2]> {
    let mut blocks = Vec::new();
    for pixels in each_block(films[0].width as usize, films[0].height as usize) {
        for channel in 0..3 {
            let of_film = |film: &Film| {
                let values = pixels.iter().map(|&pixel| f64::from(film.pixels[pixel][channel]));
                values.sum::<f64>() / pixels.len() as f64
            };
            blocks.push(mean_and_error(
                &films.iter().map(of_film).collect::<Vec<f64>>(),
                cameras,
            ));
        }
    }
    blocks
}

/// Mean and squared standard error of values that are ordered by photons, then by camera paths: the error from sets of
/// photons plus that from camera paths, which all sets share.
fn mean_and_error(values: &[f64], cameras: usize) -> [f64; 2] {
    let sets = values.len() / cameras;
    let of_set = |set: usize| values[set * cameras..(set + 1) * cameras].iter().sum::<f64>() / cameras as f64;
    let of_camera = |camera: usize| values.iter().skip(camera).step_by(cameras).sum::<f64>() / sets as f64;
    let [mean, photons] = moments(&(0..sets).map(of_set).collect::<Vec<_>>());
    let [_, camera] = moments(&(0..cameras).map(of_camera).collect::<Vec<_>>());
    [mean, photons / sets as f64 + camera / cameras as f64]
}

/// The parts of a scene's light, as lists of layers to add up: surfaces and media, and each group of lights. None if
/// there is only one part.
fn layers_of_parts(scene: &Scene) -> Vec<Vec<Layer>> {
    let description = scene.description();
    let mut parts = Vec::new();
    if description.media.iter().any(Medium::scatters) {
        parts.push(vec![Layer::Direct, Layer::Surface]);
        parts.push(vec![Layer::Volume]);
    }
    let groups = light_layers(description);
    if groups.len() > 1 {
        parts.extend(groups.into_iter().take(GROUPS).map(|group| vec![group]));
    }
    parts
}

/// The parts' means.
fn parts_of(images: &[PassImage], parts: &[Vec<Layer>], cameras: usize) -> Vec<Whole> {
    let mut first = 0;
    let mut wholes = Vec::new();
    for part in parts {
        let layers = first..first + part.len();
        first = layers.end;
        wholes.push(std::array::from_fn(|channel| {
            let of_image = |image: &PassImage| {
                // An interrupted picture has no layers.
                let layers = image.layers.iter().skip(layers.start).take(layers.len());
                let values = layers.flat_map(|layer| layer.pixels.iter().map(|pixel| f64::from(pixel[channel])));
                values.sum::<f64>() / image.film.pixels.len() as f64
            };
            mean_and_error(&images.iter().map(of_image).collect::<Vec<f64>>(), cameras)
        }));
    }
    wholes
}

/// How noisy and how bright pixels are.
struct Noise {
    size: [usize; 2],
    /// The result of [`told_apart`], by pixel and channel.
    pixels: Vec<[[f64; 3]; 4]>,
    /// The mean of all pictures around a pixel, and its likely lower bound: the mean minus its standard error.
    around: Vec<[[f64; 3]; 2]>,
}

impl Noise {
    /// `films`: ordered by photons, then by camera paths, `cameras` for each set of photons.
    fn new(films: &[Film], cameras: usize) -> Self {
        let of_pixel = |pixel: usize| {
            let of_channel = |channel: usize| {
                let values = films.iter().map(|film| f64::from(film.pixels[pixel][channel]));
                told_apart(&values.collect::<Vec<f64>>(), cameras)
            };
            let [r, g, b] = std::array::from_fn(of_channel);
            std::array::from_fn(|kind| [r[kind], g[kind], b[kind]])
        };
        Self {
            size: [films[0].width as usize, films[0].height as usize],
            pixels: (0..films[0].pixels.len()).map(of_pixel).collect(),
            around: around(films, cameras),
        }
    }

    /// Variances relative to the square of the image and a little more. `light`: how bright it is.
    ///
    /// Camera paths of several passes are drawn evenly, so their means vary less than each of them would suggest. The
    /// means of two independent halves tell by how much.
    fn variances(&self, light: &[[f64; 3]]) -> Variances {
        let mut sums = [0.0; 4];
        for (of_pixel, light) in self.pixels.iter().zip(light) {
            for (sum, of) in sums.iter_mut().zip(of_pixel) {
                let relative = |(variance, light): (&f64, &f64)| variance / (light * light + DARK) / 3.0;
                *sum += of.iter().zip(light).map(relative).sum::<f64>();
            }
        }
        let [camera, photons, of_halves, both] = sums;
        let evenness = match camera > 0.0 {
            true => (of_halves / camera).clamp(MOST_EVEN, 1.0),
            false => 1.0,
        };
        let pixels = self.pixels.len() as f64;
        Variances {
            camera: evenness * (camera - both).max(LEAST_CAMERA * photons) / pixels,
            photons: photons / pixels,
        }
    }
}

/// Splits the variance of values into four: of the camera paths' means over all sets; of one set of photons; of the
/// camera paths' means, from two halves; and the interaction of both, which the first and the third contain. `values`:
/// ordered by photons, then by camera paths, `cameras` for each set of photons.
///
/// The interaction behaves as the photons' variance does: it is a part of that, and shrinks in means over more sets. A
/// two-way analysis of variance finds it.
fn told_apart(values: &[f64], cameras: usize) -> [f64; 4] {
    let sets = values.len() / cameras;
    // For each camera, the variance over photons; then the variance of their means over cameras.
    let of_camera = |camera| moments(&(0..sets).map(|set| values[set * cameras + camera]).collect::<Vec<_>>());
    let of_cameras: Vec<[f64; 2]> = (0..cameras).map(of_camera).collect();
    let means: Vec<f64> = of_cameras.iter().map(|[mean, _]| *mean).collect();
    let [_, camera] = moments(&means);
    let photons = of_cameras.iter().map(|[_, variance]| variance).sum::<f64>() / cameras as f64;
    let of_set = |set: usize| values[set * cameras..(set + 1) * cameras].iter().sum::<f64>() / cameras as f64;
    let [_, of_sets] = moments(&(0..sets).map(of_set).collect::<Vec<_>>());
    let both = (photons - of_sets) * cameras as f64 / (cameras as f64 - 1.0).max(1.0) / sets as f64;
    if cameras < 4 {
        return [camera, photons, camera, both];
    }
    let (one, other) = means.split_at(cameras / 2);
    let mean = |half: &[f64]| half.iter().sum::<f64>() / half.len() as f64;
    let apart = mean(one) - mean(other);
    [camera, photons, 0.5 * apart * apart * one.len() as f64, both]
}

/// The pixels of each block, then those of the whole image. In small images, blocks share pixels.
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

/// By pixel and channel: the mean of all images around it, and that mean minus its standard error, so that drops of
/// light which brighten pixels by chance do not count.
fn around(films: &[Film], cameras: usize) -> Vec<[[f64; 3]; 2]> {
    let (width, height) = (films[0].width as usize, films[0].height as usize);
    let sets = films.len() / cameras;
    let reach = (AROUND * width.max(height)).div_ceil(SIDES[0] as usize);
    let near = |i: usize, end: usize| i.saturating_sub(reach)..(i + reach + 1).min(end);
    let of_pixel = |i: usize| {
        let pixels = |y: usize| near(i % width, width).map(move |x| y * width + x);
        let pixels: Vec<usize> = near(i / width, height).flat_map(pixels).collect();
        let [r, g, b] = std::array::from_fn(|channel| {
            let of_film = |film: &Film| {
                pixels
                    .iter()
                    .map(|&pixel| f64::from(film.pixels[pixel][channel]))
                    .sum::<f64>()
            };
            let values: Vec<f64> = films.iter().map(|film| of_film(film) / pixels.len() as f64).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let [camera, photons, ..] = told_apart(&values, cameras);
            let squared_error = camera / cameras as f64 + photons / sets as f64;
            [mean, (mean - libm::sqrt(squared_error)).max(0.0)]
        });
        std::array::from_fn(|kind| [r[kind], g[kind], b[kind]])
    };
    (0..width * height).map(of_pixel).collect()
}

/// Mean and variance. A single value has no variance.
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

    /// With two by two of each, the variances from photons and from camera paths are told apart. Halves of camera paths
    /// with equal means are as even as can count.
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
            let Variances { camera, photons } = Noise::new(&films, 4).variances(&[[2.0; 3]; 2]);
            // The sample variance of four values alternating between +-1 is 4/3.
            let weight = 4.0 / 3.0 / (4.0 + DARK);
            assert!((camera / (9e-4 * weight * evenness) - 1.0).abs() < 1e-3, "{camera}");
            assert!((photons / (1e-2 * weight) - 1.0).abs() < 1e-3, "{photons}");
        }
    }

    /// The interaction of photons and camera paths counts as the photons' variance, however few sets there are.
    #[test]
    fn what_both_draw_counts_for_photons() {
        let signs = [-1.0, 1.0, -1.0, 1.0];
        let normals = |sampler: &mut Sampler| (0..12).map(|_| sampler.next_1d()).sum::<f32>() - 6.0;
        let mut sums = [0.0; 2];
        let scenes = 400;
        for scene in 0..scenes {
            let mut sampler = Sampler::new(3, scene, Purpose::Test, 0);
            let of_cameras: [f32; 8] = std::array::from_fn(|_| 0.1 * normals(&mut sampler));
            let of_pass = |photons: f32, camera: f32, both: f32| {
                let mut film = Film::new(1, 1);
                film.pixels.fill([2.0 + photons + camera + both; 3]);
                film
            };
            let films = (0..32).map(|i| of_pass(0.05 * signs[i / 8], of_cameras[i % 8], 0.4 * normals(&mut sampler)));
            let [camera, photons, _, both] = Noise::new(&films.collect::<Vec<_>>(), 8).pixels[0];
            sums[0] += (camera[0] - both[0]) / scenes as f64;
            sums[1] += photons[0] / scenes as f64;
        }
        // Standard errors: (0.05 x sqrt(2 / 7) and 0.16 x sqrt(2 / 24)) / 20.
        assert!((sums[0] - 0.01).abs() < 5.0 * 0.0014, "{}", sums[0]);
        assert!(
            (sums[1] - 0.16 - 0.0025 * 4.0 / 3.0).abs() < 5.0 * 0.0024,
            "{}",
            sums[1]
        );
    }

    /// Light in drops of 8, one in 16, makes pixels of few samples look bright. It does not count as certain light, nor
    /// does it weight itself down. Compared with the same light without noise, its variance is that of drops.
    #[test]
    fn rare_light_is_noise() {
        let film = |camera: u64| {
            let mut sampler = Sampler::new(1, camera, Purpose::Test, 0);
            let mut film = Film::new(48, 48);
            let mut drop = || [if sampler.next_1d() < 0.0625 { 8.0 } else { 0.0 }; 3];
            film.pixels.iter_mut().for_each(|pixel| *pixel = drop());
            film
        };
        let rare: Vec<Film> = (0..4).map(film).collect();
        let mut even = Film::new(24, 24);
        even.pixels.fill([0.5; 3]);
        let [rare, even] = [rare, vec![even; 4]].map(|films| Noise::new(&films, 4));
        let found = Found::of_noise([&rare, &even].into_iter());
        let least = found.pixels.iter().map(|pixel| pixel[0]).sum::<f64>() / found.pixels.len() as f64;
        assert!((0.5..0.55).contains(&least), "{least}");
        // Over 4 x 48 x 48 drops the share varies by 4 %, and the light by that of the few pixels around each.
        let Variances { camera, photons } = rare.variances(&found.seen_as(rare.size));
        let expected = 0.0625 * (1.0 - 0.0625) * 64.0 / (0.25 + DARK);
        assert!((0.75..1.1).contains(&(camera / expected)), "{camera} {expected}");
        assert_eq!(photons, 0.0);
    }

    /// One of two groups of lights gives a twentieth of the light. Pictures with a tenth of that are nearly as bright
    /// as others, but the group reveals the missing light. A group that gives a thousandth does not matter.
    #[test]
    fn a_part_that_is_missing_is_told() {
        let pictures = |part: f32| {
            let mut film = Film::new(8, 8);
            film.pixels.fill([0.95 + part; 3]);
            let films = vec![film; 8];
            Pictures {
                noise: Noise::new(&films, 2),
                paths_of_set: 100.0,
                camera_work: 1.0,
                photon_work: 1.0,
                blocks: blocks(&films, 2),
                parts: vec![[[0.95, 1e-10]; 3], [[f64::from(part), 1e-10]; 3]],
                samples: 512.0,
                paths: 400.0,
                work: [1.0; 2],
            }
        };
        for (share, is_missed) in [(0.05, true), (0.001, false)] {
            let [all, few] = [share, 0.1 * share].map(pictures);
            let found = Found::new([&all, &few].into_iter());
            assert!(!all.judged(&found).lacks);
            assert_eq!(few.judged(&found).lacks, is_missed, "{share}");
        }
        // Without parts, it goes unnoticed.
        let [all, few] = [0.05, 0.005].map(|part| Pictures {
            parts: Vec::new(),
            ..pictures(part)
        });
        assert!(!few.judged(&Found::new([&all, &few].into_iter())).lacks);
    }

    /// Larger pictures are averaged over the pixels of smaller ones.
    #[test]
    fn light_is_seen_in_pictures_of_other_sizes() {
        let mut large = Film::new(4, 2);
        (0..8u8).for_each(|i| large.pixels[usize::from(i)] = [f32::from(i); 3]);
        let found = Found {
            blocks: Vec::new(),
            wholes: Vec::new(),
            size: [4, 2],
            pixels: large.pixels.iter().map(|pixel| pixel.map(f64::from)).collect(),
        };
        assert_eq!(found.seen_as([2, 1]), [[2.5; 3], [4.5; 3]]);
        assert_eq!(found.seen_as([4, 2]), found.pixels);
    }
}
