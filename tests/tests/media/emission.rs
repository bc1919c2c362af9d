//! Media that emit: against integrals, in furnaces, and with every technique against the path tracer.

use beamfarm_harness::furnace::{closed_box, is_one};
use beamfarm_harness::render::{Blocks, average, blocks_of, blur, images, is_long, scene, truth};
use beamfarm_harness::{MeanEstimate, Suite};
use beamfarm_image::job::{JobSettings, Technique, Techniques};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::Scene;
use beamfarm_render::world::light::EmissionUniforms;
use std::f64::consts::PI;

/// Rays along -z, all alike.
const ALONG: &str = r#"
[image]
width = 4
height = 4
[render]
passes = PASSES
paths = 100
[camera]
projection = "orthographic"
origin = [0.0, 0.0, 5.0]
target = [0.0, 0.0, 0.0]
view_width = 0.02
[materials.null]
type = "null"
"#;

fn along(rest: &str, passes: u64) -> [f64; 3] {
    let scene = scene(&format!("{}{rest}", ALONG.replace("PASSES", &passes.to_string())));
    let film = average(&scene).beauty;
    let count = film.pixels.len() as f64;
    std::array::from_fn(|c| film.pixels.iter().map(|pixel| f64::from(pixel[c])).sum::<f64>() / count)
}

fn is_near(found: [f64; 3], expected: [f64; 3], tolerance: f64) {
    for c in 0..3 {
        let off = (found[c] - expected[c]).abs();
        assert!(off <= tolerance * expected[c], "{found:?}, expected {expected:?}");
    }
}

/// What a slab adds to the light behind it, and a ball along its diameter: e (1 - exp(-a d)) / a.
#[test]
fn slabs_and_balls_emit_along_the_ray() {
    for (sigma_a, shape, depth) in [
        ([0.0; 3], "type = \"cube\"", 2.0),
        ([0.0, 0.3, 2.0], "type = \"cube\"", 2.0),
        (
            [0.1, 0.0, 9.0],
            "type = \"sphere\"\ncenter = [0.0, 0.0, 0.0]\nradius = 0.5",
            1.0,
        ),
    ] {
        let text = format!(
            "[media.glow]\ntype = \"homogeneous\"\nsigma_a = {sigma_a:?}\nsigma_s = 0.0\nemission = [1.0, 0.5, 3.0]\n\
             [[shapes]]\n{shape}\nmaterial = \"null\"\ninterior = \"glow\"\n\
             [[lights]]\ntype = \"environment\"\nradiance = 0.25\n"
        );
        let expected = std::array::from_fn(|c| {
            let (a, emitted): (f64, f64) = (sigma_a[c], [1.0, 0.5, 3.0][c]);
            let behind = 0.25 * libm::exp(-a * depth);
            behind
                + if a > 0.0 {
                    emitted * (1.0 - libm::exp(-a * depth)) / a
                } else {
                    emitted * depth
                }
        });
        is_near(along(&text, 1), expected, 2e-4);
    }
}

/// A Gaussian on a grid, whose integral along the ray is known by quadrature: in vacuum, in an even absorber, and seen
/// from its middle.
#[test]
fn grids_emit_along_the_ray() {
    let blob = |x: f64| libm::exp(-x * x / (2.0 * 0.09));
    let medium = |sigma_a: f64| {
        format!(
            "[media.glow]\ntype = \"homogeneous\"\nsigma_a = {sigma_a:?}\nsigma_s = 0.0\n[media.glow.emission]\n\
             color = [1.0, 0.5, 0.0]\nscale = 2.0\nfield = {{ min = [-1.5, -1.5, -1.5], max = [1.5, 1.5, 1.5], \
             voxel = 0.03, blobs = [{{ center = [0, 0, 0], radius = 0.3 }}] }}\n"
        )
    };
    let cube = "[[shapes]]\ntype = \"cube\"\ntransform = [{ scale = 1.5 }]\nmaterial = \"null\"\ninterior = \"glow\"\n";
    for sigma_a in [0.0, 1.5] {
        let text = format!("{}{cube}", medium(sigma_a));
        let n = 20_000;
        let step = 3.0 / f64::from(n);
        let sum: f64 = (0..n)
            .map(|i| {
                let z = -1.5 + (f64::from(i) + 0.5) * step;
                blob(z) * libm::exp(-sigma_a * (1.5 - z)) * step
            })
            .sum();
        is_near(along(&text, 200), [2.0 * sum, sum, 0.0], 8e-3);
        let inside = text.clone();
        let half: f64 = (0..n)
            .map(|i| {
                let z = -1.5 + (f64::from(i) + 0.5) * step * 0.5;
                blob(z) * libm::exp(sigma_a * z) * step * 0.5
            })
            .sum();
        let scene = ALONG
            .replace("[0.0, 0.0, 5.0]", "[0.0, 0.0, 0.0]")
            .replace("target = [0.0, 0.0, 0.0]", "target = [0.0, 0.0, -1.0]");
        let text = format!("{}{inside}", scene.replace("PASSES", "200"));
        let film = average(&beamfarm_harness::render::scene(&text)).beauty;
        let mean = film.pixels.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / film.pixels.len() as f64;
        is_near([mean; 3], [2.0 * half; 3], 8e-3);
    }
}

