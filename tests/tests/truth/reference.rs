//! The reference integrator against closed forms, quadrature, the beams, and Mitsuba.
//!
//! It has no bias, so no allowance is made for one: z-tests of means over blocks of pixels of independent images, at
//! the significance that each test states. (`grid_media.rs` compares it with an older path tracer, in smoke given on
//! grids.)

use beamfarm_harness::furnace::{
    COATS_VEILS_AND_PANES, GLASS_BALL, MIRROR_BALL, WHITE_AND_GLASS, closed_box, under_the_sky,
};
use beamfarm_harness::point_in_fog::PointInFog;
use beamfarm_harness::render::{Blocks, plan_of, reference_images, scene, scene_with, with_threads};
use beamfarm_harness::{Suite, mitsuba};
use beamfarm_image::exr::pixel_hash;
use beamfarm_image::job::ReferenceSettings;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::cpu::reference::render_sample;
use beamfarm_render::world::Scene;
use glam::{DVec2, DVec3};

const BLOCK: usize = 8;
/// Single precision along a path: the share of a value that may differ on top of the noise.
const ROUNDING: f64 = 1e-5;
const UNBOUNDED: ReferenceSettings = ReferenceSettings {
    seed: 1,
    max_depth: None,
};

fn bounded(max_depth: u32) -> ReferenceSettings {
    ReferenceSettings {
        max_depth: Some(max_depth),
        ..UNBOUNDED
    }
}

/// 32 independent images of `samples` samples.
fn images(scene: &Scene, settings: ReferenceSettings, samples: u64) -> Blocks {
    Blocks::new(reference_images(scene, settings, 32, samples), BLOCK)
}

/// Every block has this radiance, and so has the whole image. Significance 1e-3.
fn is_everywhere(got: &Blocks, expected: [f64; 3]) {
    let mut suite = Suite::new(1e-3);
    for (i, block) in got.blocks.iter().chain([&got.whole]).enumerate() {
        for c in 0..3 {
            let name = format!("block {i}, channel {c}");
            suite.mean_within(name, &block[c], expected[c], ROUNDING);
        }
    }
    suite.finish();
}

fn is_one(toml: &str) {
    is_everywhere(&images(&scene(toml), UNBOUNDED, 4), [1.0; 3]);
}

const FOG: &str = r#"
[world]
medium = "fog"
[media.fog]
type = "homogeneous"
sigma_a = 0.0
sigma_s = [0.5, 4.0, 0.0]
phase = { type = "blend", weight = 0.3, phases = [{ type = "hg", g = -0.5 }, { type = "hg", g = 0.8 }] }
"#;

#[test]
fn closed_boxes_of_surfaces_are_furnaces() {
    is_one(&closed_box(0.6, ""));
    is_one(&closed_box(0.5, &format!("{GLASS_BALL}{MIRROR_BALL}")));
    is_one(&closed_box(0.5, COATS_VEILS_AND_PANES));
}

#[test]
fn closed_boxes_of_media_are_furnaces() {
    is_one(&closed_box(0.5, FOG));
    is_one(&closed_box(0.5, &format!("{GLASS_BALL}{MIRROR_BALL}{FOG}")));
}

/// A furnace with bounded paths is a geometric series.
#[test]
fn the_bound_counts_scatterings() {
    let scene = scene(&closed_box(0.6, ""));
    for depth in [0, 1, 2, 7] {
        let expected = 1.0 - libm::pow(0.6f32.into(), f64::from(depth + 1));
        // In single precision the walls emit 1 - 0.6.
        is_everywhere(&images(&scene, bounded(depth), 4), [expected; 3]);
    }
}

#[test]
fn surfaces_under_the_sky_are_furnaces() {
    is_one(&under_the_sky(WHITE_AND_GLASS));
}

