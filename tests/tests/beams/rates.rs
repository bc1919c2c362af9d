//! How fast the error falls in boxes where every wall has corners, creases and caustics. Blur at edges that does not go
//! away shows here long before it shows in a mean.

use beamfarm_harness::render::{reference_images, scene};
use beamfarm_image::film::Film;
use beamfarm_image::job::ReferenceSettings;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;

const SIDE: usize = 24;
/// Side in pixels of the tiles from which the exponent's error is estimated.
const TILE: usize = 8;
const PASSES: [u64; 2] = [16, 256];
/// Independent renders of the first number of passes.
const RENDERS: u64 = 4;
/// The mean square error must fall at least as fast as this power of the number of passes.
const EXPONENT: f64 = 0.6;
/// Standard errors: 1 % of right renderers with exactly this exponent would be called wrong.
const QUANTILE: f64 = 2.326;

/// A box open to the camera, with a round lamp in it. `things`: what else it contains.
fn open_box(things: &str) -> Scene {
    let wall = |material: &str, turn: &str| {
        format!("[[shapes]]\ntype = \"rectangle\"\nmaterial = \"{material}\"\ntransform = [{turn}]\n")
    };
    let turned = |axis: &str, angle: f64, to: &str| {
        format!("{{ rotate = {{ axis = {axis}, angle = {angle} }} }}, {{ translate = {to} }}")
    };
    let walls = [
        wall("grey", &turned("[1, 0, 0]", -90.0, "[0, 0, 0]")),
        wall("grey", &turned("[1, 0, 0]", 90.0, "[0, 2, 0]")),
        wall("grey", "{ translate = [0, 1, -1] }"),
        wall("red", &turned("[0, 1, 0]", 90.0, "[-1, 1, 0]")),
        wall("green", &turned("[0, 1, 0]", 90.0, "[1, 1, 0]")),
    ];
    scene(&format!(
        r#"
[image]
width = {SIDE}
height = {SIDE}
[render]
paths = 4000
[camera]
origin = [0.0, 1.0, 4.2]
target = [0.0, 1.0, 0.0]
fov = 32.0
[materials]
grey = {{ type = "diffuse", reflectance = 0.7, two_sided = true }}
red = {{ type = "diffuse", reflectance = [0.6, 0.1, 0.1], two_sided = true }}
green = {{ type = "diffuse", reflectance = [0.1, 0.5, 0.1], two_sided = true }}
black = {{ type = "diffuse", reflectance = 0.0 }}
glass = {{ type = "dielectric", ior = 1.5 }}
silver = {{ type = "rough_conductor", alpha = 0.1, preset = "Ag" }}
boundary = {{ type = "null" }}
[media.fog]
type = "homogeneous"
sigma_a = 0.1
sigma_s = 0.6
[[shapes]]
type = "sphere"
center = [0.3, 1.6, 0.2]
radius = 0.15
material = "black"
emission = {{ power = [20, 16, 10] }}
{}{things}"#,
        walls.concat()
    ))
}

/// Mean, and variance of the mean.
#[derive(Clone, Copy, Default)]
struct Truth {
    mean: f64,
    variance: f64,
}

/// By pixel and channel.
fn truth(scene: &Scene, images: u64, samples: u64) -> Vec<Truth> {
    let settings = ReferenceSettings {
        seed: 1,
        max_depth: None,
    };
    let mut sums = vec![[0.0; 2]; 3 * SIDE * SIDE];
    let mut n = 0.0;
    for film in reference_images(scene, settings, images, samples) {
        n += 1.0;
        for (sum, value) in sums.iter_mut().zip(film.pixels.iter().flatten()) {
            let value = f64::from(*value);
            *sum = [sum[0] + value, sum[1] + value * value];
        }
    }
    let of = |[sum, squares]: [f64; 2]| Truth {
        mean: sum / n,
        variance: (squares - sum * sum / n) / (n * (n - 1.0)),
    };
    sums.into_iter().map(of).collect()
}

