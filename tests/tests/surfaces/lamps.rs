//! Lamps that rays pass, like Blender's: surfaces that are nothing but lights.

use beamfarm_harness::differential::{Effort, examine};
use beamfarm_harness::render::{plan_of, scene};
use beamfarm_harness::{MeanEstimate, Suite};
use beamfarm_render::cpu::pass::render_pass;

/// A lamp as large as the floor close below it, and a ball of metal.
fn room(lamp: &str, more: &str) -> String {
    format!(
        r#"
[image]
width = 24
height = 16
[render]
media = "paths"
[camera]
origin = [0, 0.3, 3]
target = [0, 0.12, 0]
fov = 40
[materials.paint]
type = "diffuse"
reflectance = 0.6
two_sided = true
[materials.metal]
type = "rough_conductor"
preset = "copper"
alpha = 0.3
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.lamp]
{lamp}
[[shapes]]
type = "rectangle"
material = "paint"
transform = [{{ scale = 1.5 }}, {{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}]
[[shapes]]
type = "rectangle"
material = "lamp"
boundary = false
emission = {{ radiance = [3, 2, 1] }}
transform = [{{ scale = 1.4 }}, {{ rotate = {{ axis = [1, 0, 0], angle = 90 }} }}, {{ translate = [0, 0.5, 0] }}]
[[shapes]]
type = "sphere"
material = "metal"
center = [0.4, 0.2, 0.3]
radius = 0.2
{more}
"#
    )
}

/// Whether the path passes the lamp or not, meeting it and sampling it are combined by MIS: the same light, with noise
/// of the same size. Samples alone would have more than five times the variance.
#[test]
fn lamps_that_are_passed_are_as_quiet_as_others() {
    let found = |lamp: &str| {
        let room = scene(&room(lamp, ""));
        let plan = plan_of(&room);
        let mut pixels = vec![MeanEstimate::new(); 24 * 16];
        let mut whole = MeanEstimate::new();
        for pass in 0..48 {
            let film = render_pass(&room, &plan, pass).expect("a pass").film;
            let mut sum = 0.0;
            for (pixel, value) in pixels.iter_mut().zip(&film.pixels) {
                pixel.add(f64::from(value[0]));
                sum += f64::from(value[0]);
            }
            whole.add(sum / pixels.len() as f64);
        }
        let variance = pixels.iter().map(|p| p.std_error() * p.std_error()).sum::<f64>();
        (whole, variance)
    };
    let [(passed, noise), (solid, least)] = ["type = \"null\"", "type = \"diffuse\"\nreflectance = 0"].map(found);
    let mut suite = Suite::new(1e-3);
    suite.same_mean("the mean", &passed, &solid);
    suite.finish();
    assert!(noise < 1.5 * least, "{noise} {least}");
}

/// In fog, in front of and behind glass, next to a second lamp that is seen through the first.
#[test]
fn lamps_that_are_passed_are_right() {
    let more = r#"
[media.fog]
type = "homogeneous"
sigma_a = 0.1
sigma_s = [0.4, 0.3, 0.2]
[world]
medium = "fog"
[[shapes]]
type = "sphere"
material = "glass"
center = [-0.5, 0.2, 0.3]
radius = 0.18
[[shapes]]
type = "sphere"
material = "lamp"
center = [0.2, 0.75, -0.4]
radius = 0.2
emission = { radiance = [2, 6, 9] }
"#;
    let effort = Effort {
        images: 64,
        samples: 8,
        significance: 1e-3,
        seconds: 60.0,
    };
    let verdict = examine(&scene(&room("type = \"null\"", more)), &effort);
    assert!(!verdict.is_fault() && verdict.is_settled(), "{verdict}");
}

/// Two lamps in one plane, and a lamp in the plane of a ceiling, give as much light as with a hair's gap between them,
/// although a ray meets only one of two things at the same place. Left as they are, a quarter of the light of two lamps
/// would be missing, and half of that of the one in the ceiling.
#[test]
fn lamps_at_the_place_of_something_else_give_all_their_light() {
    let second = |height: f32| {
        format!(
            r#"
[[shapes]]
type = "rectangle"
material = "lamp"
boundary = false
emission = {{ radiance = [1, 2, 3] }}
transform = [{{ scale = 1.2 }}, {{ rotate = {{ axis = [1, 0, 0], angle = 90 }} }}, {{ translate = [0.1, {height}, 0] }}]
"#
        )
    };
    let ceiling = |height: f32| {
        format!(
            r#"
[[shapes]]
type = "rectangle"
material = "paint"
transform = [{{ scale = 2 }}, {{ rotate = {{ axis = [1, 0, 0], angle = 90 }} }}, {{ translate = [0, {height}, 0] }}]
"#
        )
    };
    let found = |more: &str| {
        let room = scene(&room("type = \"null\"", more));
        let plan = plan_of(&room);
        let mut whole = MeanEstimate::new();
        for pass in 0..64 {
            let film = render_pass(&room, &plan, pass).expect("a pass").film;
            whole.add(film.pixels.iter().map(|value| f64::from(value[0])).sum::<f64>() / film.pixels.len() as f64);
        }
        whole
    };
    let mut suite = Suite::new(1e-3);
    suite.same_mean("two lamps", &found(&second(0.5)), &found(&second(0.4998)));
    suite.same_mean("a lamp in the ceiling", &found(&ceiling(0.5)), &found(&ceiling(0.5002)));
    suite.finish();
}