/// Media within media, within glass, and behind cut-outs, with constant and varying densities: nothing absorbs.
#[test]
fn media_under_the_sky_are_furnaces() {
    for estimator in [
        "\"ratio_tracking\"",
        "\"residual_ratio_tracking\"",
        "{ free_flights = 4 }",
    ] {
        let media = format!(
            r#"
[media.cloud]
type = "homogeneous"
sigma_a = 0.0
sigma_s = [1.0, 2.0, 8.0]
[media.smoke]
type = "heterogeneous"
density = {{ file = "smoke.vol" }}
transform = [{{ translate = [-0.5, -0.5, -0.5] }}, {{ translate = [-0.5, 0.1, 0.1] }}]
sigma_a = 0.0
sigma_s = [2.0, 0.3, 1.0]
phase = {{ type = "hg", g = 0.6 }}
transmittance = {estimator}
[materials.boundary]
type = "null"
[materials.glass]
type = "dielectric"
ior = 1.33
[[shapes]]
type = "sphere"
center = [-0.5, 0.0, 0.0]
radius = 0.8
material = "boundary"
interior = "cloud"
[[shapes]]
type = "sphere"
center = [-0.5, 0.1, 0.1]
radius = 0.4
material = "boundary"
interior = "smoke"
exterior = "cloud"
[[shapes]]
type = "sphere"
center = [0.8, 0.0, 0.0]
radius = 0.5
material = "glass"
interior = "cloud"
"#
        );
        let mut vol = b"VOL\x03".to_vec();
        for int in [1i32, 3, 2, 2, 1] {
            vol.extend(int.to_le_bytes());
        }
        let densities = [0.0f32, 1.0, 4.0, 0.5, 0.0, 2.0, 3.0, 0.0, 1.0, 0.2, 6.0, 0.0];
        for float in [0.0f32, 0.0, 0.0, 1.0, 1.0, 1.0].into_iter().chain(densities) {
            vol.extend(float.to_le_bytes());
        }
        let toml = under_the_sky(&media);
        let scene = scene_with(&toml, &[("smoke.vol", &vol)]);
        is_everywhere(&images(&scene, UNBOUNDED, 4), [1.0; 3]);
    }
}

/// A medium that only absorbs, in a ball around the camera: what it leaves of the sky, and of a small white disc lit by
/// the sky.
#[test]
fn the_sky_is_absorbed_on_the_way_in_and_back() {
    let sigma_a = [0.3, 1.5, 0.0];
    let ball = |origin: &str, shapes: &str| {
        format!(
            r#"
[image]
width = 16
height = 16
[camera]
origin = {origin}
target = [0.0, 0.0, 0.0]
fov = 1.0
[media.ink]
type = "homogeneous"
sigma_a = {sigma_a:?}
sigma_s = 0.0
[materials.boundary]
type = "null"
[[shapes]]
type = "sphere"
center = [0.0, 0.0, 0.0]
radius = 1.0
material = "boundary"
interior = "ink"
[[lights]]
type = "environment"
radiance = 1.0
{shapes}
"#
        )
    };
    let scene_of_ball = scene(&ball("[0.0, 0.0, 1e-4]", ""));
    let expected = sigma_a.map(|s| libm::exp(-s * (1.0 + 1e-4)));
    is_everywhere(&images(&scene_of_ball, UNBOUNDED, 1), expected);

    let disc = r#"
[materials.paint]
type = "diffuse"
reflectance = 0.8
[[shapes]]
type = "disc"
material = "paint"
transform = [{ scale = 0.02 }]
"#;
    let got = images(&scene(&ball("[0.0, 0.0, 0.4]", disc)), UNBOUNDED, 16);
    // Significance 1e-3. The points of the disc that are seen are up to 0.005 off the centre; distances differ by the
    // square of that.
    let mut suite = Suite::new(1e-3);
    for (c, (sigma_a, mean)) in sigma_a.into_iter().zip(&got.whole).enumerate() {
        let expected = 0.8 * libm::exp(-sigma_a * 1.4);
        suite.mean_within(format!("channel {c}"), mean, expected, 1e-4);
    }
    suite.finish();
}

const SIZE: usize = PointInFog::SIZE;
const FOG_AROUND: PointInFog = PointInFog {
    sigma_s: [0.3, 0.9, 0.1],
    sigma_a: [0.2, 0.5, 0.0],
};

/// The light of paths that are scattered once is the integral of single scattering, however dense the fog.
#[test]
fn a_point_light_in_fog_is_the_integral_along_the_ray() {
    let side = 4;
    let scene = scene(&FOG_AROUND.scene());
    let got = Blocks::new(reference_images(&scene, bounded(1), 64, 16), side);
    // Significance 1e-3. Blocks near the light, where the variance is infinite, are left out. Rounding of the
    // quadrature and of single precision: 1e-3.
    let mut suite = Suite::new(1e-3);
    for (i, block) in got.blocks.iter().enumerate() {
        let (bx, by) = (i % (SIZE / side), i / (SIZE / side));
        let (mut expected, mut nearest) = (DVec3::ZERO, f64::INFINITY);
        for p in 0..side * side {
            let corner = DVec2::new((bx * side + p % side) as f64, (by * side + p / side) as f64);
            let (integral, distance) = FOG_AROUND.pixel_integral(corner);
            expected += integral / (side * side) as f64;
            nearest = nearest.min(distance);
        }
        if nearest < 0.3 {
            continue;
        }
        for c in 0..3 {
            let name = format!("block {i}, channel {c}");
            suite.mean_within(name, &block[c], expected[c], 1e-3);
        }
    }
    suite.finish();
}

