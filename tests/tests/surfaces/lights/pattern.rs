//! Surfaces whose radiance varies with a texture: how points on them are drawn, and pictures lit by them.

use crate::surfaces::lights::setup::{BOUNDS, PATHS, PHOTONS, SIGNIFICANCE, found_once, patterned, rectangle, shapes};
use beamfarm_harness::render::{Blocks, blocks, blur, reference_images, scene};
use beamfarm_harness::{MeanEstimate, Suite};
use beamfarm_image::job::ReferenceSettings;
use beamfarm_render::math::{Rgb, Vec2, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::Scene;
use beamfarm_render::world::geometry::{Mesh, Placement, Shape};
use beamfarm_render::world::light::{EmissionUniforms, LightKind, Pattern};
use beamfarm_render::world::texture::Texture;
use glam::Affine2;
use std::sync::Arc;

/// Photons carry the light's power in the mean; the power comes from a lattice of samples, within 0.5 %.
#[test]
fn mean_emission_is_the_power() {
    let mut suite = Suite::new(SIGNIFICANCE);
    for (name, shape) in shapes() {
        let (objects, light) = patterned(shape);
        let power = light.power(&objects, &BOUNDS);
        let mut rng = Sampler::new(3, 0, Purpose::Test, 0);
        let mut means = [MeanEstimate::new(); 3];
        for _ in 0..100_000 {
            let sample = light.sample_emission(&objects, &BOUNDS, EmissionUniforms::draw(&mut rng));
            for (mean, value) in means.iter_mut().zip(sample.power.to_array()) {
                mean.add(f64::from(value));
            }
        }
        for (channel, mean) in means.iter().enumerate() {
            suite.mean_within(format!("{name} {channel}"), mean, f64::from(power[channel]), 5e-3);
        }
    }
    suite.finish();
}

/// With one of a mesh's two rectangles black, nearly all points are drawn on the other, and the emitted power is that
/// of the other.
#[test]
fn points_are_drawn_where_light_is() {
    let Shape::Mesh { mesh: one, .. } = rectangle(Vec3::ZERO, Vec3::X, Vec3::Y) else {
        panic!();
    };
    let side = |offset: f32| one.positions.iter().map(move |p| *p + Vec3::X * offset);
    let mesh = Mesh {
        positions: side(0.0).chain(side(10.0)).collect(),
        triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
        uvs: [0.2; 4]
            .into_iter()
            .chain([0.7; 4])
            .map(|u| Vec2::new(u, 0.2))
            .collect(),
        ..Mesh::default()
    };
    let shape = Shape::Mesh {
        mesh: Arc::new(mesh),
        placement: Placement::IDENTITY,
    };
    let squares = Texture::Checkerboard {
        colors: [Rgb::ZERO, Rgb::ONE],
        squares_from_uv: Affine2::IDENTITY,
    };
    let (pattern, mean) = Pattern::new(squares, Rgb::new(4.0, 2.0, 1.0), &shape, None).unwrap();
    assert!((mean - Rgb::new(2.0, 1.0, 0.5)).length() < 1e-6);
    let mut rng = Sampler::new(3, 0, Purpose::Test, 0);
    let (mut lit, mut emitted) = (0, MeanEstimate::new());
    for _ in 0..100_000 {
        let at = pattern.sample(&shape, rng.next_2d(), rng.next_1d());
        let radiance = pattern.radiance_of(&shape, &at);
        assert_eq!(radiance != Rgb::ZERO, at.point.x > 5.0);
        assert_eq!(at.pdf_area, pattern.pdf_area(&shape, at.normal, at.primitive));
        lit += usize::from(radiance != Rgb::ZERO);
        emitted.add(f64::from(radiance.x / at.pdf_area));
    }
    assert!(lit > 94_000, "{lit}");
    let mut suite = Suite::new(SIGNIFICANCE);
    suite.mean("all", &emitted, 4.0);
    suite.finish();
}

/// A panel of four squares, of different sizes and colours, over a floor that is seen from just below the panel.
const PANEL: &str = r#"
[image]
width = 8
height = 8
[render]
passes = 400
paths = 2000
radius = 0.02
SURFACES
[camera]
origin = [0, 0.9, 0]
target = [0, 0, 0]
up = [0, 0, -1]
projection = "orthographic"
view_width = 2
[materials.floor]
type = "diffuse"
reflectance = 0.8
[[shapes]]
type = "rectangle"
material = "floor"
transform = [{ scale = 3 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[shapes]]
type = "rectangle"
transform = [{ scale = 0.5 }, { rotate = { axis = [1, 0, 0], angle = 90 } }, { translate = [0, 1, 0] }]
emission = EMISSION
"#;

const SQUARES: &str = "{ radiance = { checkerboard = [[6, 3, 1], [0, 0.5, 1]], \
    uv = [{ translate = [0.3, 0.2, 0] }] }, scale = [2, 2, 1] }";

fn panel(emission: &str, surfaces: &str) -> Scene {
    scene(&PANEL.replace("EMISSION", emission).replace("SURFACES", surfaces))
}

/// Radiance of the panel at (x, 1, z), by hand: half a unit of UV is half a unit of the panel.
fn emitted(x: f64, z: f64) -> [f64; 3] {
    let upper = |t: f64| t - t.floor() > 0.5;
    match upper(x + 0.5 + 0.3) == upper(z + 0.5 + 0.2) {
        true => [12.0, 6.0, 1.0],
        false => [0.0, 1.0, 1.0],
    }
}

/// Radiance of the floor at (x, 0, z), by the midpoint rule on a grid aligned with the squares' edges.
fn floor_at(x: f64, z: f64) -> [f64; 3] {
    const N: i32 = 50;
    let mut sum = [0.0; 3];
    for i in 0..N * N {
        let at = |i: i32| (f64::from(i) + 0.5) / f64::from(N) - 0.5;
        let (px, pz) = (at(i % N), at(i / N));
        let d2 = (px - x) * (px - x) + (pz - z) * (pz - z) + 1.0;
        let weight = 1.0 / (d2 * d2) / f64::from(N * N);
        for (sum, value) in sum.iter_mut().zip(emitted(px, pz)) {
            *sum += value * weight * 0.8 / std::f64::consts::PI;
        }
    }
    sum
}

/// By camera paths, by photons, by the path tracer: the floor is as bright as integration says, quarter by quarter.
#[test]
fn a_floor_is_lit_by_what_is_on_a_panel() {
    let mut suite = Suite::new(SIGNIFICANCE);
    let mut expected = [[0.0; 3]; 4];
    for y in 0..16 {
        for x in 0..16 {
            let at = |i: usize| (i as f64 + 0.5) / 8.0 - 1.0;
            let value = floor_at(at(x), at(y));
            let block: &mut [f64; 3] = &mut expected[y / 8 * 2 + x / 8];
            block
                .iter_mut()
                .zip(value)
                .for_each(|(sum, value)| *sum += value / 64.0);
        }
    }
    let reference = panel(SQUARES, "");
    let settings = ReferenceSettings {
        seed: 2,
        max_depth: None,
    };
    for (name, found) in [
        ("paths", blocks(&panel(SQUARES, "surfaces = \"paths\""), 4)),
        ("photons", blocks(&panel(SQUARES, "surfaces = \"photons\""), 4)),
        (
            "reference",
            Blocks::new(reference_images(&reference, settings, 60, 8), 4),
        ),
    ] {
        for (i, (block, expected)) in found.blocks.iter().zip(&expected).enumerate() {
            for (channel, (mean, expected)) in block.iter().zip(expected).enumerate() {
                // The grid's error.
                suite.mean_within(format!("{name}, {i}, {channel}"), mean, *expected, 1e-3);
                assert!(
                    mean.std_error() < 0.02 * blur() * expected,
                    "{name}: {}",
                    mean.std_error() / expected
                );
            }
        }
    }
    suite.finish();
}

/// A texture of one colour equals that colour.
#[test]
fn an_even_texture_is_a_plain_number() {
    let plain = blocks(&panel("{ radiance = [3, 2, 1] }", ""), 4);
    let even = panel(
        "{ radiance = { checkerboard = [[1.5, 1, 1], [1.5, 1, 1]] }, scale = [2, 2, 1] }",
        "",
    );
    let LightKind::Area { radiance, .. } = &even.description().lights[0].kind else {
        panic!();
    };
    assert!((*radiance - Rgb::new(3.0, 2.0, 1.0)).length() < 1e-5);
    let mut suite = Suite::new(SIGNIFICANCE);
    suite.same_blocks("even", &blocks(&even, 4), &plain, 1e-6);
    suite.finish();
    // A black one is no light.
    for black in [
        "{ radiance = { checkerboard = [0, 0] } }",
        "{ radiance = { checkerboard = [1, 1] }, scale = 0 }",
    ] {
        assert!(panel(black, "").description().lights.is_empty());
    }
}

/// A box of fog, lit by a panel, a ball, a disc and a pipe with squares, one of them behind glass.
const ROOM: &str = r#"
[image]
width = 24
height = 24
[render]
passes = 600
paths = 4000
radius = 0.03
[camera]
origin = [0.0, 0.0, 0.9]
target = [0.0, 0.0, 0.0]
fov = 80.0
[world]
medium = "fog"
[media.fog]
type = "homogeneous"
sigma_a = [0.1, 0.2, 0.3]
sigma_s = [0.9, 0.7, 0.5]
phase = { type = "hg", g = 0.4 }
[materials.wall]
type = "diffuse"
reflectance = [0.7, 0.6, 0.5]
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "cube"
flip_normals = true
material = "wall"
[[shapes]]
type = "sphere"
center = [-0.45, -0.6, -0.3]
radius = 0.38
material = "glass"
exterior = "fog"
interior = "fog"
[[shapes]]
type = "rectangle"
transform = [{ scale = 0.4 }, { rotate = { axis = [1, 0, 0], angle = 90 } }, { translate = [0.3, 0.95, -0.2] }]
emission = { radiance = { checkerboard = [[6, 1, 1], [0, 2, 5]], uv = [{ scale = [2, 1, 1] }] }, scale = 0.8 }
[[shapes]]
type = "sphere"
center = [-0.5, -0.55, -0.3]
radius = 0.12
emission = { radiance = { checkerboard = [[5, 4, 0], [0, 1, 3]], uv = [{ scale = [3, 2, 1] }] } }
[[shapes]]
type = "disc"
transform = [{ scale = 0.2 }, { rotate = { axis = [0, 1, 0], angle = 90 } }, { translate = [-0.97, 0.4, 0] }]
emission = { radiance = { checkerboard = [[2, 4, 3], 0] }, scale = 2 }
[[shapes]]
type = "cylinder"
p0 = [0.5, -0.9, -0.5]
p1 = [0.6, -0.4, -0.4]
radius = 0.1
emission = { radiance = { checkerboard = [[3, 0, 2], [0, 3, 1]] } }
"#;

#[test]
fn all_estimators_find_the_light_once() {
    let scene = scene(ROOM);
    assert_eq!(scene.description().lights.len(), 4);
    found_once(
        &scene,
        &[
            [PHOTONS, PHOTONS, PHOTONS],
            [PHOTONS, PATHS, PHOTONS],
            [PATHS, PATHS, PATHS],
            [PATHS, PATHS, None],
        ],
        240,
    );
}
