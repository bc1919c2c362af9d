//! Beams behind refracting surfaces are as wide as lens formulas predict.

use beamfarm_harness::render::{plan_of, scene};
use beamfarm_render::cpu::beam::PhotonBeam;
use beamfarm_render::cpu::beam::trace::trace_photons;
use beamfarm_render::plan::kernel::KernelRadii;

/// Refractive index of the glass.
const ETA: f32 = 1.5;

/// A narrow spot at the origin shining along z, in fog so thin that nothing is scattered twice near the axis.
fn beams_near_axis(glass: &str) -> Vec<PhotonBeam> {
    let toml = format!(
        r#"
[image]
width = 8
height = 8
[render]
paths = 20000
seed = 3
[world]
medium = "fog"
[camera]
origin = [0.0, 5.0, 0.0]
target = [0.0, 0.0, 1.0]
fov = 30.0
[media.fog]
type = "homogeneous"
sigma_a = 0.0
sigma_s = 1e-4
[materials.glass]
type = "dielectric"
ior = {ETA}
[[shapes]]
material = "glass"
interior = "fog"
{glass}
[[lights]]
type = "spot"
position = [0.0, 0.0, 0.0]
target = [0.0, 0.0, 1.0]
intensity = 1.0
cutoff_angle = 1.0
"#
    );
    let scene = scene(&toml);
    let mut plan = plan_of(&scene);
    plan.radii = KernelRadii {
        floor: 0.0,
        ceiling: f32::INFINITY,
        smooth_ceiling: f32::INFINITY,
    };
    let mut beams = trace_photons(&scene, &plan, 0).beams;
    beams.retain(|beam| beam.dir.z > 0.99);
    beams
}

/// The distance behind a beam's start from which it seems to come, for all beams that start near this z.
fn apparent_distances(beams: &[PhotonBeam], z: f32) -> Vec<f32> {
    let starts_there = |beam: &&PhotonBeam| (beam.origin.z - z).abs() < 0.01;
    let apparent = |beam: &PhotonBeam| beam.radius / beam.radius_slope;
    let distances: Vec<f32> = beams.iter().filter(starts_there).map(apparent).collect();
    assert!(distances.len() > 1000, "{} beams", distances.len());
    distances
}

/// Fails unless 99 of 100 are within a hundredth of the expected value: the rest were reflected back and forth within
/// the glass.
fn check(what: &str, distances: &[f32], expected: f32) {
    let is_off = |distance: &&f32| (*distance / expected - 1.0).abs() > 0.01;
    let off = distances.iter().filter(is_off).count();
    assert!(
        off * 100 < distances.len(),
        "{what}: {off} of {} do not seem to come from {expected}: {:?}",
        distances.len(),
        distances.iter().find(is_off)
    );
}

#[test]
fn beams_through_a_pane() {
    // The pane spans z = 1 to z = 1.6.
    let pane = r#"
type = "cube"
transform = [{ scale = [4.0, 4.0, 0.3] }, { translate = [0.0, 0.0, 1.3] }]
"#;
    let beams = beams_near_axis(pane);
    // The apparent depth is n times as large from within and 1 / n times as large from outside.
    let inside = ETA;
    check("in the pane", &apparent_distances(&beams, 1.0), inside);
    let outside = (inside + 0.6) / ETA;
    check("behind the pane", &apparent_distances(&beams, 1.6), outside);
}

#[test]
fn beams_through_a_ball() {
    const RADIUS: f32 = 0.5;
    // The ball spans z = 0.1 to z = 1.1.
    let ball = r#"
type = "sphere"
center = [0, 0, 0.6]
radius = 0.5
"#;
    let beams = beams_near_axis(ball);
    // Refraction at one surface, n' / s' = n / s + (n' - n) / R (Hecht, Optics, section 5.2), with s' counted back to
    // where the light seems to come from, and R positive where the surface bulges towards it.
    let behind = |from: f32, to: f32, distance: f32, radius: f32| to / (from / distance - (to - from) / radius);
    let inside = behind(1.0, ETA, 0.1, RADIUS);
    check("in the ball", &apparent_distances(&beams, 0.1), inside);
    let outside = behind(ETA, 1.0, inside + 2.0 * RADIUS, -RADIUS);
    check("behind the ball", &apparent_distances(&beams, 1.1), outside);
}
