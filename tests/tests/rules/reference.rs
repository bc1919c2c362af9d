//! The path tracer, which shares no estimator with the beams, obeys the rules of all rays except photons.

use super::VIEW;
use beamfarm_harness::Suite;
use beamfarm_harness::render::{Blocks, blocks, reference_images, scene};
use beamfarm_image::job::ReferenceSettings;

const ROOM: &str = r#"
[media.fog]
type = "homogeneous"
sigma_a = 0.1
sigma_s = 0.5
[materials.boundary]
type = "null"
[materials.silver]
type = "mirror"
[materials.satin]
type = "rough_conductor"
alpha = 0.3
preset = "silver"
[materials.red]
type = "diffuse"
reflectance = [0.7, 0.15, 0.1]
[[shapes]]
name = "room"
type = "cube"
flip_normals = true
transform = [{ scale = 6 }, { translate = [0, 6, 0] }]
[[shapes]]
name = "mirror"
type = "rectangle"
material = "silver"
transform = [{ scale = 0.9 }, { rotate = { axis = [0, 1, 0], angle = 30 } }, { translate = [-1.1, 1, -1] }]
[[shapes]]
name = "satin"
type = "rectangle"
material = "satin"
transform = [{ scale = 1 }, { rotate = { axis = [1, 0, 0], angle = -60 } }, { translate = [1, 0.5, 0] }]
[[shapes]]
name = "ball"
type = "sphere"
center = [0.2, 0.8, 0.9]
radius = 0.4
material = "red"
[[shapes]]
name = "box"
type = "cube"
material = "boundary"
interior = "fog"
transform = [{ scale = [1.2, 0.4, 0.4] }, { translate = [0, 1.4, -0.3] }]
[[shapes]]
name = "lamp"
type = "sphere"
center = [-1.5, 3.2, 0.5]
radius = 0.7
emission = { radiance = [6, 5, 3] }
[[shapes]]
name = "panel"
type = "rectangle"
emission = { radiance = [2, 3, 5] }
transform = [{ scale = 0.9 }, { look_at = { origin = [2.6, 2.2, -1.4], target = [0, 0.5, 0.5] } }]
"#;

const RULES: [&str; 7] = [
    "rays = [\"camera\"]\nexclude = [\"ball\", \"panel\"]",
    "on = [\"mirror\"]\nrays = [\"reflected\"]\ninclude = [\"room\", \"lamp\"]",
    "on = [\"satin\"]\nrays = [\"reflected\"]\nexclude = [\"ball\", \"panel\"]",
    "on = [\"room\", \"ball\"]\nrays = [\"shadow\"]\nexclude = [\"lamp\"]",
    "on = [\"satin\"]\nrays = [\"shadow\"]\ninclude = [\"lamp\", \"panel\", \"mirror\", \"box\"]",
    "on = [\"room\"]\nrays = [\"shadow\"]\nexclude = [\"ball\"]",
    "on = [\"panel\"]\nrays = [\"shadow\"]\nexclude = [\"ball\"]",
];

fn room() -> String {
    let view = VIEW
        .replace("passes = 4", "passes = 48")
        .replace("paths = 400", "paths = 3000\nradius = 0.06");
    format!("{view}{ROOM}")
}

/// All rules at once, since they affect each other.
fn all() -> String {
    let rules = RULES.iter().map(|rule| format!("[[rules]]\n{rule}\n"));
    rules.collect()
}

#[test]
fn beams_and_the_path_tracer_obey_the_same_rules() {
    let one_by_one = RULES.iter().map(|rule| format!("[[rules]]\n{rule}\n"));
    same_as_the_path_tracer(&room(), one_by_one.chain([all()]));
}

#[test]
fn coats_obey_the_same_rules() {
    let satin = "type = \"rough_conductor\"\nalpha = 0.3\npreset = \"silver\"";
    let room = room();
    assert!(room.contains(satin));
    for coat in [
        "type = \"rough_plastic\"\nalpha = 0.3\nior = 1.9\nreflectance = [0.2, 0.5, 0.3]",
        "type = \"principled\"\nroughness = 0.5\nmetallic = 0.5\nbase_color = [0.4, 0.5, 0.9]",
    ] {
        let reflected = format!("[[rules]]\n{}\n", RULES[2]);
        same_as_the_path_tracer(&room.replace(satin, coat), [reflected, all()]);
    }
}

fn same_as_the_path_tracer(plain: &str, rule_sets: impl IntoIterator<Item = String>) {
    let plain_scene = scene(plain);
    for rules in rule_sets {
        let scene = scene(&format!("{plain}{rules}"));
        assert!(scene.description().notes.is_empty(), "{:?}", scene.description().notes);
        let beams = blocks(&scene, 8);
        let settings = ReferenceSettings::default();
        let truth = Blocks::new(reference_images(&scene, settings, 24, 12), 8);
        // Together the rules matter: without them the picture differs.
        let other = blocks(&plain_scene, 8);
        let differ = other.blocks.iter().flatten().zip(truth.blocks.iter().flatten());
        let differ = differ.map(|(a, b)| (a.mean() - b.mean()).abs() / a.std_error().hypot(b.std_error()));
        assert!(
            rules.len() < RULES[0].len() * 3 || differ.fold(0.0, f64::max) > 8.0,
            "{rules}: no effect"
        );
        // Kernels blur a little.
        let mut suite = Suite::new(1e-4);
        suite.same_blocks(&rules, &beams, &truth, 0.01);
        suite.finish();
    }
}
