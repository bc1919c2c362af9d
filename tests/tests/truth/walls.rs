//! Kernels do not reach through walls or past edges, and lose nothing on surfaces that are bent, creased or close
//! together.

use beamfarm_harness::Suite;
use beamfarm_harness::render::{Blocks, blocks, images, plan_of, reference_images, scene};
use beamfarm_image::job::ReferenceSettings;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::world::Scene;

const FOG: &str = r#"
[world]
medium = "fog"
[media.fog]
type = "homogeneous"
sigma_a = 0.1
sigma_s = 0.4
"#;

const MATERIALS: &str = r#"
[materials.grey]
type = "diffuse"
reflectance = 0.6
two_sided = true
[materials.glass]
type = "dielectric"
ior = 1.5
"#;

/// A lamp in a ball of glass, so that its light comes by photons.
fn bulb([x, y, z]: [f64; 3]) -> String {
    let at = format!("center = [{x}, {y}, {z}]");
    format!(
        r#"
[[shapes]]
type = "sphere"
{at}
radius = 0.4
material = "glass"
[[shapes]]
type = "sphere"
{at}
radius = 0.25
emission = {{ radiance = 4.0 }}
"#
    )
}

const NO_THICKNESS: &str = r#"
type = "rectangle"
transform = [{ scale = [1, 1.5, 1] }, { rotate = { axis = [0, 1, 0], angle = 90 } }, { translate = [0, 1.5, 0] }]
"#;
const THIN: &str = r#"
type = "cube"
transform = [{ scale = [0.0005, 1.5, 1] }, { translate = [0, 1.5, 0] }]
"#;

/// A lit room and a dark one on either side of a wall at x = 0, seen from within one of them.
fn two_rooms(wall: &str, from: f64, fog: &str) -> Scene {
    let camera = format!("origin = [{from}, 2.5, 0.001], target = [{from}, 0, 0], up = [0, 0, -1], fov = 60.0");
    let lamp = bulb([0.6, 1.2, 0.0]);
    scene(&format!(
        r#"
image = {{ width = 32, height = 16 }}
render = {{ passes = 128, paths = 3000 }}
camera = {{ {camera} }}
{fog}{MATERIALS}{lamp}
[[shapes]]
type = "cube"
material = "grey"
flip_normals = true
transform = [{{ scale = [2, 1.5, 1] }}, {{ translate = [0, 1.5, 0] }}]
[[shapes]]
material = "grey"
{wall}
"#
    ))
}

/// Whether all pixels of several passes are black.
fn is_black(scene: &Scene) -> bool {
    let plan = plan_of(scene);
    (0..16).all(|pass| {
        let film = render_pass(scene, &plan, pass).expect("a pass").film;
        film.pixels.iter().all(|pixel| *pixel == [0.0; 3])
    })
}

/// The path tracer's picture.
fn truth(scene: &Scene, samples: u64, side: usize) -> Blocks {
    let settings = ReferenceSettings {
        seed: 1,
        max_depth: None,
    };
    Blocks::new(reference_images(scene, settings, images(64), samples), side)
}

#[test]
fn a_room_beside_a_lit_one_is_dark() {
    for wall in [NO_THICKNESS, THIN] {
        for fog in ["", FOG] {
            assert!(is_black(&two_rooms(wall, -0.5, fog)), "{wall} {fog}");
        }
    }
}

/// Significance 1e-2 for all blocks of all pictures, with one percent allowed for blur.
#[test]
fn a_room_beside_a_dark_one_has_all_of_its_light() {
    let mut suite = Suite::new(1e-2);
    for (name, fog) in [("clear", ""), ("fog", FOG)] {
        let scene = two_rooms(THIN, 0.5, fog);
        let (found, truth) = (blocks(&scene, 8), truth(&scene, 32, 8));
        suite.same_blocks(name, &found, &truth, 0.02);
    }
    suite.finish();
}

