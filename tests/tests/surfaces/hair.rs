//! Curves and points, as hair and with other materials, against the path tracer; and displaced meshes.

use beamfarm_harness::Suite;
use beamfarm_harness::render::{Blocks, blocks, images, reference_images, scene, scene_with, truth};
use beamfarm_image::job::ReferenceSettings;
use beamfarm_render::world::geometry::Shape;
use std::fmt::Write;

/// A tuft of some 60 spread strands as text, curves of eight points each.
fn tuft() -> String {
    let mut text = String::new();
    for i in 0..60 {
        let turn = f64::from(i) * 2.399_963;
        let lean = 0.6 * (f64::from(i) / 60.0).sqrt();
        let (sin, cos) = libm::sincos(turn);
        for k in 0..8 {
            let t = f64::from(k) / 7.0;
            let out = 0.3 * lean + lean * t * t;
            let radius = 0.02 * (1.0 - 0.7 * t);
            writeln!(text, "{} {} {} {radius}", out * cos, 0.9 * t - 0.4, out * sin).unwrap();
        }
        text.push('\n');
    }
    text
}

const VIEW: &str = r#"
image = { width = 32, height = 32 }
render = { passes = 64, paths = 3000 }
camera = { origin = [0, 0.6, 3], target = [0, 0.05, 0], fov = 34 }
materials.hair = { type = "hair", pheomelanin = 0.4, eumelanin = 0.1 }
materials.coat = { type = "plastic", reflectance = [0.2, 0.4, 0.7], two_sided = true }
materials.glass = { type = "dielectric", ior = 1.5 }
materials.ground = { type = "diffuse", reflectance = 0.7 }
"#;

/// Hair, coated curves and balls of glass over a ground, lit by a lamp of some size, in vacuum and in fog: camera
/// paths, and photons that hairs and balls scatter, bring what the path tracer finds.
#[test]
fn strands_look_as_the_path_tracer_has_them() {
    let shapes = r#"
[[shapes]]
type = "curves"
file = "tuft.txt"
material = "hair"
transform = [{ translate = [-0.45, 0, 0] }]
[[shapes]]
type = "instances"
shape = { type = "curves", file = "tuft.txt", basis = "linear", material = "coat" }
transforms = [[{ scale = 0.8 }, { translate = [0.5, 0, 0] }]]
[[shapes]]
type = "points"
points = [[0, -0.2, 0.7, 0.15], [0.3, -0.3, 0.6, 0.08]]
material = "glass"
[[shapes]]
type = "rectangle"
material = "ground"
transform = [{ rotate = { axis = [1, 0, 0], angle = -90 } }, { scale = 2 }, { translate = [0, -0.42, 0] }]
[[shapes]]
type = "sphere"
center = [-1.2, 2.2, 1]
radius = 0.5
emission = { radiance = 8 }
"#;
    let fog = "[world]\nmedium = \"fog\"\n[media.fog]\ntype = \"homogeneous\"\nsigma_t = 0.2\nalbedo = 0.8\n";
    let mut suite = Suite::new(1e-2);
    for (name, world) in [("vacuum", ""), ("fog", fog)] {
        let tuft = tuft();
        let hairy = scene_with(&format!("{VIEW}{world}{shapes}"), &[("tuft.txt", tuft.as_bytes())]);
        let reference = truth(&hairy, images(64), 16, 16);
        suite.same_blocks(name, &blocks(&hairy, 16), &reference, 0.03);
    }
    suite.finish();
}

/// A heap of hair without absorption in even light is as bright as the light, and cannot be seen in it.
#[test]
fn white_hair_is_not_seen_in_a_furnace() {
    let tuft = tuft();
    let text = r#"
image = { width = 8, height = 8 }
render = { passes = 64 }
camera = { origin = [0, 0.6, 3], target = [0, 0.05, 0], fov = 20 }
materials.white = { type = "hair", absorption = 0, beta_m = 0.4, beta_n = 0.4 }
[[shapes]]
type = "curves"
file = "tuft.txt"
material = "white"
[[lights]]
type = "environment"
radiance = 1
"#;
    let furnace = scene_with(text, &[("tuft.txt", tuft.as_bytes())]);
    let settings = ReferenceSettings {
        seed: 3,
        max_depth: None,
    };
    let mut suite = Suite::new(1e-2);
    for (name, found) in [
        ("passes", blocks(&furnace, 8)),
        ("paths", Blocks::new(reference_images(&furnace, settings, 64, 4), 8)),
    ] {
        for channel in 0..3 {
            suite.mean_within(name, &found.blocks[0][channel], 1.0, 1e-3);
        }
    }
    suite.finish();
}

/// Heights from a graph of position: a cube without UV seams takes the right form and stays closed, so that it may be
/// glass. And heights from an image.
#[test]
fn displaced_meshes_stay_closed() {
    let text = |material: &str, height: &str| {
        format!(
            r#"
image = {{ width = 8, height = 8 }}
camera = {{ origin = [0, 0, 6], target = [0, 0, 0], fov = 40 }}
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.grey]
type = "diffuse"
[textures.bumps]
node = "noise"
vector = {{ node = "coordinates", of = "object" }}
[[shapes]]
type = "cube"
material = "{material}"
displacement = {{ height = {height}, midlevel = 0.5, scale = 0.4, edge = 0.1 }}
[[lights]]
type = "environment"
radiance = 1
"#
        )
    };
    for height in ["{ texture = \"bumps\" }", "0.75"] {
        let made = scene(&text("glass", height));
        assert!(made.description().notes.is_empty(), "{:?}", made.description().notes);
        let Shape::Mesh { mesh, .. } = &made.description().objects[0].shape else {
            panic!("no mesh");
        };
        assert!(mesh.triangles.len() > 2000 && mesh.is_closed());
        if height == "0.75" {
            // Faces move outwards by a tenth, edges and corners along the mean of their normals.
            let volume = mesh.signed_volume();
            assert!((8.0..2.2 * 2.2 * 2.2).contains(&volume), "{volume}");
        }
    }
}
