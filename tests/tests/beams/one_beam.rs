//! One beam against numerical integration.
//!
//! Parallel rays that cover a beam must see, integrated over the area across them, just what its points scatter towards
//! them: the integral along the beam of sigma_s f_p Tr Tr Phi. That integral contains no kernel, angle or radius, so it
//! is independent of everything that the estimators do.

use beamfarm_harness::{MeanEstimate, Suite};
use beamfarm_render::cpu::beam::PhotonBeam;
use beamfarm_render::cpu::beam::estimate::{CameraSegment, CameraSegments, Gather, Vectors, Way};
use beamfarm_render::cpu::beam::store::{BeamMap, Traced};
use beamfarm_render::math::{Frame, Ray, Rgb, Vec3};
use beamfarm_render::plan::aov::Part;
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::medium::bricks::Bricks;
use beamfarm_render::world::medium::procedural::{Blob, Height, Recipe};
use beamfarm_render::world::medium::transmittance::{Estimator, StepFunctions};
use beamfarm_render::world::medium::{Heterogeneous, Homogeneous, Medium};
use beamfarm_render::world::phase::Phase;
use glam::{DAffine3, DVec3};
use std::sync::Arc;

fn medium(phase: Phase) -> Medium {
    Medium::Homogeneous(Homogeneous {
        sigma_a: Rgb::new(0.1, 0.0, 0.3),
        sigma_s: Rgb::new(0.4, 0.2, 0.05),
        phase,
    })
}

fn slanted_beam() -> PhotonBeam {
    PhotonBeam {
        origin: Vec3::new(0.3, -0.4, 0.2),
        dir: Vec3::new(0.48, 0.6, 0.64).normalize(),
        length: 2.0,
        extent: [0.0, 2.0],
        power: Rgb::new(3.0, 2.0, 1.0),
        radius: 0.02,
        radius_slope: 0.015,
        medium: 0,
        group: None,
        wave: None,
        steps: 0,
        walls: [0; 2],
    }
}

/// A cloud around the beam, and thin fog around the cloud. Its density varies little over the beam's width.
fn cloud(phase: Phase, estimator: Estimator) -> Medium {
    let recipe = Recipe {
        corners: [DVec3::splat(-3.0), DVec3::splat(4.0)],
        voxel: 0.1,
        height: Some(Height { base: -1.0, scale: 4.0 }),
        blobs: vec![
            Blob {
                center: DVec3::new(0.6, 0.3, 0.5),
                radius: 0.5,
                density: 2.0,
            },
            Blob {
                center: DVec3::ZERO,
                radius: 10.0,
                density: 0.3,
            },
        ],
        noise: None,
        graph: None,
    };
    let raw = recipe.sample().expect("a recipe within limits");
    let bricks = Bricks::new(&raw).expect("samples within limits");
    Medium::Heterogeneous(Heterogeneous::new(
        [Rgb::new(0.1, 0.0, 0.3), Rgb::new(0.4, 0.2, 0.05)],
        phase,
        estimator,
        Arc::new(bricks),
        DAffine3::IDENTITY,
    ))
}

/// Radiance along rays, computed from the map as a pass does.
fn radiance(map: &BeamMap, medium: &Medium, rays: &[Ray], length: f32, key: u64) -> Vec<Rgb> {
    let mut camera = CameraSegments::default();
    let mut sampler = Sampler::new(8, 0, Purpose::Test, key);
    for (i, ray) in rays.iter().enumerate() {
        let (segment, _) = medium.segment(ray, length, &mut sampler, &mut camera.steps);
        let segment = segment.expect("a ray through the medium");
        camera.segments.push(CameraSegment {
            ray: *ray,
            length: segment.range[1],
            beta: Rgb::ONE,
            medium: 0,
            steps: segment.steps,
            pixel: i as u16,
            way: Way::default(),
            part: Part::Volume,
            wave: None,
        });
    }
    gather(map, medium, &camera, key).along(&camera.segments).radiance
}

fn gather<'a>(map: &'a BeamMap, medium: &'a Medium, camera: &'a CameraSegments, key: u64) -> Gather<'a> {
    Gather {
        map,
        medium,
        steps: &camera.steps,
        scene: None,
        group: None,
        wave: None,
        key,
        vectors: Vectors::widest(),
    }
}

