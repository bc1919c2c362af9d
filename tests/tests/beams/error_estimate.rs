//! The error that a render claims is the error that it has: over repeated runs of small scenes, squared error over
//! estimated squared error is 1.

use beamfarm_harness::Suite;
use beamfarm_harness::render::{images, run, scene};
use beamfarm_harness::z_test::two_sided;
use beamfarm_image::job::JobSettings;
use beamfarm_image::merge::Average;
use rayon::prelude::*;

const SIDE: usize = 16;
/// Side in pixels of the blocks whose mean radiance errors are relative to.
const BLOCK: usize = 8;
const RUNS: u64 = 64;

/// Image, camera, and a floor.
const HEAD: &str = r#"
[image]
width = 16
height = 16
[render]
paths = 400
[camera]
origin = [0.0, 1.0, 4.0]
target = [0.0, 0.6, 0.0]
fov = 35.0
[[shapes]]
type = "rectangle"
transform = [{ scale = 3.0 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
"#;

const FOG: &str = r#"
[world]
medium = "fog"
[media.fog]
type = "homogeneous"
sigma_a = 0.05
sigma_s = [0.3, 0.2, 0.1]
phase = { type = "hg", g = 0.5 }
[[shapes]]
type = "cube"
flip_normals = true
transform = [{ scale = 5.0 }]
[[shapes]]
type = "sphere"
center = [0.9, 1.4, -0.5]
radius = 0.2
emission = { power = 20 }
"#;

const SURFACES: &str = r#"
[materials.coat]
type = "rough_plastic"
alpha = 0.1
reflectance = [0.7, 0.3, 0.2]
[[shapes]]
type = "sphere"
center = [-0.5, 0.5, 0.0]
radius = 0.5
material = "coat"
[[shapes]]
type = "sphere"
center = [0.9, 1.4, -0.5]
radius = 0.2
emission = { power = 20 }
[[lights]]
type = "environment"
radiance = [0.2, 0.3, 0.5]
"#;

const CAUSTICS: &str = r#"
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "sphere"
center = [0.0, 0.7, 0.0]
radius = 0.5
material = "glass"
[[lights]]
type = "spot"
position = [1.0, 3.0, 0.0]
target = [0.0, 0.7, 0.0]
cutoff_angle = 15
power = 20.0
"#;

const CLOUD: &str = r#"
[media.smoke]
type = "heterogeneous"
sigma_a = [0.2, 0.4, 0.3]
sigma_s = [2.0, 1.5, 1.0]
[media.smoke.density]
min = [-1.2, 0, -1.2]
max = [1.2, 1.6, 1.2]
voxel = 0.1
blobs = [{ center = [0, 0.5, 0], radius = 0.5, density = 2 }]
noise = { size = 0.6, contrast = 3 }
[materials.boundary]
type = "null"
[[shapes]]
type = "cube"
material = "boundary"
interior = "smoke"
transform = [{ scale = [1.2, 0.8, 1.2] }, { translate = [0, 0.801, 0] }]
[[lights]]
type = "spot"
position = [-1.5, 2.5, 0.8]
target = [0.0, 0.3, 0.0]
intensity = 30.0
"#;

/// A ratio of two sums over runs; each run contributes one value to both.
struct Ratio {
    value: f64,
    /// By leaving out one run after another (Efron's jackknife), which accounts for pixels sharing a run's photons.
    standard_error: f64,
}

fn jackknife(count: usize, ratio: impl Fn(Option<usize>) -> f64) -> Ratio {
    let value = ratio(None);
    let n = count as f64;
    let left: Vec<f64> = (0..count).map(|i| ratio(Some(i))).collect();
    let mean = left.iter().sum::<f64>() / n;
    let squares: f64 = left.iter().map(|r| (r - mean) * (r - mean)).sum();
    Ratio {
        value,
        standard_error: (squares * (n - 1.0) / n).sqrt(),
    }
}

/// Squared error over estimated squared error, both relative to the radiance like the number that `render` prints.
fn ratios(runs: &[Average]) -> [Ratio; 2] {
    let values: Vec<Vec<f64>> = runs.iter().map(|r| flat(&r.beauty.pixels)).collect();
    let errors: Vec<Vec<f64>> = runs.iter().map(|r| flat(&r.standard_error.pixels)).collect();
    let printed: Vec<f64> = runs.iter().map(Average::relative_standard_error).collect();
    let count = values[0].len();
    let picture: f64 = values.iter().flatten().sum::<f64>() / (count * runs.len()) as f64;
    // Mean radiance of the blocks' channels, used as a weight: the same for all subsets of runs.
    let pixel = |i: usize| (i / 3 % SIDE, i / 3 / SIDE);
    let radiance: Vec<f64> = (0..count)
        .map(|i| {
            let (x, y) = pixel(i);
            let (x0, y0) = (x / BLOCK * BLOCK, y / BLOCK * BLOCK);
            let block = (0..BLOCK * BLOCK).map(|b| (y0 + b / BLOCK) * SIDE + x0 + b % BLOCK);
            let of_run = |run: &Vec<f64>| block.clone().map(|b| run[3 * b + i % 3]).sum::<f64>();
            let sum: f64 = values.iter().map(of_run).sum();
            sum / (BLOCK * BLOCK * runs.len()) as f64
        })
        .collect();
    let ratio = |without: Option<usize>, as_printed: bool| {
        let used = || (0..runs.len()).filter(move |k| Some(*k) != without);
        let n = used().count() as f64;
        let (mut actual, mut estimated) = (0.0, 0.0);
        for i in 0..count {
            let mean = used().map(|k| values[k][i]).sum::<f64>() / n;
            let weight = 1.0 / radiance[i].max(0.1 * picture);
            let square = |x: f64| x * x * weight * weight;
            actual += used().map(|k| square(values[k][i] - mean)).sum::<f64>() / (n - 1.0);
            estimated += used().map(|k| square(errors[k][i])).sum::<f64>() / n;
        }
        if as_printed {
            estimated = used().map(|k| printed[k] * printed[k]).sum::<f64>() / n * count as f64;
        }
        actual / estimated
    };
    [false, true].map(|as_printed| jackknife(runs.len(), |without| ratio(without, as_printed)))
}

fn flat(pixels: &[[f32; 3]]) -> Vec<f64> {
    pixels.iter().flatten().map(|v| f64::from(*v)).collect()
}

fn runs(objects: &str, passes: u64) -> Vec<Average> {
    let scene = scene(&format!("{HEAD}{objects}"));
    let defaults = scene.description().defaults;
    let of_seed = |seed| {
        let settings = JobSettings {
            seed,
            ..defaults.job_settings()
        };
        run(&scene, settings, passes)
    };
    (0..images(RUNS)).into_par_iter().map(of_seed).collect()
}

/// With fewer than two replications the estimate may be too large, and so it may beyond the last two of them.
#[test]
fn errors_of_few_passes_are_not_underestimated() {
    for passes in [6, 9, 16, 24, 47] {
        let runs = runs(SURFACES, passes);
        assert_eq!(runs[0].has_upper_error(), passes < 32);
        for ratio in ratios(&runs) {
            println!("{passes} passes: {:.3} +- {:.3}", ratio.value, ratio.standard_error);
            // Significance 1e-4 for all ten.
            assert!(ratio.value < 1.0 + 4.3 * ratio.standard_error, "{passes} passes");
        }
    }
}

#[test]
fn squared_errors_are_what_was_estimated() {
    // Significance 1e-3 for the whole suite.
    let mut suite = Suite::new(1e-3);
    for (name, objects, passes) in [
        ("fog", FOG, 32),
        ("surfaces", SURFACES, 64),
        ("caustics", CAUSTICS, 64),
        ("cloud", CLOUD, 32),
    ] {
        let runs = runs(objects, passes);
        assert_eq!(runs[0].beauty.pixels.len(), SIDE * SIDE);
        for (ratio, what) in ratios(&runs).iter().zip(["by pixel", "as printed"]) {
            println!("{name} {what}: {:.3} +- {:.3}", ratio.value, ratio.standard_error);
            let z = (ratio.value - 1.0) / ratio.standard_error;
            suite.p_value(
                format!("{name} {what}: {} +- {}", ratio.value, ratio.standard_error),
                two_sided(z),
            );
        }
    }
    suite.finish();
}
