//! Soft falloff: 1 / (d^2 + r^2) times the intensity, also in and near the lamp.

use super::setup::{BOUNDS, PATHS, PHOTONS, RADIANCE, SIGNIFICANCE, ball, emitter, found_once, of_ball, spot};
use beamfarm_harness::render::scene;
use beamfarm_harness::{MeanEstimate, Suite};
use beamfarm_render::math::{Ray, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::geometry::Object;
use beamfarm_render::world::light::{EmissionUniforms, Light, LightHit, LightKind, LightPoint, Ramp, SoftBall};
use std::f64::consts::PI;

const CENTER: Vec3 = Vec3::new(0.3, -0.2, 0.1);
const RADIUS: f32 = 0.4;

/// A ball and a wide spot with soft falloff, and their intensities straight down.
fn lamps() -> [(Vec<Object>, Light, f64); 2] {
    let (objects, mut round) = emitter(ball(CENTER, RADIUS));
    if let LightKind::Area { soft, .. } = &mut round.kind {
        *soft = true;
    }
    let area = PI * f64::from(RADIUS * RADIUS);
    let mut wide = of_ball(spot(CENTER, Vec3::NEG_Z, 88.0, 89.0), RADIUS, Ramp::Smooth);
    if let LightKind::Spot(spot) = &mut wide.kind {
        spot.soft = true;
    }
    let radiance = f64::from(RADIANCE.x);
    [(objects, round, area * radiance), (Vec::new(), wide, radiance)]
}

/// Irradiance facing the lamp, from far away to nearly its middle. The weight of photons and of shadow rays is the
/// ratio of their densities.
#[test]
fn shadow_rays_find_the_light_of_a_disc_that_faces_them() {
    let mut suite = Suite::new(SIGNIFICANCE);
    for (objects, light, intensity) in lamps() {
        for distance in [0.05, 0.3, 0.4, 0.5, 1.0, 5.0_f32] {
            let from = CENTER - Vec3::Z * distance;
            let mut irradiance = MeanEstimate::new();
            for i in 0..20_000 {
                let mut sampler = Sampler::new(2, 0, Purpose::Test, i);
                let (u, more) = light.draw_direct(&objects, &mut sampler);
                let found = light.sample_direct(&objects, from, u, more);
                irradiance.add(found.map_or(0.0, |direct| {
                    let at = LightHit {
                        normal: direct.normal,
                        primitive: 0,
                        distance: direct.distance,
                    };
                    let on = LightPoint {
                        normal: direct.normal,
                        primitive: 0,
                    };
                    let ratio = light.photon_density(&objects, &BOUNDS, from, direct.wi, at);
                    let emitted = light.emitted_density(&objects, &BOUNDS, -direct.wi, on);
                    assert!((ratio * direct.pdf / emitted - 1.0).abs() < 1e-3, "{ratio} {emitted}");
                    f64::from(direct.wi.z * direct.weight.x)
                }));
            }
            let d = f64::from(distance);
            let expected = intensity / (d * d + f64::from(RADIUS * RADIUS));
            suite.mean(format!("{distance}"), &irradiance, expected);
        }
    }
    suite.finish();
}

/// Through a disc below the lamp photons bring what shadow rays find there, also inside the ball.
#[test]
fn photons_start_where_the_light_does() {
    let mut suite = Suite::new(SIGNIFICANCE);
    for (objects, light, intensity) in lamps() {
        // The horizon cuts none of the cones of light.
        for (height, reach) in [(0.16, 0.02), (0.4, 0.2), (0.6, 0.4), (2.0, 2.0_f32)] {
            let radius2 = f64::from(RADIUS * RADIUS);
            const RINGS: i32 = 2000;
            let ring = |i: i32| {
                let (h, across) = (
                    f64::from(height),
                    f64::from(reach) * (f64::from(i) + 0.5) / f64::from(RINGS),
                );
                let d2 = h * h + across * across;
                intensity * h / d2.sqrt() / (d2 + radius2) * 2.0 * PI * across * f64::from(reach) / f64::from(RINGS)
            };
            let expected = (0..RINGS).map(ring).sum::<f64>();
            let lamp = SoftBall {
                center: CENTER,
                radius: RADIUS,
            };
            let mut flux = MeanEstimate::new();
            for i in 0..200_000 {
                let mut sampler = Sampler::new(3, 0, Purpose::Test, i);
                let photon = light.sample_emission(&objects, &BOUNDS, EmissionUniforms::draw(&mut sampler));
                let line = lamp.along(&Ray {
                    origin: photon.origin,
                    dir: photon.dir,
                });
                let foot = line.from_foot.origin;
                let far = (CENTER.z - height - foot.z) / photon.dir.z;
                let on = foot + photon.dir * far - CENTER;
                let meets = photon.dir.z < 0.0 && far >= line.dark(line.half_chord) && on.truncate().length() < reach;
                flux.add(if meets { f64::from(photon.power.x) } else { 0.0 });
            }
            suite.mean(format!("{height}"), &flux, expected);
        }
    }
    suite.finish();
}

/// A lamp half sunk into a floor, with a collar around it and a bead in it, in front of a mirror, behind glass and in
/// fog: photons, camera paths and the path tracer find the same.
#[test]
fn photons_and_paths_find_the_same_around_soft_lamps() {
    let room = |lamp: &str, ball: &str, medium: &str| {
        scene(&format!(
            r#"
[image]
width = 24
height = 16
[camera]
origin = [0, 1, 3]
target = [0, 0.2, 0]
fov = 40
{medium}
[materials.paint]
type = "diffuse"
reflectance = 0.6
two_sided = true
[materials.mirror]
type = "conductor"
preset = "silver"
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.lamp]
type = "null"
[[shapes]]
type = "rectangle"
material = "paint"
transform = [{{ scale = 1.5 }}, {{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}]
[[shapes]]
type = "rectangle"
material = "mirror"
transform = [{{ scale = 0.6 }}, {{ rotate = {{ axis = [0, 1, 0], angle = 40 }} }}, {{ translate = [-0.8, 0.4, -0.5] }}]
[[shapes]]
type = "cylinder"
material = "paint"
p0 = [0, 0.1, 0]
p1 = [0, 0.22, 0]
radius = 0.36
[[shapes]]
type = "sphere"
material = "paint"
center = [0, 0.2, 0.08]
radius = 0.06
[[shapes]]
type = "sphere"
material = "{ball}"
center = [0.55, 0.3, 0.3]
radius = 0.2
{lamp}
"#
        ))
    };
    let ball = r#"
[[shapes]]
type = "sphere"
material = "lamp"
boundary = false
center = [0, 0.15, 0]
radius = 0.3
emission = { radiance = [3, 2, 1], soft_falloff = true }
"#;
    let spot = r#"
[[lights]]
type = "spot"
position = [0, 0.6, 0]
target = [0.1, 0, 0.05]
intensity = [3, 2, 1]
radius = 0.3
soft_falloff = true
cutoff_angle = 70
"#;
    let fog = r#"
[media.fog]
type = "homogeneous"
sigma_a = 0.1
sigma_s = [0.5, 0.4, 0.3]
[world]
medium = "fog"
"#;
    let ways = [[PATHS, PATHS, PATHS], [PHOTONS, PHOTONS, PHOTONS]];
    found_once(&room(ball, "glass", ""), &ways[1..], 16);
    found_once(&room(ball, "glass", fog), &ways, 16);
    // No path hits a spot behind glass.
    found_once(&room(spot, "paint", fog), &ways, 16);
}
