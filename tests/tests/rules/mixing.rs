//! Gather rays and photons share the light between surfaces: rules for some of them leave it whole.

use super::{VIEW, different, same_means};

/// A lit wall, a floor that sees the wall, and a black screen between them that takes no light from the wall.
const ROOM: &str = r#"
[materials.white]
type = "diffuse"
reflectance = 0.8
[materials.dim]
type = "diffuse"
reflectance = 0.1
[materials.black]
type = "diffuse"
reflectance = 0
two_sided = true
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
name = "floor"
type = "rectangle"
material = "dim"
transform = [{ scale = 5 }, { rotate = { axis = [1, 0, 0], angle = -90 } }]
[[shapes]]
name = "wall"
type = "rectangle"
material = "white"
transform = [{ scale = [2, 1, 1] }, { rotate = { axis = [0, 1, 0], angle = 90 } }, { translate = [-2, 1.2, 0] }]
[[shapes]]
name = "marble"
type = "sphere"
center = [3, 0.3, -3]
radius = 0.2
material = "glass"
[[shapes]]
name = "one"
type = "sphere"
center = [4, 0.3, -3]
radius = 0.1
[[shapes]]
name = "two"
type = "sphere"
center = [4, 0.3, -4]
radius = 0.1
[[shapes]]
name = "three"
type = "sphere"
center = [4, 0.3, -3.5]
radius = 0.1
[[lights]]
name = "sun"
type = "directional"
direction = [-1, 0, 0]
irradiance = 3
"#;

const SCREEN: &str = r#"
[[shapes]]
name = "screen"
type = "rectangle"
material = "black"
transform = [{ scale = [0.8, 1.5, 1] }, { rotate = { axis = [1, 0, 0], angle = -90 } }, { translate = [-1.1, 0.45, 0] }]
"#;

fn view() -> String {
    VIEW.replace("passes = 4", "passes = 24")
        .replace("paths = 400", "paths = 20000\nradius = 0.08")
        .replace("origin = [0, 1, 5]", "origin = [0, 4, 2.5]")
        .replace("target = [0, 0.7, 0]", "target = [-0.4, 0, 0]")
}

/// Gather rays pass the screen if most photons do. Here most do not; those of the floor and the wall do.
#[test]
fn light_comes_from_walls_whose_photons_have_rules_of_their_own() {
    let without = format!("{}{ROOM}", view());
    let with = format!("{without}{SCREEN}visible = [\"shadow\", \"photon\"]\n");
    different(&with, &without);
    let rule = |rule: &str| format!("{with}[[rules]]\nrays = [\"photon\"]\n{rule}\n");
    for on in [
        "on = [\"wall\", \"floor\"]",
        "on = [\"all\"]",
        "except = [\"one\", \"two\", \"three\", \"screen\"]",
    ] {
        same_means(&rule(&format!("{on}\nexclude = [\"screen\"]")), &without, 0.02);
    }
}

/// Photons of a light that a floor excludes are not seen on the floor, but still light the wall through it.
#[test]
fn a_floor_lights_others_by_what_it_does_not_show() {
    let lamp =
        "[[lights]]\nname = \"lamp\"\ntype = \"spot\"\nposition = [1.5, 4, 0]\ntarget = [-0.6, 0, 0]\nintensity = 30\n";
    let plain = format!("{}{ROOM}{lamp}", view())
        .replace("reflectance = 0.1", "reflectance = 0.7")
        .replace("origin = [0, 4, 2.5]", "origin = [4, 1.2, 0]")
        .replace("target = [-0.4, 0, 0]", "target = [-2, 1.2, 0]")
        .replace("fov = 40", "fov = 17");
    let ruled = format!("{plain}[[rules]]\non = [\"floor\"]\nrays = [\"photon\"]\nexclude = [\"lamp\", \"sun\"]\n");
    // Only the wall is in the picture.
    same_means(&ruled, &plain, 0.02);
}

/// Gloss and shadow rules: combining light and BSDF sampling hides the same things as light sampling alone.
#[test]
fn linked_gloss_is_that_of_a_scene_with_fewer_lights() {
    let gloss = "[materials.satin]\ntype = \"rough_conductor\"\nalpha = 0.15\npreset = \"silver\"\n\
                 [[shapes]]\nname = \"satin\"\ntype = \"rectangle\"\nmaterial = \"satin\"\n\
                 transform = [{ scale = 2 }, { rotate = { axis = [1, 0, 0], angle = -90 } }, { translate = [0, 0.01, 0] }]\n\
                 [[shapes]]\nname = \"big\"\ntype = \"rectangle\"\nemission = { radiance = 2 }\n\
                 transform = [{ scale = [3, 1, 1] }, { translate = [0, 1.2, -3] }]\n";
    let other = "[[shapes]]\nname = \"other\"\ntype = \"sphere\"\nemission = { radiance = 4 }\ncenter = [1, 1, -1]\nradius = 0.4\n";
    let one = format!("{}{gloss}", view());
    let both = format!("{one}{other}visible = [\"shadow\"]\n");
    different(&both, &one);
    let ruled = format!("{both}[[rules]]\non = [\"satin\"]\nrays = [\"shadow\"]\nexclude = [\"other\"]\n");
    same_means(&ruled, &one, 1e-4);
}
