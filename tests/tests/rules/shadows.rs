//! Shadow linking of lights: shadow rays to one light pass what those to the others do not.

use super::{VIEW, different, same_bits, same_means};
use beamfarm_harness::Suite;
use beamfarm_harness::render::{blocks, plan_of, scene};
use beamfarm_harness::z_test::two_sided;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::aov::light_layers;

/// A floor, some satin on it, and a ball that shows only by its shadows.
const FLOOR: &str = r#"
[materials.satin]
type = "rough_conductor"
alpha = 0.3
preset = "silver"
[[shapes]]
name = "floor"
type = "rectangle"
transform = [{ scale = 4 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[shapes]]
name = "satin"
type = "rectangle"
material = "satin"
transform = [{ scale = 0.8 }, { rotate = { axis = [1, 0, 0], angle = -90 } }, { translate = [0, 0.01, 1] }]
[[shapes]]
name = "ball"
type = "sphere"
center = [0, 0.7, 1.2]
radius = 0.5
visible = ["shadow"]
"#;

const LAMPS: [&str; 4] = [
    "[[shapes]]\nname = \"lamp\"\ntype = \"sphere\"\ncenter = [-1, 3.5, 1]\nradius = 0.5\n\
     emission = { radiance = [4, 3, 2] }\n",
    "[[shapes]]\nname = \"panel\"\ntype = \"disc\"\nemission = { radiance = [2, 3, 5] }\n\
     transform = [{ scale = 0.7 }, { look_at = { origin = [2, 3, 0], target = [0, 0, 1] } }]\n",
    "[[lights]]\nname = \"point\"\ntype = \"point\"\nposition = [0, 2.5, 3]\nintensity = [1, 5, 1]\n",
    "[[lights]]\nname = \"sky\"\ntype = \"environment\"\nradiance = [0.2, 0.2, 0.6]\n",
];

/// The scene with only these lamps shining; the shapes of the others stay.
fn lit(shines: impl Fn(usize) -> bool) -> String {
    let lamp = |(number, lamp): (usize, &&str)| match (shines(number), number) {
        (true, _) => (*lamp).to_owned(),
        (false, 0) => lamp.replace("[4, 3, 2]", "0"),
        (false, 1) => lamp.replace("[2, 3, 5]", "0"),
        (false, _) => String::new(),
    };
    let lamps: String = LAMPS.iter().enumerate().map(lamp).collect();
    let view = VIEW.replace("passes = 4", "passes = 64");
    format!("{view}{FLOOR}{lamps}")
}

/// Light adds up: a picture is the sum of that of the lamp without the ball's shadow and that of the other lamps with
/// it. Significance 1e-4 for each lamp.
#[test]
fn a_lamp_whose_shadow_rays_pass_an_object() {
    let rule = "[[rules]]\nrays = [\"shadow\"]\nexclude = [\"ball\"]\n";
    for (number, name) in ["lamp", "panel", "point", "sky"].into_iter().enumerate() {
        let linked = format!("{}{rule}on = [\"{name}\"]\n", lit(|_| true));
        different(&linked, &lit(|_| true));
        let linked = scene(&linked);
        assert_eq!(linked.description().notes, Vec::<String>::new());
        let linked = blocks(&linked, 8);
        let alone = blocks(&scene(&format!("{}{rule}", lit(|n| n == number))), 8);
        let others = blocks(&scene(&lit(|n| n != number)), 8);
        let mut suite = Suite::new(1e-4);
        for i in 0..linked.blocks.len() * 3 {
            let [whole, alone, others] = [&linked, &alone, &others].map(|picture| &picture.blocks[i / 3][i % 3]);
            let off = (whole.mean() - alone.mean() - others.mean()).abs();
            // Sums in single precision are not exact.
            let off = (off - 1e-5 * whole.mean()).max(0.0);
            let parts = alone.std_error().hypot(others.std_error());
            suite.p_value(
                format!(
                    "{name}, value {i}: {:.5} ± {:.5}, expected {:.5} ± {parts:.5}",
                    whole.mean(),
                    whole.std_error(),
                    alone.mean() + others.mean(),
                ),
                two_sided(off / whole.std_error().hypot(parts).hypot(1e-7)),
            );
        }
        suite.finish();
    }
}

#[test]
fn only_lights_that_are_named_have_shadow_rules_of_their_own() {
    let plain = lit(|_| true).replace("passes = 64", "passes = 4");
    let rule = "[[rules]]\nrays = [\"shadow\"]\n";
    // All of them, selected once by where the rays start and once by where they go.
    different(
        &format!("{plain}{rule}except = [\"floor\"]\nexclude = [\"ball\"]\n"),
        &format!("{plain}{rule}exclude = [\"ball\"]\n"),
    );
    // A light blocks nothing.
    let nothing = scene(&format!("{plain}{rule}on = [\"point\"]\nexclude = [\"sky\"]\n"));
    assert_eq!(nothing.description().notes.len(), 1);
    assert!(nothing.description().notes[0].contains("no shadow rays start there"));
    same_bits(&format!("{plain}{rule}on = [\"point\"]\nexclude = [\"sky\"]\n"), &plain);
    // Include: only what is listed blocks.
    different(
        &format!("{plain}{rule}on = [\"point\"]\ninclude = [\"floor\"]\n"),
        &plain,
    );
}

/// A lamp that neither shadow rays nor photons see lights nothing, even next to a sky that camera paths meet behind
/// glass: its layer is black, and the picture is the one without it.
#[test]
fn a_lamp_that_nothing_sees_lights_nothing() {
    let room = r#"
[materials.white]
type = "diffuse"
reflectance = 0.8
two_sided = true
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "rectangle"
material = "white"
transform = [{ scale = 3 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[shapes]]
type = "rectangle"
material = "white"
transform = [{ scale = 3 }, { translate = [0, 0, -2] }]
[[shapes]]
type = "sphere"
center = [0, 0.7, 0]
radius = 0.5
material = "glass"
[[lights]]
name = "sky"
type = "environment"
radiance = 0.05
"#;
    let lamp = "[[lights]]\nname = \"lamp\"\ntype = \"point\"\nposition = [0.5, 3, 0.5]\npower = 2000\n\
                [[rules]]\nrays = [\"shadow\", \"photon\"]\nexclude = [\"lamp\"]\n";
    for caustics in ["", "caustics = \"photons\"", "caustics = \"paths\""] {
        let view = VIEW
            .replace("caustics = \"photons\"", caustics)
            .replace("passes = 4", "passes = 64");
        let with = scene(&format!("{view}{room}{lamp}"));
        let plan = plan_of(&with);
        let mut layers = light_layers(with.description());
        layers.retain(|layer| layer.to_string().contains("lamp"));
        let plan = plan.with_layers(&with, &layers).unwrap();
        for pass_index in 0..8 {
            let image = render_pass(&with, &plan, pass_index).expect("a pass");
            let lit = image.layers[0].pixels.iter().flatten().filter(|value| **value != 0.0);
            assert_eq!(lit.count(), 0, "{caustics}, pass {pass_index}");
        }
        same_means(&format!("{view}{room}{lamp}"), &format!("{view}{room}"), 0.0);
    }
}
