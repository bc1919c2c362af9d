//! Photons in media, which belong to the object that bounds them.

use super::{VIEW, different, same_bits, same_means};

/// A box of fog over a black floor. FOG stands for the fog; some tests put something in front of the light.
const BOX: &str = r#"
[materials.black]
type = "diffuse"
reflectance = 0
[materials.silver]
type = "mirror"
[materials.boundary]
type = "null"
[[shapes]]
name = "floor"
type = "rectangle"
material = "black"
transform = [{ scale = 4 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[shapes]]
name = "box"
type = "cube"
material = "boundary"
interior = "fog"
transform = [{ scale = [1.2, 0.6, 0.6] }, { translate = [0, 0.8, 0] }]
[[lights]]
name = "one"
type = "point"
position = [-2, 3, 2]
intensity = [20, 10, 5]
"#;
const TWO: &str = r#"
[[shapes]]
name = "two"
type = "disc"
emission = { radiance = [10, 20, 40] }
transform = [{ scale = 0.4 }, { look_at = { origin = [2, 2.5, 1], target = [0, 0.8, 0] } }]
[[lights]]
name = "sky"
type = "environment"
radiance = [0.3, 0, 0.3]
[[rules]]
rays = ["camera"]
exclude = ["sky", "two"]
"#;
const THIN: [&str; 2] = [
    "[media.fog]\ntype = \"homogeneous\"\nsigma_a = 0.2\nsigma_s = 0.8\nphase = { type = \"hg\", g = 0.5 }\n",
    "[media.fog]\ntype = \"heterogeneous\"\nsigma_a = 0.2\nsigma_s = 0.8\n\
     density = { min = [-2, 0, -2], max = [2, 2, 2], noise = { size = 0.5 }, voxel = 0.2 }\n",
];

fn view() -> String {
    VIEW.replace("passes = 4", "passes = 48")
        .replace("paths = 400", "paths = 2000")
}

#[test]
fn photons_of_a_light_leave_nothing_in_fog() {
    for fog in THIN {
        let one = format!("{}{BOX}{fog}", view());
        let both = format!("{one}{TWO}");
        different(&both, &one);
        for rule in [
            "on = [\"box\"]\nexclude = [\"two\", \"sky\"]",
            "on = [\"box\"]\ninclude = [\"one\"]",
            "on = [\"two\", \"sky\"]\nexclude = [\"box\"]",
            "on = [\"two\", \"sky\"]\ninclude = [\"floor\"]",
        ] {
            let ruled = format!("{both}[[rules]]\nrays = [\"photon\"]\n{rule}\n");
            same_means(&ruled, &one, 0.01);
        }
        // No light at all: the fog only absorbs.
        let none = format!("{one}[[rules]]\nrays = [\"photon\"]\non = [\"box\"]\nexclude = [\"one\"]\n");
        let pixels = super::pixels(&beamfarm_harness::render::scene(&none));
        assert!(pixels.iter().all(|p| *p == [0.0; 3]));
    }
}

#[test]
fn fog_that_no_photon_sees_still_hides_what_is_behind() {
    let back = "[[shapes]]\nname = \"back\"\ntype = \"rectangle\"\nemission = { radiance = 2 }\n\
                transform = [{ scale = 8 }, { translate = [0, 0, -4] }]\n";
    for fog in THIN {
        let scattering = format!("{}{BOX}{fog}{back}", view());
        let absorbing = scattering
            .replace("sigma_a = 0.2", "sigma_a = 1")
            .replace("sigma_s = 0.8", "sigma_s = 0");
        different(&scattering, &absorbing);
        let rule = "[[rules]]\non = [\"box\"]\nrays = [\"photon\"]\nexclude = [\"one\", \"back\"]\n";
        same_means(&format!("{scattering}{rule}"), &absorbing, 1e-4);
    }
}

#[test]
fn a_box_that_the_camera_does_not_see_has_no_fog_for_it() {
    for fog in THIN {
        let with = format!("{}{BOX}{fog}", VIEW).replace("material = \"black\"", "");
        let rule = "[[rules]]\nrays = [\"camera\"]\nexclude = [\"box\"]\n";
        let without = with.replace("sigma_s = 0.8", "sigma_s = 0");
        let without = without.replace("sigma_a = 0.2", "sigma_a = 1");
        // The floor under it is lit through the fog and seen without it: brighter, at least by what an absorbing box
        // lets through.
        let seen = beamfarm_harness::render::blocks(&beamfarm_harness::render::scene(&format!("{with}{rule}")), 8);
        let less = beamfarm_harness::render::blocks(&beamfarm_harness::render::scene(&format!("{without}{rule}")), 8);
        for (seen, less) in seen.blocks.iter().flatten().zip(less.blocks.iter().flatten()) {
            assert!(seen.mean() >= less.mean() - 4.0 * less.std_error() - 4.0 * seen.std_error());
        }
        // In the box itself, too.
        let inside = |scene: String| scene.replace("origin = [0, 1, 5]", "origin = [0, 1, 0.3]");
        let empty = with.replace("interior = \"fog\"", "interior = \"none\"");
        let (dark, empty) = (without.replace("sigma_a = 1", "sigma_a = 0"), empty);
        same_bits(&inside(format!("{dark}{rule}")), &inside(format!("{empty}{rule}")));
    }
}

/// A mirror throws a shaft of light through fog onto a black ball.
#[test]
fn beams_pass_what_rules_hide() {
    let fog = THIN[0]
        .replace("sigma_s = 0.8", "sigma_s = 0.2")
        .replace("sigma_a = 0.2", "sigma_a = 0.05");
    let without = format!(
        "{}{fog}[world]\nmedium = \"fog\"\n[materials.black]\ntype = \"diffuse\"\nreflectance = 0\n\
         [materials.silver]\ntype = \"mirror\"\n\
         [[shapes]]\nname = \"mirror\"\ntype = \"rectangle\"\nmaterial = \"silver\"\n\
         transform = [{{ scale = 0.6 }}, {{ rotate = {{ axis = [0, 1, 0], angle = 90 }} }}, {{ translate = [-2, 0.7, 0] }}]\n\
         [[lights]]\nname = \"spot\"\ntype = \"spot\"\nposition = [3, 2.7, 0]\ntarget = [-2, 0.9, 0]\nintensity = 100\n\
         cutoff_angle = 5\n",
        view()
    );
    let ball = "[[shapes]]\nname = \"ball\"\ntype = \"sphere\"\nmaterial = \"black\"\ncenter = [-0.9, 0.5, 0]\nradius = 0.38\n";
    let with = format!("{without}{ball}visible = [\"photon\"]\n");
    different(&with, &without);
    let rule = |rule: &str| format!("{with}[[rules]]\nrays = [\"photon\"]\n{rule}\n");
    // All of it; then only what the mirror sends and fog scatters, which is nearly all that the ball blocks.
    same_bits(&rule("exclude = [\"ball\"]"), &without);
    same_bits(
        &rule("on = [\"spot\", \"mirror\", \"world\"]\nexclude = [\"ball\"]"),
        &without,
    );
    same_bits(&rule("except = [\"ball\"]\ninclude = [\"mirror\"]"), &without);
    different(&rule("on = [\"mirror\"]\nexclude = [\"ball\"]"), &with);
}
