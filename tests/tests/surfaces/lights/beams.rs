//! Light that leaves a lamp in few directions: every technique finds what the path tracer finds.

use crate::surfaces::lights::setup::{PATHS, PHOTONS, found_once};
use beamfarm_harness::render::scene;

/// A room of fog, with lamps next to the camera's lines of sight.
fn room(lamps: &str) -> String {
    format!(
        r#"
[image]
width = 16
height = 16
[render]
passes = 1200
paths = 3000
radius = 0.04
[camera]
origin = [0.0, 0.0, 0.9]
target = [0.0, 0.0, 0.0]
fov = 80.0
[world]
medium = "fog"
[media.fog]
type = "homogeneous"
sigma_a = 0.1
sigma_s = [0.9, 0.7, 0.5]
phase = {{ type = "hg", g = 0.4 }}
[materials.wall]
type = "diffuse"
reflectance = [0.7, 0.6, 0.5]
[[shapes]]
type = "cube"
flip_normals = true
material = "wall"
[[shapes]]
type = "sphere"
center = [0.5, -0.5, -0.4]
radius = 0.3
material = "wall"
{lamps}
"#
    )
}

#[test]
fn lasers_are_found_once() {
    let lamps = "[[lights]]\ntype = \"laser\"\nposition = [-0.8, 0.6, -0.5]\ntarget = [0.5, -0.4, -0.4]\nradius = 0.2\n\
        power = [3, 2, 1]\n[[lights]]\ntype = \"laser\"\nposition = [0.6, 0.9, -0.6]\ndirection = [-0.4, -1, 0.2]\n\
        radius = 0.15\nirradiance = 6\nprofile = \"gaussian\"\n";
    found_once(&scene(&room(lamps)), &[[PHOTONS; 3], [PATHS; 3]], 480);
}

/// On both sides; with a checkerboard, and stretched.
#[test]
fn spreads_are_found_once() {
    let lamps = "[[shapes]]\ntype = \"rectangle\"\n\
        transform = [{ scale = 0.3 }, { rotate = { axis = [1, 0, 0], angle = 80 } }, { translate = [-0.2, 0.2, -0.2] }]\n\
        emission = { radiance = { checkerboard = [[6, 2, 2], [0, 2, 4]] }, two_sided = true, spread = 80 }\n\
        [[shapes]]\ntype = \"disc\"\n\
        transform = [{ scale = [0.2, 0.1, 1] }, { rotate = { axis = [0, 1, 0], angle = 90 } }, { translate = [-0.95, 0, 0] }]\n\
        emission = { power = 4, spread = 50 }\n";
    found_once(&scene(&room(lamps)), &[[PHOTONS; 3], [PATHS; 3]], 480);
}