/// Coloured fog, lit by a visible lamp, with a mirror, a shiny ball, a cloud within a boundary and a sheet of paper
/// with holes.
const FOGGY_ROOM: &str = r#"
[image]
width = 32
height = 32
[render]
paths = 10000
seed = 7
[world]
medium = "fog"
[camera]
origin = [0.0, 0.0, 0.95]
target = [0.0, 0.0, 0.0]
fov = 75.0
aperture = 0.02
[media.fog]
type = "homogeneous"
sigma_a = [0.05, 0.1, 0.2]
sigma_s = [0.5, 0.3, 0.2]
phase = { type = "hg", g = 0.3 }
[media.cloud]
type = "homogeneous"
sigma_a = 0.1
sigma_s = [3.0, 2.0, 4.0]
[materials.boundary]
type = "null"
[materials.wall]
type = "diffuse"
reflectance = [0.5, 0.4, 0.3]
[materials.brushed]
type = "rough_conductor"
alpha = 0.3
preset = "gold"
[materials.coat]
type = "rough_plastic"
alpha = 0.2
reflectance = [0.2, 0.3, 0.6]
[materials.paper]
type = "diffuse"
reflectance = 0.7
two_sided = true
opacity = 0.5
[[shapes]]
type = "cube"
flip_normals = true
material = "wall"
[[shapes]]
type = "sphere"
center = [-0.5, 0.5, -0.2]
radius = 0.2
emission = { radiance = [6, 5, 4] }
[[shapes]]
type = "sphere"
center = [-0.5, -0.5, -0.4]
radius = 0.3
material = "brushed"
[[shapes]]
type = "sphere"
center = [0.1, -0.6, 0.1]
radius = 0.2
material = "coat"
[[shapes]]
type = "sphere"
center = [0.5, 0.1, -0.3]
radius = 0.35
material = "boundary"
interior = "cloud"
exterior = "fog"
[[shapes]]
type = "rectangle"
material = "paper"
transform = [{ scale = 0.3 }, { rotate = { axis = [0, 1, 0], angle = 30 } }, { translate = [0.1, 0.4, -0.6] }]
"#;

/// Another estimator of the same light. Significance 1e-3 over all blocks and channels; late passes, with 1 % allowed
/// for kernels.
#[test]
fn fog_with_a_lamp_is_what_beams_show() {
    let scene = scene(FOGGY_ROOM);
    let plan = plan_of(&scene);
    let passes = (256..256 + 48).map(|i| render_pass(&scene, &plan, i).expect("a pass").film);
    let beams = Blocks::new(passes, BLOCK);
    let got = images(&scene, UNBOUNDED, 16);
    let mut suite = Suite::new(1e-3);
    suite.same_blocks("fog", &beams, &got, 0.01);
    suite.finish();
}

#[test]
fn threads_do_not_change_a_bit() {
    let scene = scene(FOGGY_ROOM);
    let hash = |threads, seed, sample| {
        let settings = ReferenceSettings { seed, ..UNBOUNDED };
        let film = with_threads(threads, || render_sample(&scene, &settings, sample, || true));
        pixel_hash(&film.unwrap())
    };
    let one = hash(1, 1, 5);
    for threads in [2, 3, 8] {
        assert_eq!(hash(threads, 1, 5), one, "{threads} threads");
    }
    assert_ne!(hash(1, 1, 6), one);
    assert_ne!(hash(1, 2, 5), one);
}

#[test]
fn a_sample_that_is_stopped_is_no_sample() {
    let scene = scene(FOGGY_ROOM);
    assert!(render_sample(&scene, &UNBOUNDED, 0, || false).is_none());
}

macro_rules! mitsuba_scenes {
    ($($test:ident: $name:literal;)*) => {$(
        #[test]
        fn $test() {
            let scene = mitsuba::scene($name);
            mitsuba::compare($name, reference_images(&scene, UNBOUNDED, 64, 4));
        }
    )*};
}

mitsuba_scenes! {
    mitsuba_surfaces: "surfaces";
    mitsuba_specular: "specular";
    mitsuba_glossy: "glossy";
    mitsuba_plastic: "plastic";
    mitsuba_lens: "lens";
    mitsuba_textures: "textures";
    mitsuba_shapes: "shapes";
    mitsuba_environment: "environment";
    mitsuba_fog: "fog";
    mitsuba_fog_hg: "fog-hg";
    mitsuba_fog_blend: "fog-blend";
    mitsuba_chromatic: "chromatic";
    mitsuba_spot_fog: "spot-fog";
    mitsuba_cloud: "cloud";
    mitsuba_amber: "amber";
    mitsuba_furnace: "furnace";
}