/// Where walls emit B and every absorber emits its absorption times B, every ray sees B.
#[test]
fn a_furnace_whose_medium_emits_what_it_absorbs() {
    const EVEN: &str = r#"
[media.hot]
type = "homogeneous"
sigma_a = [0.2, 0.5, 1.0]
sigma_s = SIGMA_S
emission = [0.2, 0.5, 1.0]
"#;
    const VARYING: &str = r#"
[media.hot]
type = "heterogeneous"
sigma_a = [0.2, 0.5, 1.0]
sigma_s = SIGMA_S
density = { min = [-1, -1, -1], max = [1, 1, 1], voxel = 0.1, noise = { size = 0.8, contrast = 2.0 } }
emission = { color = [0.2, 0.5, 1.0], field = "density" }
"#;
    const FILLED: &str = r#"
[materials.null]
type = "null"
[[shapes]]
type = "cube"
material = "null"
interior = "hot"
transform = [{ scale = 0.95 }]
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "sphere"
center = [-0.3, -0.2, 0.0]
radius = 0.3
material = "glass"
exterior = "hot"
"#;
    let mut suite = Suite::new(1e-3);
    let cases = [
        ("even", EVEN, "[0.5, 0.3, 0.8]"),
        ("grid", VARYING, "[0.5, 0.3, 0.8]"),
        ("grid absorbs alone", VARYING, "0.0"),
        ("absorbs alone", EVEN, "0.0"),
        ("dense grid", VARYING, "[8.0, 5.0, 9.0]"),
    ];
    let count = if is_long() { cases.len() } else { 3 };
    for (name, medium, sigma_s) in cases.into_iter().take(count) {
        let text = closed_box(0.5, &format!("{}{FILLED}", medium.replace("SIGMA_S", sigma_s)));
        let text = text.replace("width = 32\nheight = 32", "width = 8\nheight = 8");
        let text = text.replace("paths = 20000", "paths = 2000");
        let error = is_one(&mut suite, name, &text, &[], images(120));
        assert!(error < 0.01 * blur(), "{name}: {error}");
    }
    suite.finish();
}

/// A ball lights a floor below it in vacuum like a point, since each of its points emits to all sides.
#[test]
fn a_ball_lights_a_floor_like_a_point() {
    let (radius, height, emitted) = (0.4, 1.0, 2.0);
    for distance in [0.0, 1.0] {
        let text = format!(
            "{}[media.glow]\ntype = \"homogeneous\"\nemission = {emitted:?}\n\
             [materials.floor]\ntype = \"diffuse\"\nreflectance = 0.5\n\
             [[shapes]]\ntype = \"sphere\"\ncenter = [0.0, {height:?}, 0.0]\nradius = {radius:?}\nmaterial = \"null\"\n\
             interior = \"glow\"\n\
             [[shapes]]\ntype = \"rectangle\"\nmaterial = \"floor\"\n\
             transform = [{{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}, {{ scale = 5 }}]\n",
            ALONG
                .replace("PASSES", "600")
                .replace(
                    "origin = [0.0, 0.0, 5.0]",
                    &format!("origin = [{distance:?}, 0.4, 0.1]")
                )
                .replace(
                    "target = [0.0, 0.0, 0.0]",
                    &format!("target = [{distance:?}, 0.0, 0.0]")
                )
        );
        let scene = scene(&text);
        let power = scene.description().lights[0].power(&scene.description().objects, &scene.description().bounds);
        let volume = 4.0 / 3.0 * PI * libm::pow(radius, 3.0);
        assert!(
            (f64::from(power.x) / (4.0 * PI * volume * emitted) - 1.0).abs() < 1e-5,
            "{power}"
        );
        let squared = distance * distance + height * height;
        let irradiance = emitted * volume / squared * (height / squared.sqrt());
        let film = average(&scene).beauty;
        let mean = film.pixels.iter().map(|pixel| f64::from(pixel[1])).sum::<f64>() / film.pixels.len() as f64;
        is_near([mean; 3], [0.5 / PI * irradiance; 3], 8e-3);
    }
}

/// Photons carry the light's power in the mean, wherever they start, and they start where the light is.
#[test]
fn photons_carry_what_is_emitted() {
    let text = format!(
        "{}[media.glow]\ntype = \"homogeneous\"\n[media.glow.emission]\ncolor = [1.0, 2.0, 0.0]\nfield = {{ \
         min = [-1, -1, -1], max = [1, 1, 1], voxel = 0.05, blobs = [{{ center = [0.2, 0.1, 0.0], radius = 0.15 }}] }}\n\
         [[shapes]]\ntype = \"cube\"\nmaterial = \"null\"\ninterior = \"glow\"\n",
        ALONG.replace("PASSES", "1")
    );
    let scene = scene(&text);
    let description = scene.description();
    let light = &description.lights[0];
    let expected = 4.0 * PI * libm::pow(2.0 * PI, 1.5) * libm::pow(0.15, 3.0);
    let power = light.power(&description.objects, &description.bounds);
    assert!(
        (f64::from(power.x) / expected - 1.0).abs() < 0.01,
        "{power}, {expected}"
    );
    assert!((power.y / power.x - 2.0).abs() < 1e-4 && power.z < 1e-30);
    let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
    let mut mean = MeanEstimate::new();
    for _ in 0..40_000 {
        let start = light.sample_emission(
            &description.objects,
            &description.bounds,
            EmissionUniforms::draw(&mut sampler),
        );
        mean.add(f64::from(start.power.x));
        assert!(start.power.x < 4.0 * power.x, "{start:?}");
    }
    let mut suite = Suite::new(1e-3);
    // The grid's Gaussian is linear between samples, and so a little wider.
    suite.mean_within("power", &mean, expected, 0.01);
    suite.finish();
}

