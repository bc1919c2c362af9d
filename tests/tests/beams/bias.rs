//! The reported bias: passes whose bias is known tile by tile, and scenes whose radii are far too large.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use beamfarm_harness::MeanEstimate;
use beamfarm_harness::render::{is_long, reference_images, run_plan, scene};
use beamfarm_image::bias::{BIAS_EXPONENTS, Bias, Finding, TILE};
use beamfarm_image::film::Film;
use beamfarm_image::job::{JobSettings, ReferenceSettings, Technique, Techniques};
use beamfarm_image::merge::{Average, Node, TreeSum};
use beamfarm_image::radius::radius_scale;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

const TILES: usize = 32;

/// How the passes of a made job vary.
#[derive(Clone, Copy, Debug)]
struct Made {
    alpha: f64,
    passes: usize,
    /// p: the bias of a pass is b R^p.
    exponent: f64,
    /// Share of the first pass's variance that falls as 1 / R.
    kernel: f64,
    /// One pass in this many has all the noise.
    rarity: f64,
}

fn uniform(rng: &mut Pcg64Mcg) -> f64 {
    (rng.next_u64() >> 11) as f64 * (-53f64).exp2()
}

fn normal(rng: &mut Pcg64Mcg) -> f64 {
    let radius = (-2.0 * libm::log1p(-uniform(rng))).sqrt();
    radius * libm::cos(std::f64::consts::TAU * uniform(rng))
}

impl Made {
    fn scales(&self) -> Vec<f64> {
        let pass = |n: usize| radius_scale((n + 1) as f64, self.alpha);
        (0..self.passes).map(pass).collect()
    }

    /// Variance of a pass.
    fn variance(&self, scale: f64) -> f64 {
        1e-4 * (1.0 - self.kernel + self.kernel / scale)
    }

    /// The least standard error that an estimate of the average's bias can have when the exponent and the noise are
    /// known, and the standard error of the average.
    fn standard_errors(&self) -> (f64, f64) {
        let scales = self.scales();
        let n = scales.len() as f64;
        let powers: Vec<f64> = scales.iter().map(|r| libm::pow(*r, self.exponent)).collect();
        let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
            let passes = scales.iter().zip(&powers);
            passes.map(|(r, g)| f(1.0 / self.variance(*r), *g)).sum()
        };
        let mean = sum(&|w, g| w * g) / sum(&|w, _| w);
        let spread = sum(&|w, g| w * (g - mean) * (g - mean));
        let variance: f64 = scales.iter().map(|r| self.variance(*r)).sum();
        (powers.iter().sum::<f64>() / n / spread.sqrt(), variance.sqrt() / n)
    }

    /// A job whose tiles' averages have the given biases.
    fn job(&self, biases: &[f64], rng: &mut Pcg64Mcg) -> Bias {
        let scales = self.scales();
        let power = |scale: f64| libm::pow(scale, self.exponent);
        let mean_power = scales.iter().map(|r| power(*r)).sum::<f64>() / scales.len() as f64;
        let mut sum = TreeSum::new(32 * biases.len() as u32, 1);
        for (pass, scale) in scales.iter().enumerate() {
            let mut film = Film::new(32 * biases.len() as u32, 1);
            for (tile, bias) in film.pixels.chunks_mut(32).zip(biases) {
                let noise = match uniform(rng) * self.rarity < 1.0 {
                    true => normal(rng) * self.rarity.sqrt(),
                    false => 0.0,
                };
                let noise = noise * self.variance(*scale).sqrt();
                let value = 1.0 + noise + bias * power(*scale) / mean_power;
                tile.fill([value as f32; 3]);
            }
            let leaf = Node::leaf(pass as u64, film).with_radius_scale(*scale);
            sum.insert(leaf).unwrap();
        }
        sum.average().unwrap().bias.unwrap()
    }
}

/// How tiles of known bias were judged.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    /// Tiles biased by more than two standard errors, and how many of them are reported.
    biased: u32,
    found: u32,
    /// The same for tiles biased by less than three.
    faint: u32,
    faint_found: u32,
    /// By job: the share of reported tiles that are false, having no bias or one of the other sign.
    false_share: MeanEstimate,
    /// Reported tiles whose bias lies within two standard errors of the estimate.
    named: u32,
    covered: u32,
}