/// A closed lit room in fog, seen from outside along its floor and its walls, past all its edges.
#[test]
fn nothing_of_a_room_is_seen_past_its_edges() {
    for camera in [
        r#"origin = [0, 0, 5], target = [0, 0, 0], projection = "orthographic", view_width = 3"#,
        r#"origin = [1.2, 1.9, 5], target = [1.2, 1.9, 0], projection = "orthographic", view_width = 3"#,
        "origin = [1.3, -0.1, 5], target = [1.1, 0.1, 0], fov = 30.0",
    ] {
        let lamp = bulb([0.0, 1.0, 0.0]);
        let scene = scene(&format!(
            r#"
image = {{ width = 32, height = 32 }}
render = {{ paths = 3000 }}
camera = {{ {camera} }}
{FOG}{MATERIALS}{lamp}
[[shapes]]
type = "cube"
material = "grey"
transform = [{{ scale = [1.2, 1, 1] }}, {{ translate = [0, 1, 0] }}]
"#
        ));
        assert!(is_black(&scene), "{camera}");
    }
}

/// A table in fog below a lamp, seen from the side: its shadow begins at its edge.
#[test]
fn beams_end_at_the_edge_of_a_table() {
    let lamp = bulb([0.0, 1.2, 0.0]);
    let scene = scene(&format!(
        r#"
image = {{ width = 32, height = 32 }}
render = {{ passes = 256, paths = 3000 }}
camera = {{ origin = [0, 0.05, 3], target = [0, 0.05, 0], fov = 40.0 }}
{FOG}{MATERIALS}{lamp}
[[shapes]]
type = "rectangle"
material = "grey"
transform = [{{ scale = [0.5, 0.5, 1] }}, {{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}]
"#
    ));
    let mut suite = Suite::new(1e-2);
    suite.same_blocks("table", &blocks(&scene, 8), &truth(&scene, 64, 8), 0.02);
    suite.finish();
}

/// Corners, creases, a pillar, balls in and on the ground, and a plate on a foot, with kernels as wide as the objects:
/// a kernel that walls clip would be clipped here too.
#[test]
fn what_is_bent_or_creased_is_not_darkened() {
    let mut suite = Suite::new(1e-2);
    for (name, fog) in [("clear", ""), ("fog", FOG)] {
        let balls = [[-0.5, 0.25, -0.5], [0.3, -0.1, -0.2], [0.0, -0.2, -0.1]].map(|[x, y, z]| {
            format!("[[shapes]]\ntype = \"sphere\"\nmaterial = \"grey\"\nradius = 0.28\ncenter = [{x}, {y}, {z}]\n")
        });
        let (balls, lamp) = (balls.concat(), bulb([0.2, 1.4, 0.2]));
        let scene = scene(&format!(
            r#"
image = {{ width = 32, height = 32 }}
render = {{ passes = 256, paths = 3000 }}
camera = {{ origin = [0.9, 1.1, 1.7], target = [-0.3, 0.2, -0.3], fov = 60.0 }}
{fog}{MATERIALS}{lamp}{balls}
[[shapes]]
type = "cube"
material = "grey"
flip_normals = true
transform = [{{ scale = [1.2, 1, 1.9] }}, {{ translate = [0, 1, 0] }}]
[[shapes]]
type = "cylinder"
material = "grey"
transform = [
    {{ scale = [0.15, 0.15, 0.5] }},
    {{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }},
    {{ translate = [0.4, 0, -0.9] }},
]
[[shapes]]
type = "cube"
material = "grey"
transform = [{{ scale = [0.3, 0.02, 0.2] }}, {{ translate = [-0.4, 0.08, 0.3] }}]
[[shapes]]
type = "cube"
material = "grey"
transform = [{{ scale = 0.03 }}, {{ translate = [-0.4, 0.03, 0.3] }}]
"#
        ));
        suite.same_blocks(name, &blocks(&scene, 8), &truth(&scene, 32, 8), 0.03);
    }
    suite.finish();
}