const PHOTONS: Option<Technique> = Some(Technique::Photons);
const PATHS: Option<Technique> = Some(Technique::Paths);

const ROOM: &str = r#"
[image]
width = 16
height = 16
[render]
paths = 3000
radius = 0.03
[camera]
origin = [0.0, 0.0, 0.9]
target = [0.0, 0.0, 0.0]
fov = 80.0
[materials.null]
type = "null"
[materials.wall]
type = "diffuse"
reflectance = [0.7, 0.6, 0.5]
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.frosted]
type = "rough_dielectric"
alpha = 0.05
ior = 1.5
[materials.steel]
type = "rough_conductor"
alpha = 0.05
preset = "chromium"
[[shapes]]
type = "cube"
flip_normals = true
material = "wall"
[[shapes]]
type = "sphere"
center = [-0.45, -0.6, -0.3]
radius = 0.38
BALL
[[shapes]]
type = "sphere"
center = [0.5, -0.65, -0.2]
radius = 0.33
material = "steel"
[[shapes]]
type = "cube"
transform = [{ scale = [0.25, 0.35, 0.25] }, { translate = [0.1, 0.4, -0.1] }]
material = "null"
interior = "fire"
"#;
const FLAME: &str = r#"
[media.fire]
type = "heterogeneous"
sigma_a = [0.5, 1.0, 2.0]
sigma_s = [1.0, 0.5, 2.0]
density = { min = [-0.2, 0.0, -0.4], max = [0.4, 0.8, 0.2], voxel = 0.02, blobs = [{ center = [0.1, 0.4, -0.1], radius = 0.12 }] }
emission = { color = [9.0, 5.0, 2.0], field = "density" }
"#;
const VAPOUR: &str = r#"
[media.fire]
type = "homogeneous"
sigma_a = 0.0
sigma_s = [0.5, 0.3, 0.2]
phase = { type = "hg", g = 0.6 }
emission = [9.0, 5.0, 2.0]
"#;
const FOG: &str = r#"
[world]
medium = "fog"
[media.fog]
type = "homogeneous"
sigma_a = [0.1, 0.2, 0.3]
sigma_s = [0.9, 0.7, 0.5]
phase = { type = "hg", g = 0.4 }
"#;

fn by(scene: &Scene, [media, surfaces, caustics]: [Option<Technique>; 3]) -> Blocks {
    let settings = JobSettings {
        techniques: Techniques {
            media,
            surfaces,
            caustics,
            aimed: None,
        },
        ..scene.description().defaults.job_settings()
    };
    blocks_of(scene, &RenderPlan::new(scene, settings), 8)
}

/// Every way to share the light among photons, beams and camera paths finds what the path tracer finds, which samples
/// no light: the flame seen directly, in steel and through glass; what it lights, also through glass; and all of it in
/// fog. Significance 1e-2 for all together.
#[test]
fn every_technique_finds_the_light_of_a_flame() {
    let mut suite = Suite::new(1e-2);
    let all = [
        [PHOTONS, PHOTONS, PHOTONS],
        [PATHS, PATHS, PHOTONS],
        [PHOTONS, PATHS, PHOTONS],
        [PATHS, PHOTONS, PHOTONS],
    ];
    let rooms = [
        ("flame, fog, glass", FLAME, FOG, "glass"),
        ("vapour, frosted glass", VAPOUR, "", "frosted"),
        ("flame, glass", FLAME, "", "glass"),
        ("vapour, fog", VAPOUR, FOG, "wall"),
    ];
    let (passes, count, samples) = if is_long() { (200, 4, 32) } else { (40, 2, 8) };
    for (name, medium, world, ball) in rooms.into_iter().take(count) {
        let text = ROOM.replace("BALL", &format!("material = \"{ball}\""));
        let text = text.replace("paths = 3000", &format!("paths = 1500\npasses = {passes}"));
        let scene = scene(&format!("{text}{medium}{world}"));
        let reference = truth(&scene, passes, samples, 8);
        for techniques in all.into_iter().take(count) {
            let found = by(&scene, techniques);
            let name = format!("{name}, {techniques:?}");
            suite.same_blocks(&name, &found, &reference, 1e-2);
            assert!(
                found.noise(&reference) < 0.03 * blur(),
                "{name}: {}",
                found.noise(&reference)
            );
        }
    }
    suite.finish();
}