impl Tally {
    /// Adds a job whose tiles have these biases; `least` is two standard errors for each.
    fn add(&mut self, bias: &Bias, truth: &[f64], least: &[f64]) {
        let (mut named, mut wrong) = (0, 0);
        for ((tile, truth), least) in bias.tiles.iter().zip(truth).zip(least) {
            let is_named = tile.finding == Finding::Biased;
            let is_biased = truth.abs() > *least;
            let estimate = tile.mean();
            self.biased += u32::from(is_biased);
            self.found += u32::from(is_biased && is_named);
            let is_faint = is_biased && truth.abs() < 1.5 * least;
            self.faint += u32::from(is_faint);
            self.faint_found += u32::from(is_faint && is_named);
            named += u32::from(is_named);
            wrong += u32::from(is_named && estimate.bias * truth <= 0.0);
            let off = (estimate.bias - truth).abs();
            self.covered += u32::from(is_named && off <= 2.0 * estimate.standard_error);
        }
        self.named += named;
        self.false_share.add(f64::from(wrong) / f64::from(named.max(1)));
    }

    fn power(&self) -> f64 {
        f64::from(self.found) / f64::from(self.biased)
    }

    /// At least 80 % are reported, at most 5 % falsely, with an allowance of three standard errors.
    fn check(&self, name: &str) {
        let Self {
            biased,
            named,
            covered,
            false_share,
            ..
        } = self;
        let covered = f64::from(*covered) / f64::from(*named);
        println!(
            "{name}: {:.2} of {biased} named, {:.2} of the faint; falsely {:.3}; {covered:.2} of sizes within two standard errors",
            self.power(),
            f64::from(self.faint_found) / f64::from(self.faint),
            false_share.mean()
        );
        let slack = |share: f64, count: f64| 3.0 * (share * (1.0 - share) / count).sqrt();
        assert!(self.power() > 0.8 - slack(0.8, f64::from(*biased)), "{name}");
        let error = false_share.std_error();
        assert!(false_share.mean() < 0.05 + 3.0 * error, "{name}");
        assert!(covered > 0.85 - slack(0.85, f64::from(*named)), "{name}");
    }
}

/// Half of the tiles have a bias, of two to twenty times the best possible standard error: log-uniform sizes, both
/// signs.
#[test]
fn biased_tiles_are_named_and_hardly_any_other() {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut all = Tally::default();
    for alpha in [0.5, 2.0 / 3.0] {
        for exponent in BIAS_EXPONENTS {
            for (passes, kernel) in [(16, 0.0), (64, 0.0), (64, 1.0), (250, 1.0)] {
                let made = Made {
                    alpha,
                    passes,
                    exponent,
                    kernel,
                    rarity: 1.0,
                };
                let (standard_error, _) = made.standard_errors();
                let mut tally = Tally::default();
                for _ in 0..20 {
                    let sizes: [f64; TILES] = std::array::from_fn(|i| match i % 4 {
                        0 => 2.0 * libm::pow(10.0, uniform(&mut rng)),
                        1 => -2.0 * libm::pow(10.0, uniform(&mut rng)),
                        _ => 0.0,
                    });
                    let biases = sizes.map(|size| size * standard_error);
                    let bias = made.job(&biases, &mut rng);
                    for tally in [&mut tally, &mut all] {
                        tally.add(&bias, &biases, &[2.0 * standard_error; TILES]);
                    }
                }
                tally.check(&format!("{made:?}"));
            }
        }
    }
    // The allowance is negligible here.
    all.check("all");
    assert!(all.power() > 0.8 && all.false_share.mean() < 0.05);
}

/// Without any bias, at most one job in twenty reports a tile, even where all noise comes in one pass of twenty or
/// where all tiles have the same noise.
#[test]
fn noise_is_no_bias() {
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    for rarity in [1.0, 20.0] {
        for (passes, kernel) in [(64, 0.0), (64, 1.0), (200, 0.0)] {
            let made = Made {
                alpha: 2.0 / 3.0,
                passes,
                exponent: 1.0,
                kernel,
                rarity,
            };
            let jobs = 200;
            let wrong: MeanEstimate = (0..jobs)
                .map(|_| {
                    let bias = made.job(&[0.0; TILES], &mut rng);
                    f64::from(u8::from(!bias.named().is_empty()))
                })
                .collect();
            println!("{made:?}: {:.3} of jobs name a tile", wrong.mean());
            // Three standard errors of a share of 5 %.
            let slack = 3.0 * (0.05 * 0.95 / f64::from(jobs)).sqrt();
            assert!(wrong.mean() < 0.05 + slack, "{made:?}: {}", wrong.mean());
        }
    }
}

