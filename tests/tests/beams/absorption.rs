//! Direct light through media that only absorb: Lambert's law over the whole path.

use beamfarm_harness::render::{average, scene};
use std::f64::consts::PI;

/// Optical depth from the lamp to the floor: a relative error of 1e-4 in the length is one of 3e-3 in the light.
const SIGMA_A: f64 = 30.0;

/// A point of a floor at distance 1 below a point light, in ink, seen from the side. Nothing is random here.
#[test]
fn light_is_absorbed_all_the_way_from_the_lamp() {
    let boundary = r#"
[materials.boundary]
type = "null"
[[shapes]]
type = "sphere"
center = [0.0, 0.0, 0.5]
radius = 0.3
material = "boundary"
interior = "ink"
"#;
    for (name, rest) in [("one stretch", ""), ("past boundaries", boundary)] {
        let toml = format!(
            r#"
[image]
width = 2
height = 2
[render]
passes = 1
paths = 1
[world]
medium = "ink"
[camera]
origin = [0.1, 0.0, 0.1]
target = [0.0, 0.0, 0.0]
up = [0.0, 0.0, 1.0]
fov = 1e-4
[media.ink]
type = "homogeneous"
sigma_a = {SIGMA_A}
sigma_s = 0.0
[materials.floor]
type = "diffuse"
reflectance = 0.5
[[shapes]]
type = "rectangle"
material = "floor"
[[lights]]
type = "point"
position = [0.0, 0.0, 1.0]
intensity = 1.0
{rest}
"#
        );
        let seen_from = libm::hypot(0.1, 0.1);
        let expected = 0.5 / PI * libm::exp(-SIGMA_A * (1.0 + seen_from));
        for pixel in average(&scene(&toml)).beauty.pixels {
            let ratio = f64::from(pixel[0]) / expected;
            assert!((ratio - 1.0).abs() < 5e-4, "{name}: {ratio}");
        }
    }
}