fn average(scene: &Scene, seed: u64, passes: u64) -> Film {
    let mut settings = scene.description().defaults.job_settings();
    settings.seed = seed;
    let plan = RenderPlan::new(scene, settings);
    let mut mean = Film::new(SIDE as u32, SIDE as u32);
    for pass_index in 0..passes {
        let film = render_pass(scene, &plan, pass_index).expect("a pass").film;
        let sums = mean.pixels.iter_mut().flatten();
        for (sum, value) in sums.zip(film.pixels.iter().flatten()) {
            *sum += value / passes as f32;
        }
    }
    mean
}

/// Squared error by tile, less that of the truth.
fn errors(film: &Film, truth: &[Truth]) -> Vec<f64> {
    let floor = truth.iter().map(|t| t.mean).sum::<f64>() / truth.len() as f64;
    let columns = SIDE / TILE;
    let mut tiles = vec![0.0; columns * columns];
    for (index, (value, truth)) in film.pixels.iter().flatten().zip(truth).enumerate() {
        let (x, y) = (index / 3 % SIDE, index / 3 / SIDE);
        let off = f64::from(*value) - truth.mean;
        let scale = truth.mean * truth.mean + 0.01 * floor * floor;
        tiles[y / TILE * columns + x / TILE] += (off * off - truth.variance) / scale;
    }
    tiles
}

/// The exponent between the two numbers of passes, and its standard error from leaving out one tile after another
/// (Tukey 1958).
fn exponent([few, many]: [&[f64]; 2]) -> [f64; 2] {
    let ratio = PASSES[1] as f64 / PASSES[0] as f64;
    let of = |left_out: Option<usize>| {
        let sum = |tiles: &[f64]| -> f64 {
            let kept = tiles.iter().enumerate();
            kept.filter(|(i, _)| Some(*i) != left_out).map(|(_, v)| v).sum()
        };
        libm::log(sum(few) / sum(many)) / libm::log(ratio)
    };
    let n = few.len() as f64;
    let others: Vec<f64> = (0..few.len()).map(|i| of(Some(i))).collect();
    let mean = others.iter().sum::<f64>() / n;
    let squares: f64 = others.iter().map(|v| (v - mean) * (v - mean)).sum();
    [of(None), (squares * (n - 1.0) / n).sqrt()]
}

fn assert_falls(scene: &Scene, images: u64, samples: u64) {
    let truth = truth(scene, images, samples);
    let mut few = vec![0.0; (SIDE / TILE) * (SIDE / TILE)];
    for seed in 0..RENDERS {
        let tiles = errors(&average(scene, 10 + seed, PASSES[0]), &truth);
        for (sum, value) in few.iter_mut().zip(tiles) {
            *sum += value / RENDERS as f64;
        }
    }
    let many = errors(&average(scene, 1, PASSES[1]), &truth);
    let [exponent, error] = exponent([&few, &many]);
    let total = |tiles: &[f64]| tiles.iter().sum::<f64>() / truth.len() as f64;
    let text = format!(
        "relMSE {:.2e} of {} passes, {:.2e} of {}: N^-{exponent:.2} +- {error:.2}",
        total(&few),
        PASSES[0],
        total(&many),
        PASSES[1],
    );
    println!("{text}");
    assert!(exponent + QUANTILE * error >= EXPONENT, "{text}");
}

#[test]
fn of_fog_seen_from_outside() {
    let fog = r#"
[[shapes]]
type = "cube"
material = "boundary"
interior = "fog"
transform = [{ translate = [0, 1, 0] }]
[[shapes]]
type = "sphere"
center = [-0.3, 0.5, -0.1]
radius = 0.4
material = "glass"
exterior = "fog"
"#;
    assert_falls(&open_box(fog), 256, 12);
}

#[test]
fn of_surfaces_with_caustics() {
    let things = r#"
[[shapes]]
type = "sphere"
center = [-0.35, 0.4, -0.2]
radius = 0.4
material = "glass"
[[shapes]]
type = "cube"
material = "silver"
transform = [{ scale = [0.25, 0.5, 0.25] }, { rotate = { axis = [0, 1, 0], angle = 20 } }, { translate = [0.45, 0.5, -0.1] }]
"#;
    assert_falls(&open_box(things), 256, 24);
}