/// Light through a hole in a plate makes a shaft in fog, which beams this wide blur into the dark. The plate lets some
/// light through; otherwise it would end their kernels.
const SHAFT: &str = r#"
[image]
width = 96
height = 96
[render]
paths = 5000
alpha = 0.5
radius = RADIUS
targeting = "off"
[camera]
origin = [0.0, 0.0, 4.0]
target = [0.0, 0.0, 0.0]
fov = 40.0
[world]
medium = "fog"
[media.fog]
type = "homogeneous"
sigma_a = 0.1
sigma_s = 0.3
[materials.black]
type = "diffuse"
reflectance = 0.0
two_sided = true
[materials.plate]
type = "diffuse"
reflectance = 0.0
two_sided = true
opacity = 0.999
[[shapes]]
type = "cube"
material = "black"
transform = [{ scale = 5.0 }]
[[shapes]]
name = "left part of the plate"
type = "rectangle"
material = "plate"
transform = [{ rotate = { axis = [1, 0, 0], angle = 90 } }, { scale = [2.4, 1, 5.0] }, { translate = [-2.55, 1.8, 0] }]
[[shapes]]
name = "right part of the plate"
type = "rectangle"
material = "plate"
transform = [{ rotate = { axis = [1, 0, 0], angle = 90 } }, { scale = [2.4, 1, 5.0] }, { translate = [2.55, 1.8, 0] }]
[[shapes]]
type = "sphere"
center = [0.0, 2.6, 0.0]
radius = 0.15
emission = { power = 200 }
"#;