/// The beam's map. In a heterogeneous medium every number gives another estimate of the transmittance along the beam.
fn map_of(beam: &PhotonBeam, medium: &Medium, number: u64) -> BeamMap {
    let mut steps = StepFunctions::default();
    let mut sampler = Sampler::new(9, 0, Purpose::Test, number);
    let ray = Ray {
        origin: beam.origin,
        dir: beam.dir,
    };
    // Two of them, so that the second one's number matters.
    for _ in 0..2 {
        let _ = medium.segment(&ray, beam.length, &mut sampler, &mut steps);
    }
    BeamMap::new(Traced {
        beams: vec![*beam],
        steps,
        walls: Vec::new(),
    })
}

/// Angles between beam and rays: ordinary ones, some around the change of estimator, and some nearly parallel, both
/// ways.
const ANGLES: [f64; 14] = [
    1.2,
    0.5,
    0.12,
    0.101,
    0.099,
    0.05,
    0.01,
    1e-3,
    1e-4,
    1e-6,
    0.0,
    3.0,
    3.13,
    std::f64::consts::PI,
];

#[test]
fn a_wall_of_rays_sees_what_the_beam_scatters() {
    // Significance 1e-3 for the whole suite.
    let mut suite = Suite::new(1e-3);
    let beam = slanted_beam();
    for phase in [
        Phase::Isotropic,
        Phase::HenyeyGreenstein { g: 0.6 },
        Phase::HenyeyGreenstein { g: 0.999 },
        Phase::HenyeyGreenstein { g: -0.999 },
        Phase::blend(0.3, [-0.4, 0.7]),
    ] {
        let medium = medium(phase);
        for angle in ANGLES {
            let (estimate, expected) = wall(&beam, &medium, angle);
            for c in 0..3 {
                let name = format!("{phase:?} at {angle} rad, channel {c}");
                suite.mean(name, &estimate[c], expected[c]);
            }
        }
    }
    suite.finish();
}

#[test]
fn a_wall_of_rays_sees_what_the_beam_scatters_in_a_cloud() {
    // Significance 1e-3 for the whole suite.
    let mut suite = Suite::new(1e-3);
    let beam = PhotonBeam {
        radius: 0.01,
        radius_slope: 0.002,
        group: None,
        wave: None,
        steps: 1,
        walls: [0; 2],
        ..slanted_beam()
    };
    let estimators = [
        (Estimator::RatioTracking, Phase::Isotropic),
        (Estimator::ResidualRatioTracking, Phase::HenyeyGreenstein { g: 0.6 }),
        (Estimator::FreeFlight { distances: 30 }, Phase::Isotropic),
        (Estimator::ResidualRatioTracking, Phase::blend(0.3, [-0.4, 0.7])),
    ];
    for (estimator, phase) in estimators {
        let medium = cloud(phase, estimator);
        for angle in [1.2, 0.5, 0.05, 0.0, 3.0] {
            let (estimate, expected) = wall(&beam, &medium, angle);
            for c in 0..3 {
                let name = format!("{estimator} at {angle} rad, channel {c}");
                suite.mean(name, &estimate[c], expected[c]);
            }
        }
    }
    suite.finish();
}

/// Transmittance at each of `n` distances along a ray, the midpoints of equal steps, and the density there.
fn along(medium: &Medium, ray: &Ray, length: f64, n: usize) -> Vec<([f64; 3], f64)> {
    let mut depth = 0.0;
    let step = length / n as f64;
    (0..n)
        .map(|i| {
            let at = ray.at(((i as f64 + 0.5) * step) as f32);
            let density = match medium {
                Medium::Homogeneous(_) => 1.0,
                Medium::Heterogeneous(medium) => medium.density(at) as f64,
            };
            depth += density * step;
            let until = depth - 0.5 * density * step;
            let tr = |c: usize| libm::exp(-until * medium.sigma_t()[c] as f64);
            ([0, 1, 2].map(tr), density)
        })
        .collect()
}

