//! Surfaces that are diffuse on both sides, against closed forms.

use beamfarm_harness::Suite;
use beamfarm_harness::render::{Blocks, blocks, blur, reference_images, scene};
use beamfarm_image::job::ReferenceSettings;
use std::f64::consts::PI;

/// A lamp in a paper ball: inside, light is reflected again and again, as in an integrating sphere, so the ball emits
/// the share t / (1 - r) of it, as evenly as a Lambertian source. By passes and by the path tracer.
#[test]
fn a_ball_of_paper_is_an_integrating_sphere() {
    let ball = scene(
        r#"
[image]
width = 8
height = 8
[render]
passes = 64
paths = 20000
[camera]
origin = [0, 0, 6]
target = [0, 0, 0]
projection = "orthographic"
view_width = 1
[materials.paper]
type = "translucent"
reflectance = [0.3, 0.5, 0.1]
transmittance = [0.4, 0.5, 0.2]
[[shapes]]
type = "sphere"
material = "paper"
[[lights]]
type = "point"
position = [0.3, 0.1, -0.2]
power = 10
"#,
    );
    assert!(ball.description().notes.is_empty());
    let mut suite = Suite::new(1e-2);
    let settings = ReferenceSettings {
        seed: 7,
        max_depth: None,
    };
    let reference = Blocks::new(reference_images(&ball, settings, 40, 64), 8);
    for (name, found) in [("passes", blocks(&ball, 8)), ("paths", reference)] {
        for (channel, (r, t)) in [(0.3, 0.4), (0.5, 0.5), (0.1, 0.2)].into_iter().enumerate() {
            // The lamp is off the middle, so the first light on the inside and its transmission are uneven; on the
            // visible disc it is this share of even light. All later light is even.
            let first = first_light();
            let even = 10.0 / (4.0 * PI);
            let expected = t * (first + even * r / (1.0 - r)) / PI;
            let mean = &found.blocks[0][channel];
            suite.mean_within(format!("{name}, {channel}"), mean, expected, 1e-4);
            assert!(
                mean.std_error() < 0.03 * blur() * expected,
                "{name}: {}",
                mean.std_error()
            );
        }
    }
    suite.finish();
}

/// Mean irradiance from the lamp, W/m^2, over the visible part of the ball: the square [-1/2, 1/2]^2 along z.
fn first_light() -> f64 {
    let side = 400;
    let at = |i: usize| (i as f64 + 0.5) / side as f64 - 0.5;
    let mut sum = 0.0;
    for (x, y) in (0..side).flat_map(|i| (0..side).map(move |j| (at(i), at(j)))) {
        let z = (1.0 - x * x - y * y).sqrt();
        let d = [x - 0.3, y - 0.1, z + 0.2];
        let square = d.iter().map(|d| d * d).sum::<f64>();
        let cos = (d[0] * x + d[1] * y + d[2] * z) / square.sqrt();
        sum += 10.0 / (4.0 * PI) * cos / square;
    }
    sum / (side * side) as f64
}
