//! Scenes with materials that camera paths, gather rays, shadow rays and photons each treat in their own way, against
//! Mitsuba 3's path tracer; see tests/data/mitsuba_renders/render.py.

use beamfarm_harness::Suite;
use beamfarm_harness::render::{blocks, scene, scene_with};

const ROOM: &str = r#"
[image]
width = 32
height = 32
[render]
passes = 384
paths = 10000
radius = 0.03
seed = 11
[camera]
origin = [0.3, 1.6, 4.0]
target = [0.0, 0.5, 0.0]
fov = 45.0
[materials.red]
type = "diffuse"
reflectance = [0.6, 0.2, 0.1]
[materials.grey]
type = "diffuse"
[[shapes]]
type = "rectangle"
material = "floor"
transform = [{ scale = 2.0 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[shapes]]
type = "rectangle"
material = "red"
transform = [{ scale = [2, 1, 1] }, { translate = [0, 1, -1.5] }]
[[shapes]]
type = "rectangle"
emission = { radiance = [8, 7, 6] }
transform = [{ scale = 0.5 }, { rotate = { axis = [1, 0, 0], angle = 90 } }, { translate = [0, 2.2, -0.6] }]
"#;

/// Every block of 8 x 8 pixels is Mitsuba's within the noise of both and a share for what kernels blur over edges.
#[track_caller]
fn is_that_of_mitsuba(objects: &str, expected: &str, bias: f64) {
    let assets: [(&str, &[u8]); 3] = [
        ("mask.png", include_bytes!("../../data/mitsuba_renders/mask.png")),
        ("normals.png", include_bytes!("../../data/mitsuba_renders/normals.png")),
        ("bump.png", include_bytes!("../../data/mitsuba_renders/bump.png")),
    ];
    let ours = blocks(&scene_with(&format!("{ROOM}{objects}"), &assets), 8);
    let mut failures = vec![];
    for (i, (row, block)) in expected.lines().zip(&ours.blocks).enumerate() {
        let numbers: Vec<f64> = row.split(',').map(|x| x.parse().expect(row)).collect();
        for (c, ours) in block.iter().enumerate() {
            let (mean, error) = (numbers[c], ours.std_error().hypot(numbers[c + 3]));
            // 48 tests per scene: the chance of 4.5 standard errors in any of them is below 1e-3.
            if (ours.mean() - mean).abs() > bias * mean + 4.5 * error {
                let ratio = ours.mean() / mean;
                failures.push(format!("block {i}, channel {c}: {ratio} of {mean} +- {error}"));
            }
        }
    }
    assert_eq!(ours.blocks.len(), 16);
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn smooth_and_rough_plastic() {
    let objects = r#"
[materials.floor]
type = "plastic"
reflectance = [0.2, 0.3, 0.4]
ior = 1.5
[materials.rough]
type = "rough_plastic"
reflectance = [0.2, 0.3, 0.4]
ior = 1.5
alpha = 0.2
[[shapes]]
type = "sphere"
center = [-0.5, 0.5, 0.0]
radius = 0.5
material = "floor"
[[shapes]]
type = "sphere"
center = [0.7, 0.4, 0.2]
radius = 0.4
material = "rough"
"#;
    let expected = include_str!("../../data/mitsuba_renders/plastic.csv");
    is_that_of_mitsuba(objects, expected, 0.005);
}

#[test]
fn surfaces_that_are_not_opaque() {
    let objects = r#"
[materials.floor]
type = "diffuse"
[materials.screen]
type = "diffuse"
reflectance = [0.6, 0.2, 0.1]
two_sided = true
opacity = { image = "mask.png", raw = true, filter = "nearest" }
[materials.veil]
type = "diffuse"
opacity = 0.4
[[shapes]]
type = "rectangle"
material = "screen"
transform = [{ scale = 0.8 }, { rotate = { axis = [1, 0, 0], angle = -80 } }, { translate = [0, 1.2, -0.3] }]
[[shapes]]
type = "sphere"
center = [0.5, 0.5, 0.5]
radius = 0.5
material = "veil"
"#;
    let expected = include_str!("../../data/mitsuba_renders/opacity.csv");
    is_that_of_mitsuba(objects, expected, 0.005);
}

/// Light scattered by a blend alone is the weighted mean of its parts: a floor of three materials under a lamp.
#[test]
fn blends_are_the_mean_of_their_parts() {
    let image = |floor: &str, seed: u32| {
        let scene = format!(
            r#"
[image]
width = 32
height = 32
[render]
passes = 128
paths = 10000
radius = 0.03
seed = {seed}
[camera]
origin = [0.3, 1.6, 4.0]
target = [0.0, 0.5, 0.0]
fov = 45.0
[materials.floor]
{floor}
[materials.grey]
type = "diffuse"
[materials.rough]
type = "rough_plastic"
reflectance = [0.2, 0.3, 0.4]
ior = 1.5
alpha = 0.2
[materials.smooth]
type = "plastic"
reflectance = [0.6, 0.3, 0.1]
ior = 1.5
[materials.inner]
type = "blend"
materials = ["rough", "smooth"]
weight = 0.5
[[shapes]]
type = "rectangle"
material = "floor"
transform = [{{ scale = 2.0 }}, {{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}]
[[shapes]]
type = "rectangle"
emission = {{ radiance = [8, 7, 6] }}
transform = [{{ scale = 0.5 }}, {{ rotate = {{ axis = [1, 0, 0], angle = 90 }} }}, {{ translate = [0, 2.2, -0.6] }}]
"#
        );
        blocks(&self::scene(&scene), 8)
    };
    let blend = |materials: &str, weight: f32| format!("type = \"blend\"\nmaterials = {materials}\nweight = {weight}");
    let whole = image(&blend("[\"grey\", \"inner\"]", 0.6), 1);
    let parts = [
        (0.4, image("type = \"diffuse\"", 2)),
        (0.3, image(&blend("[\"rough\", \"grey\"]", 0.0), 3)),
        (0.3, image(&blend("[\"grey\", \"smooth\"]", 1.0), 4)),
    ];
    for (i, block) in whole.blocks.iter().enumerate() {
        for (c, ours) in block.iter().enumerate() {
            let expected: f64 = parts.iter().map(|(w, part)| w * part.blocks[i][c].mean()).sum();
            let errors = parts.iter().map(|(w, part)| w * part.blocks[i][c].std_error());
            let error = errors.fold(ours.std_error(), f64::hypot);
            // 48 tests: the chance of 4.5 standard errors in any of them is below 1e-3.
            assert!(
                (ours.mean() - expected).abs() <= 4.5 * error,
                "block {i}, channel {c}: {} is not {expected} +- {error}",
                ours.mean()
            );
        }
    }
}

/// Bumps do not shadow metal, but they shadow what is diffuse.
#[test]
fn bump_and_normal_maps() {
    let objects = r#"
[materials.floor]
type = "diffuse"
normal_map = { image = "normals.png" }
[materials.chrome]
type = "rough_conductor"
distribution = "beckmann"
alpha = 0.3
eta = 1.4
k = 1.6
two_sided = false
bump = { image = "bump.png", raw = true, scale = 0.15 }
[materials.board]
type = "diffuse"
reflectance = [0.2, 0.3, 0.4]
two_sided = true
bump = { image = "bump.png", raw = true, scale = 0.2 }
[[shapes]]
type = "sphere"
center = [-0.5, 0.5, 0.0]
radius = 0.5
material = "chrome"
[[shapes]]
type = "rectangle"
material = "board"
transform = [{ scale = [0.5, 0.6, 1] }, { rotate = { axis = [0, 1, 0], angle = -30 } }, { translate = [0.8, 0.6, 0] }]
"#;
    let expected = include_str!("../../data/mitsuba_renders/relief.csv");
    is_that_of_mitsuba(objects, expected, 0.005);
}

#[test]
fn panes_and_principled() {
    let objects = r#"
[materials.floor]
type = "diffuse"
[materials.pane]
type = "thin_dielectric"
ior = 1.5
specular_transmittance = [0.9, 0.6, 0.3]
[materials.principled]
type = "principled"
base_color = [0.8, 0.4, 0.1]
metallic = 0.5
[[shapes]]
type = "rectangle"
material = "pane"
transform = [{ scale = [0.5, 0.6, 1] }, { rotate = { axis = [0, 1, 0], angle = -20 } }, { translate = [0.9, 0.7, 0.8] }]
[[shapes]]
type = "sphere"
center = [-0.5, 0.5, 0.0]
radius = 0.5
material = "principled"
"#;
    let expected = include_str!("../../data/mitsuba_renders/panes.csv");
    is_that_of_mitsuba(objects, expected, 0.005);
}

/// A surface's emission does not depend on what it lets through: a black lamp that rays pass shines like one that they
/// do not pass, if nothing is behind it.
#[test]
fn lamps_that_are_not_opaque() {
    let image = |opacity: f32| {
        let lamp = format!(
            "[materials.floor]\ntype = \"rough_conductor\"\npreset = \"gold\"\nalpha = 0.3\n\
             [materials.lamp]\ntype = \"diffuse\"\nreflectance = 0.0\nopacity = {opacity:?}\n"
        );
        let room = ROOM.replace("emission", "material = \"lamp\"\nemission");
        let room = room.replace("passes = 384", "passes = 96");
        blocks(&scene(&format!("{room}{lamp}")), 8)
    };
    let opaque = image(1.0);
    let mut suite = Suite::new(1e-3);
    for opacity in [0.0, 0.5] {
        let image = image(opacity);
        for (i, (a, b)) in opaque.blocks.iter().zip(&image.blocks).enumerate() {
            suite.same_mean(format!("opacity {opacity}, block {i}"), &a[1], &b[1]);
        }
    }
    suite.finish();
}
