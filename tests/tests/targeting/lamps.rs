//! At which of many lamps photons start.

use super::{noise, passes, same};
use beamfarm_harness::render::{plan_of, scene};
use beamfarm_render::world::Scene;

/// A room with a lamp in a glass globe above the camera, so that all its light comes by photons, and seven unseen rooms
/// like it with equally strong lamps.
fn rooms(targeting: &str) -> Scene {
    let room = |i: usize| {
        let x = 3.0 * i as f32;
        format!(
            r#"
[[shapes]]
type = "cube"
material = "wall"
flip_normals = true
transform = [{{ translate = [{x}, 0, 0] }}]
[[shapes]]
type = "sphere"
center = [{x}, 0.4, -0.2]
radius = 0.2
material = "glass"
[[shapes]]
name = "lamp {i}"
type = "sphere"
center = [{x}, 0.4, -0.2]
radius = 0.1
material = "wall"
emission = {{ radiance = [8.0, 6.0, 4.0] }}
"#
        )
    };
    let rooms: String = (0..8).map(room).collect();
    scene(&format!(
        r#"
[image]
width = 16
height = 16
[render]
passes = 24
paths = 4000
radius = 0.25
targeting = "{targeting}"
[camera]
origin = [0.0, -0.3, 0.9]
target = [0.0, -0.7, 0.0]
fov = 80.0
[materials.wall]
type = "diffuse"
reflectance = [0.6, 0.5, 0.4]
[materials.glass]
type = "dielectric"
ior = 1.5
{rooms}
"#
    ))
}

/// Photons start at the lamp that is seen. The picture is that of lamps chosen by power, with less noise.
#[test]
fn lamps_that_are_seen_get_more_photons() {
    let (off, auto) = (rooms("off"), rooms("auto"));
    let chosen = plan_of(&auto);
    let told = chosen.to_string();
    let emitters = chosen.targets.as_ref().and_then(|t| t.emitters()).unwrap();
    assert!(told.contains("\"lamp 0\" gets"), "{told}");
    let total: f32 = (0..8).map(|light| emitters.pmf(light)).sum();
    assert!((total - 1.0).abs() < 1e-6, "{total}");
    assert!(emitters.pmf(0) > 0.5, "{}", emitters.pmf(0));
    for hidden in 1..8 {
        let by_power = 1.0 / 8.0;
        let pmf = emitters.pmf(hidden);
        assert!(pmf > 0.49 * by_power && pmf < 0.51 * by_power, "{pmf}");
    }
    let (before, after) = (passes(&off, &plan_of(&off)), passes(&auto, &chosen));
    same("lamps", &after, &before);
    let noise = noise(&after, &before);
    println!("lamps: {noise:.3} times the variance");
    assert!(noise < 0.5, "{noise} times the variance");
}

/// Choosing from where the camera saw another lamp than it does now leaves the picture the same.
#[test]
fn a_wrong_choice_of_lamps_loses_no_light() {
    let looks_away = |targeting: &str, room: f32| {
        let mut description = rooms(targeting).description().clone();
        description.camera.position.x += 3.0 * room;
        Scene::new(description)
    };
    let (off, elsewhere) = (looks_away("off", 0.0), looks_away("on", 3.0));
    let mut ignorant = plan_of(&off);
    ignorant.targets = plan_of(&elsewhere).targets;
    let emitters = ignorant.targets.as_ref().and_then(|t| t.emitters()).unwrap();
    assert!(emitters.pmf(0) < 0.1 && emitters.pmf(3) > 0.4);
    same("lamps", &passes(&off, &ignorant), &passes(&off, &plan_of(&off)));
}
