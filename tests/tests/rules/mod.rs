//! Object visibility rules: each changes the picture as removing things by hand does.

mod coats;
pub mod golden;
mod media;
mod mixing;
mod reference;
mod shadows;
mod views;

use beamfarm_harness::Suite;
use beamfarm_harness::render::{blocks, scene};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;

/// The pixels of several passes, one after the other.
fn pixels(scene: &Scene) -> Vec<[f32; 3]> {
    let defaults = scene.description().defaults;
    let plan = RenderPlan::new(scene, defaults.job_settings());
    let passes = 0..defaults.passes;
    passes
        .flat_map(|pass_index| render_pass(scene, &plan, pass_index).expect("a pass").film.pixels)
        .collect()
}

/// The pictures have the same bits and are not black.
#[track_caller]
fn same_bits(one: &str, other: &str) {
    let (one, other) = (scene(one), scene(other));
    let (a, b) = (pixels(&one), pixels(&other));
    assert!(a.iter().flatten().any(|x| *x > 0.0), "black");
    let differ = a.iter().zip(&b).filter(|(a, b)| a != b).count();
    assert_eq!(differ, 0, "of {} pixels", a.len());
}

#[track_caller]
fn different(one: &str, other: &str) {
    assert!(pixels(&scene(one)) != pixels(&scene(other)), "the same pictures");
}

/// Means over blocks of 8 x 8 pixels are the same at a significance of 1e-4 for all of them together, apart from a
/// relative `bias`.
#[track_caller]
fn same_means(one: &str, other: &str, bias: f64) {
    let [one, other] = [one, other].map(|text| blocks(&scene(text), 8));
    let mut suite = Suite::new(1e-4);
    suite.same_blocks("both", &one, &other, bias);
    suite.finish();
}

/// A picture of 24 x 16 pixels from the front.
const VIEW: &str = r#"
[image]
width = 24
height = 16
[render]
passes = 4
paths = 400
seed = 5
# Without rules both would bring them.
caustics = "photons"
[camera]
origin = [0, 1, 5]
target = [0, 0.7, 0]
fov = 40
"#;
