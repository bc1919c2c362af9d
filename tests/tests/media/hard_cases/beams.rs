//! Beams at the edge of vanishing.

use beamfarm_render::cpu::beam::PhotonBeam;
use beamfarm_render::cpu::beam::estimate::{CameraSegment, CameraSegments, Gather, Vectors, Way};
use beamfarm_render::cpu::beam::store::{BeamMap, Traced};
use beamfarm_render::math::{Ray, Rgb, Vec3};
use beamfarm_render::plan::aov::Part;
use beamfarm_render::world::medium::transmittance::StepFunctions;
use beamfarm_render::world::medium::{Homogeneous, Medium};
use beamfarm_render::world::phase::Phase;

fn beam(length: f32, radius: f32) -> PhotonBeam {
    PhotonBeam {
        origin: Vec3::new(-0.5, 0.0, 0.0),
        dir: Vec3::X,
        length,
        extent: [0.0, length],
        power: Rgb::ONE,
        radius,
        radius_slope: 0.0,
        medium: 0,
        group: None,
        wave: None,
        steps: 0,
        walls: [0; 2],
    }
}

/// Radiance of these beams along a ray.
fn seen(beams: Vec<PhotonBeam>, ray: Ray) -> Rgb {
    let medium = Medium::Homogeneous(Homogeneous {
        sigma_a: Rgb::ZERO,
        sigma_s: Rgb::ONE,
        phase: Phase::HenyeyGreenstein { g: 0.999 },
    });
    let map = BeamMap::new(Traced {
        beams,
        steps: StepFunctions::default(),
        walls: Vec::new(),
    });
    let mut camera = CameraSegments::default();
    camera.segments.push(CameraSegment {
        ray,
        length: 4.0,
        beta: Rgb::ONE,
        medium: 0,
        steps: 0,
        pixel: 0,
        way: Way::default(),
        part: Part::Volume,
        wave: None,
    });
    let gather = Gather {
        map: &map,
        medium: &medium,
        steps: &camera.steps,
        scene: None,
        group: None,
        wave: None,
        key: 0,
        vectors: Vectors::widest(),
    };
    gather.along(&camera.segments).radiance[0]
}

/// Across the beam's start, along it, against it, from within it.
fn rays() -> [Ray; 5] {
    let ray = |origin: [f32; 3], dir: Vec3| Ray {
        origin: Vec3::from(origin),
        dir,
    };
    [
        ray([-0.5, 0.0, 2.0], -Vec3::Z),
        ray([-2.0, 0.0, 0.0], Vec3::X),
        ray([2.0, 0.0, 0.0], -Vec3::X),
        ray([-0.5, 0.0, 0.0], Vec3::X),
        ray([-0.25, 0.0, 0.0], Vec3::Y),
    ]
}

#[test]
fn a_beam_of_zero_length_adds_nothing() {
    for ray in rays() {
        for radius in [1e-12, 1e-3, 1.0] {
            assert_eq!(seen(vec![beam(0.0, radius)], ray), Rgb::ZERO, "{ray:?}");
            // The number of pieces that a beam is cut into depends on the lengths of all.
            let dark = PhotonBeam {
                power: Rgb::ZERO,
                ..beam(0.0, radius)
            };
            let alone = seen(vec![beam(1.0, 0.1), dark], ray);
            let both = seen(vec![beam(1.0, 0.1), beam(0.0, radius)], ray);
            assert_eq!(alone, both, "{ray:?}");
            assert!(alone.is_finite());
        }
    }
}

#[test]
fn thin_and_short_beams_are_finite() {
    for ray in rays() {
        for length in [1e-30, 1e-6, 1.0] {
            for radius in [1e-15, 1e-9, 1e-3, 1.0] {
                let radiance = seen(vec![beam(length, radius)], ray);
                assert!(
                    radiance.is_finite() && radiance.min_element() >= 0.0,
                    "{ray:?}, {length}, {radius}: {radiance}"
                );
            }
        }
    }
}
