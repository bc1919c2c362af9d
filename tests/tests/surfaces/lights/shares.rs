//! Photons go to lights by their possible contribution to the picture: neither an endless ground nor much stronger
//! lights take them from a small lamp.

use beamfarm_harness::Suite;
use beamfarm_harness::render::{blocks, scene};

/// A lamp over a glass ball, under an even sky, on a ground of this size.
fn on_a_ground(size: f32) -> String {
    format!(
        r#"
[image]
width = 32
height = 32
[render]
passes = 128
paths = 8000
radius = 0.02
[camera]
origin = [0.2, 1.6, 2.2]
target = [-0.35, 0.0, -0.1]
fov = 30.0
[materials.floor]
type = "diffuse"
reflectance = 0.5
two_sided = true
[materials.glass]
type = "dielectric"
ior = 1.57
[[shapes]]
type = "rectangle"
transform = [{{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}, {{ scale = {size} }}]
material = "floor"
[[shapes]]
type = "sphere"
center = [-0.45, 0.56, -0.045]
radius = 0.186
material = "glass"
[[shapes]]
type = "rectangle"
transform = [{{ scale = 0.08 }}, {{ rotate = {{ axis = [1, 0, 0], angle = 90 }} }}, {{ translate = [0.0, 2.2, 0.2] }}]
emission = {{ radiance = 55.0 }}
[[lights]]
type = "environment"
radiance = 0.5
"#
    )
}

/// Significance 1e-3 for all blocks of all pictures. A larger ground reflects little more onto the ball: it lies below
/// the horizon of everything visible.
#[test]
fn the_ground_takes_no_photons_from_a_lamp() {
    let mut suite = Suite::new(1e-3);
    let [near, far, farther] = [10.0, 100.0, 10_000.0].map(|size| blocks(&scene(&on_a_ground(size)), 8));
    suite.same_blocks("100", &far, &near, 5e-3);
    suite.same_blocks("10,000", &farther, &near, 5e-3);
    suite.finish();
    for picture in [&near, &far, &farther] {
        assert!(picture.noise(&near) < 0.02, "{}", picture.noise(&near));
    }
}
