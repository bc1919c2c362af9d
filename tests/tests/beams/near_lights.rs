//! Light on surfaces that almost touch the lamp: shadow rays must not mistake the lamp for its own blocker.

use beamfarm_harness::render::{average, scene};
use std::f64::consts::PI;

/// Radiance of one point of a floor at `distance` under a lamp, seen from above through a narrow field of view.
fn radiance_under(lamp: &str, distance: f64) -> f64 {
    let toml = format!(
        r#"
[image]
width = 8
height = 8
[render]
passes = 200
paths = 1
seed = 5
[camera]
origin = [0.5, 0.0, 3e-3]
target = [0.0, 0.0, 0.0]
up = [0.0, 0.0, 1.0]
fov = 0.01
[materials.floor]
type = "diffuse"
reflectance = 0.5
[[shapes]]
type = "rectangle"
transform = [ {{ scale = 40.0 }} ]
material = "floor"
[[shapes]]
{lamp}
emission = {{ radiance = 2.0 }}
"#,
    );
    let image = average(&scene(&toml.replace("DISTANCE", &distance.to_string())));
    let sum: f64 = image.beauty.pixels.iter().map(|p| f64::from(p[1])).sum();
    sum / image.beauty.pixels.len() as f64
}

#[test]
fn floor_under_a_ball() {
    // Centre at `distance` above, radius 0.1: pi L (r / d)^2, times 1 / 2 pi.
    for distance in [0.2, 0.12, 0.11] {
        let lamp = "type = \"sphere\"\ncenter = [0.0, 0.0, DISTANCE]\nradius = 0.1";
        let expected = 0.01 / (distance * distance);
        let got = radiance_under(lamp, distance);
        // 12800 light samples whose weights vary by less than their mean: 3 % is more than 3 standard errors.
        assert!((got / expected - 1.0).abs() < 0.03, "{distance}: {got}");
    }
}

#[test]
fn floor_under_a_panel() {
    for distance in [0.1, 0.03, 0.01] {
        let lamp = "type = \"disc\"\ntransform = [ { scale = 0.1 }, \
                    { rotate = { axis = [1, 0, 0], angle = 180 } }, { translate = [0, 0, DISTANCE] } ]";
        let expected = 0.01 / (0.01 + distance * distance);
        let got = radiance_under(lamp, distance);
        assert!((got / expected - 1.0).abs() < 0.03, "{distance}: {got}");
    }
}

#[test]
fn floor_under_a_square_of_triangles() {
    for distance in [0.1f64, 0.03, 0.01] {
        let lamp = "type = \"rectangle\"\ntransform = [ { scale = 0.1 }, \
                    { rotate = { axis = [1, 0, 0], angle = 180 } }, { translate = [0, 0, DISTANCE] } ]";
        // Four quarters with a corner on the axis (Howell, configuration factor B-3).
        let x = 0.1 / distance;
        let s = (1.0 + x * x).sqrt();
        let expected = 4.0 * 2.0 * (x / s) * libm::atan2(x, s) / (2.0 * PI);
        let got = radiance_under(lamp, distance);
        assert!((got / expected - 1.0).abs() < 0.03, "{distance}: {got}");
    }
}