/// The caustic of a glass ball on a floor.
const CAUSTIC: &str = r#"
[image]
width = 96
height = 96
[render]
paths = 5000
alpha = 0.5
radius = RADIUS
targeting = "off"
[camera]
origin = [0.0, 3.0, 4.0]
target = [0.0, 0.0, 0.0]
fov = 40.0
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
name = "floor"
type = "rectangle"
transform = [{ scale = 2.0 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[shapes]]
type = "sphere"
center = [0.0, 0.8, 0.0]
radius = 0.6
material = "glass"
[[shapes]]
type = "sphere"
center = [0.6, 3.5, 0.0]
radius = 0.4
emission = { power = 100 }
"#;

/// The same on a ground of a thousand units, where hits are as uncertain as the narrowest kernels are wide. What
/// depended on the radius there was not blur, but was reported as bias of the wrong sign.
const LARGE_GROUND: &str = r#"
[image]
width = 96
height = 96
[render]
paths = 5000
alpha = 0.5
radius = RADIUS
targeting = "off"
[camera]
origin = [0.2, 1.6, 2.2]
target = [-0.35, 0.0, -0.1]
fov = 30.0
[materials.floor]
type = "diffuse"
reflectance = 0.5
two_sided = true
[materials.glass]
type = "dielectric"
ior = 1.57
[[shapes]]
type = "rectangle"
transform = [{ rotate = { axis = [1, 0, 0], angle = -90 } }, { scale = 1000.0 }]
material = "floor"
[[shapes]]
type = "sphere"
center = [-0.45, 0.56, -0.045]
radius = 0.186
material = "glass"
[[shapes]]
type = "rectangle"
transform = [{ scale = 0.08 }, { rotate = { axis = [1, 0, 0], angle = 90 } }, { translate = [0.0, 2.2, 0.2] }]
emission = { radiance = 55.0 }
[[lights]]
type = "environment"
radiance = 0.5
"#;

/// Mean of all channels over a tile.
fn tile_means(film: &Film) -> Vec<f64> {
    let (width, side) = (film.width as usize, TILE as usize);
    let mut sums = vec![0.0; (width / side) * (film.height as usize / side)];
    for (i, pixel) in film.pixels.iter().enumerate() {
        let (x, y) = (i % width / side, i / width / side);
        let sum: f64 = pixel.iter().map(|v| f64::from(*v)).sum();
        sums[y * (width / side) + x] += sum / (3 * side * side) as f64;
    }
    sums
}

/// Jobs of 64 passes of a scene with this base radius: eight, or the given number where tests must be short.
fn jobs(toml: &str, radius: f64, few: u64) -> (Scene, Vec<Average>) {
    let scene = scene(&toml.replace("RADIUS", &radius.to_string()));
    let settings = scene.description().defaults.job_settings();
    let job = |seed| {
        // Photons even where kernels are so wide that the plan would choose camera paths.
        let photons = Some(Technique::Photons);
        let techniques = match scene.description().media.is_empty() {
            true => settings.techniques,
            false => Techniques {
                media: photons,
                surfaces: photons,
                ..settings.techniques
            },
        };
        let mut plan = RenderPlan::new(
            &scene,
            JobSettings {
                seed,
                techniques,
                ..settings
            },
        );
        plan.surface_photons = true;
        run_plan(&scene, &plan, 64)
    };
    let jobs = (0..if is_long() { 8 } else { few }).map(job).collect();
    (scene, jobs)
}

fn print(name: &str, job: &Average) {
    let bias = job.bias.as_ref().unwrap();
    let tiles = bias.tiles_in_words();
    println!("{name}: {bias}; {}", tiles.unwrap_or_default());
}

/// Radii as wide as a tile, against the path tracer: how many tiles of all jobs are certainly biased and by two
/// standard errors of a job's estimate, and how many of them are reported.
fn told_of(name: &str, toml: &str, radius: f64) -> (u32, u32) {
    let (scene, jobs) = jobs(toml, radius, 3);
    let settings = ReferenceSettings {
        seed: 1,
        max_depth: None,
    };
    let mut reference = vec![MeanEstimate::new(); 9];
    for film in reference_images(&scene, settings, 16, 32) {
        for (estimate, mean) in reference.iter_mut().zip(tile_means(&film)) {
            estimate.add(mean);
        }
    }
    let means: Vec<Vec<f64>> = jobs.iter().map(|job| tile_means(&job.beauty)).collect();
    let (mut biased, mut found, mut wrong) = (0, 0, 0);
    for (i, reference) in reference.iter().enumerate() {
        let averages: MeanEstimate = means.iter().map(|means| means[i]).collect();
        let truth = averages.mean() - reference.mean();
        let error = averages.std_error().hypot(reference.std_error());
        println!(
            "{name}, tile {i}: bias {truth:+.5} ± {error:.5} of {:.5}",
            reference.mean()
        );
        for job in &jobs {
            let tile = &job.bias.as_ref().unwrap().tiles[i];
            let estimate = tile.mean();
            let is_named = tile.finding == Finding::Biased;
            let is_known = truth.abs() > 3.0 * error;
            if is_known && truth.abs() > 2.0 * estimate.fits[1].standard_error {
                biased += 1;
                found += u32::from(is_named);
            }
            wrong += u32::from(is_known && is_named && truth * estimate.bias < 0.0);
        }
    }
    jobs.iter().for_each(|job| print(name, job));
    println!("{name}: {found} of {biased} named, {wrong} with the wrong sign");
    assert!(biased >= 8, "{name}");
    assert_eq!(wrong, 0, "{name}");
    (biased, found)
}

/// Radii so small that there is nothing to report: at most one tile in twenty is.
fn is_silent(name: &str, toml: &str, radius: f64) {
    let (_, jobs) = jobs(toml, radius, 3);
    jobs.iter().for_each(|job| print(name, job));
    let named = jobs.iter().map(|job| job.bias.as_ref().unwrap().named().len());
    let named = named.sum::<usize>();
    println!("{name}: {named} named falsely of {}", 9 * jobs.len());
    assert!(20 * named <= 9 * jobs.len(), "{name}");
}

#[test]
fn radii_far_too_large_are_told_of() {
    let (biased, found) = told_of("shaft", SHAFT, 2.0);
    assert!(5 * found >= 4 * biased);
}

#[test]
fn small_radii_are_not() {
    is_silent("shaft", SHAFT, 0.02);
    is_silent("caustic", CAUSTIC, 0.02);
    if is_long() {
        is_silent("large ground", LARGE_GROUND, 0.03);
    }
}
