//! Media of optical depth 1e4.

use beamfarm_harness::render::{plan_of, scene};
use beamfarm_render::cpu::pass::render_pass;

/// A ball that fills the picture, under a sky of radiance 1.
fn ball(sigma_a: f64, sigma_s: f64) -> String {
    format!(
        r#"
[image]
width = 8
height = 8
[render]
paths = 500
seed = 5
[camera]
origin = [0.0, 0.0, 4.0]
target = [0.0, 0.0, 0.0]
fov = 15.0
[media.ink]
type = "homogeneous"
sigma_a = {sigma_a}
sigma_s = {sigma_s}
[materials.boundary]
type = "null"
[[shapes]]
type = "sphere"
center = [0, 0, 0]
radius = 1
material = "boundary"
interior = "ink"
[[lights]]
type = "environment"
radiance = 1.0
"#
    )
}

#[test]
fn ink_is_black() {
    for (sigma_a, sigma_s) in [(1e4, 0.0), (1e4, 1e-2)] {
        let scene = scene(&ball(sigma_a, sigma_s));
        let plan = plan_of(&scene);
        for pass_index in [0, 1, 1000, 1_000_000] {
            let image = render_pass(&scene, &plan, pass_index).expect("a pass");
            // A half space reflects less than its albedo.
            let limit = (2.0 * sigma_s / sigma_a) as f32;
            let brightest = image.film.pixels.iter().flatten().fold(0.0, |m: f32, v| m.max(*v));
            assert_eq!(image.stats.non_finite, 0);
            let mean: f32 = image.film.pixels.iter().flatten().sum::<f32>() / 192.0;
            assert!(mean <= limit, "{mean}, at most {brightest}");
        }
    }
}

/// Light enters and leaves through a skin of 1e-4: photons must not wander in there for ever.
#[test]
fn milk_costs_few_beams() {
    let scene = scene(&ball(0.0, 1e4));
    let plan = plan_of(&scene);
    for pass_index in [0, 1000] {
        let image = render_pass(&scene, &plan, pass_index).expect("a pass");
        assert_eq!(image.stats.non_finite, 0);
        // There may be no photons at all.
        let beams = image.stats.beams as f64 / image.stats.paths.max(1) as f64;
        assert!(beams < 60.0, "{beams} beams a path");
    }
}
