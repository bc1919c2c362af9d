//! Pictures do not depend on the unit of length, nor on what is far away and unseen.

use beamfarm_harness::Suite;
use beamfarm_harness::render::{Blocks, blocks, blur, scene};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;

/// Glass, frosted glass, milk and thin smoke on a floor, a lamp, and more. Lengths times `unit`.
fn still_life(unit: f64, passes: u32, seed: u32, more: &str) -> Scene {
    let floor = 2.0 * unit;
    let per_unit = |sigma: f64| sigma / unit;
    let (thin, dense, at) = (per_unit(0.4), per_unit(20.0), |x: f64| x * unit);
    scene(&format!(
        r#"
[image]
width = 24
height = 24
[render]
passes = {passes}
paths = 4000
seed = {seed}
[camera]
origin = [0.0, {y}, {z}]
target = [0.0, {aim}, 0.0]
fov = 40.0
[media.smoke]
type = "homogeneous"
sigma_t = {thin}
albedo = [0.9, 0.8, 0.7]
[media.milk]
type = "homogeneous"
sigma_t = {dense}
albedo = [0.95, 0.9, 0.8]
[materials.floor]
type = "diffuse"
[materials.black]
type = "diffuse"
reflectance = 0.0
[materials.boundary]
type = "null"
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.frosted]
type = "rough_dielectric"
alpha = 0.05
ior = 1.5
[[shapes]]
type = "disc"
material = "floor"
transform = [{{ scale = {floor} }}, {{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}]
[[shapes]]
type = "cube"
material = "boundary"
interior = "smoke"
transform = [{{ scale = {smoke} }}, {{ translate = [0.0, {smoke_at}, 0.0] }}]
[[shapes]]
type = "sphere"
center = [{right}, {low}, {low}]
radius = {small}
material = "glass"
exterior = "smoke"
[[shapes]]
type = "sphere"
center = [{left}, {low}, {low}]
radius = {small}
material = "frosted"
exterior = "smoke"
[[shapes]]
type = "sphere"
center = [0.0, {low}, {back}]
radius = {small}
material = "boundary"
interior = "milk"
exterior = "smoke"
[[shapes]]
type = "rectangle"
emission = {{ radiance = [9.0, 8.0, 7.0] }}
transform = [{{ scale = {lamp} }}, {{ rotate = {{ axis = [1, 0, 0], angle = 90 }} }}, {{ translate = [0.0, {high}, 0.0] }}]
{more}
"#,
        y = at(1.2),
        z = at(3.6),
        aim = at(0.5),
        smoke = at(0.99),
        smoke_at = at(1.0),
        right = at(0.45),
        left = at(-0.45),
        low = at(0.35),
        back = at(-0.4),
        small = at(0.3),
        lamp = at(0.5),
        high = at(2.4),
    ))
}

/// Two pictures are the same, with little enough noise to tell.
fn same(what: &str, a: &Blocks, b: &Blocks, suite: &mut Suite) {
    suite.same_blocks(what, a, b, 0.0);
    assert!(a.noise(b) < 0.01 * blur(), "{what}: {}", a.noise(b));
}

/// Significance 1e-2 for all units together.
#[test]
fn the_unit_of_length_does_not_matter() {
    let metres = still_life(1.0, 120, 1, "");
    let expected = blocks(&metres, 8);
    let mut suite = Suite::new(1e-2);
    for (seed, unit) in [(2, 1e-3), (3, 1e3)] {
        let scene = still_life(unit, 120, seed, "");
        let found = blocks(&scene, 8);
        same(&format!("unit {unit}"), &found, &expected, &mut suite);
        let estimators = |scene: &Scene| {
            let settings = scene.description().defaults.job_settings();
            let estimators = RenderPlan::new(scene, settings).estimators;
            (estimators.media, estimators.surfaces)
        };
        assert_eq!(estimators(&scene), estimators(&metres));
    }
    suite.finish();
}

/// A black plane a thousand times as large beneath it all, and a black dome far away. Significance 1e-2 for both.
#[test]
fn what_is_black_and_far_away_does_not_matter() {
    let expected = blocks(&still_life(1.0, 120, 1, ""), 8);
    let plane = "[[shapes]]\ntype = \"rectangle\"\nmaterial = \"black\"\ntransform = [{ scale = 2000 }, { rotate = { axis = [1, 0, 0], \
                 angle = -90 } }, { translate = [0, -0.1, 0] }]";
    let dome = "[[shapes]]\ntype = \"sphere\"\nmaterial = \"black\"\nradius = 1000\nflip_normals = true";
    let mut suite = Suite::new(1e-2);
    for (what, seed, more) in [("plane", 2, plane), ("dome", 3, dome)] {
        let found = blocks(&still_life(1.0, 120, seed, more), 8);
        same(what, &found, &expected, &mut suite);
    }
    suite.finish();
}