fn wall(beam: &PhotonBeam, medium: &Medium, angle: f64) -> ([MeanEstimate; 3], [f64; 3]) {
    const ROUNDS: u64 = 600;
    let around = Frame::from_normal(beam.dir);
    let (sin, cos) = (libm::sin(angle) as f32, libm::cos(angle) as f32);
    let dir = (around.s * sin + around.n * cos).normalize();
    // In the plane across the rays: `long` along the beam's shadow, `wide` across it.
    let wide = around.t;
    let long = dir.cross(wide);
    let center = beam.origin + beam.dir * (0.5 * beam.length);
    let radius = beam.max_radius();
    let half_long = 0.5 * beam.length * sin.abs() + 1.05 * radius;
    let half_wide = 1.05 * radius;
    let area = (4.0 * half_long * half_wide) as f64;
    let (before, length) = (3.0f32, 6.0f32);

    let mut estimate = [(); 3].map(|_| MeanEstimate::new());
    for round in 0..ROUNDS {
        // A jittered grid of rays: every round gives one unbiased estimate of the integral over the wall.
        let mut sampler = Sampler::new(7, angle.to_bits(), Purpose::Test, round);
        let (nx, ny) = (16, 4);
        let rays: Vec<Ray> = (0..nx * ny)
            .map(|i| {
                let u = sampler.next_2d();
                let x = ((i % nx) as f32 + u.x) / nx as f32 * 2.0 - 1.0;
                let y = ((i / nx) as f32 + u.y) / ny as f32 * 2.0 - 1.0;
                let offset = long * (x * half_long) + wide * (y * half_wide);
                Ray {
                    origin: center + offset - dir * before,
                    dir,
                }
            })
            .collect();
        let sum: Rgb = radiance(&map_of(beam, medium, round), medium, &rays, length, round)
            .into_iter()
            .sum();
        assert!(sum.is_finite());
        for c in 0..3 {
            estimate[c].add(sum[c] as f64 * area / rays.len() as f64);
        }
    }

    let cos = beam.dir.dot(dir) as f64;
    let phase = medium.phase().eval_directions(beam.dir, -dir) as f64;
    let n = 400;
    let ray = Ray {
        origin: beam.origin,
        dir: beam.dir,
    };
    let mut expected = [0.0; 3];
    for (i, (tr_beam, density)) in along(medium, &ray, beam.length as f64, n).into_iter().enumerate() {
        let s = (i as f64 + 0.5) / n as f64 * beam.length as f64;
        let t = before as f64 + (s - 0.5 * beam.length as f64) * cos;
        let seen = Ray {
            origin: ray.at(s as f32) - dir * t as f32,
            dir,
        };
        let end = along(medium, &seen, t, n)[n - 1];
        for c in 0..3 {
            expected[c] += tr_beam[c] * end.0[c] * density;
        }
    }
    for (c, expected) in expected.iter_mut().enumerate() {
        let step = beam.length as f64 / n as f64;
        *expected *= step * phase * medium.sigma_s()[c] as f64 * beam.power[c] as f64;
    }
    (estimate, expected)
}

#[test]
fn the_estimate_along_one_ray_is_the_blurred_line() {
    // The 1D kernel at one ray, by hand: sigma_s f_p Tr Tr Phi k(u) / sin theta.
    let beam = PhotonBeam {
        origin: Vec3::new(-1.0, 0.0, 0.0),
        dir: Vec3::X,
        length: 2.0,
        extent: [0.0, 2.0],
        power: Rgb::ONE,
        radius: 0.1,
        radius_slope: 0.0,
        medium: 0,
        group: None,
        wave: None,
        steps: 0,
        walls: [0; 2],
    };
    let medium = medium(Phase::Isotropic);
    let map = map_of(&beam, &medium, 0);
    for (u, kernel) in [(0.0, 7.5), (0.05, 5.625), (0.0999, 0.015), (0.11, 0.0)] {
        let ray = Ray {
            origin: Vec3::new(0.25, u, -2.0),
            dir: Vec3::Z,
        };
        let got = radiance(&map, &medium, &[ray], 4.0, 0)[0];
        for c in 0..3 {
            let (sigma_t, sigma_s) = (medium.sigma_t()[c] as f64, medium.sigma_s()[c] as f64);
            let expected = kernel * sigma_s / (4.0 * std::f64::consts::PI) * libm::exp(-sigma_t * 3.25);
            let tolerance = 1e-5 * expected + 1e-4 * sigma_s;
            assert!((got[c] as f64 - expected).abs() < tolerance, "u {u}: {got} {expected}");
        }
    }
}
