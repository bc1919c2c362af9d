//! One beam against numerical integration.
//!
//! Parallel rays that cover a beam must see, added up over the area across them, just what its points scatter towards
//! them: the integral along the beam of sigma_s f_p Tr Tr Phi. No kernel, angle or radius is in that integral, so it is
//! independent of everything that the estimators do.

use beamfarm_shared::beam::PhotonBeam;
use beamfarm_shared::beam::estimate::{CameraSegment, PACKET, gather};
use beamfarm_shared::beam::store::{BeamMap, Candidates, Packet};
use beamfarm_shared::light::SceneBounds;
use beamfarm_shared::math::{Frame, Ray, Rgb, Vec3};
use beamfarm_shared::medium::transmittance::StepFunctions;
use beamfarm_shared::medium::{Homogeneous, Medium};
use beamfarm_shared::phase::Phase;
use beamfarm_shared::sampler::{Purpose, Sampler};
use beamfarm_tests::{MeanEstimate, Suite};

const AROUND: SceneBounds = SceneBounds {
    center: Vec3::ZERO,
    radius: 2.0,
};

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
        steps: 0,
    }
}

/// Radiance along rays, by way of the map: what a pass does.
fn radiance(map: &BeamMap, medium: &Medium, rays: &[Ray], length: f32, key: u64) -> Vec<Rgb> {
    let segments: Vec<CameraSegment> = rays
        .iter()
        .enumerate()
        .map(|(i, &ray)| CameraSegment {
            ray,
            length,
            beta: Rgb::ONE,
            medium: 0,
            steps: 0,
            pixel: i as u16,
            straight: Some(0),
        })
        .collect();
    let steps = StepFunctions::default();
    let mut found = Candidates::default();
    map.candidates(&Packet::new(rays.iter().map(|&r| (r, length))), &mut found);
    segments
        .chunks(PACKET)
        .flat_map(|packet| {
            let sum = gather(map, medium, packet, &steps, &found.found, key);
            (0..packet.len()).map(move |i| sum.of(i))
        })
        .collect()
}

/// Angles between beam and rays: ordinary ones, around the change of estimator, and down to nearly parallel, both ways.
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
    let map = BeamMap::new(vec![beam], StepFunctions::default(), &AROUND);
    for phase in [Phase::Isotropic, Phase::HenyeyGreenstein { g: 0.6 }] {
        let medium = medium(phase);
        for angle in ANGLES {
            let (estimate, expected) = wall(&map, &beam, &medium, angle);
            for c in 0..3 {
                let name = format!("{phase:?} at {angle} rad, channel {c}");
                suite.mean(name, &estimate[c], expected[c]);
            }
        }
    }
    suite.finish();
}

fn wall(
    map: &BeamMap,
    beam: &PhotonBeam,
    medium: &Medium,
    angle: f64,
) -> ([MeanEstimate; 3], [f64; 3]) {
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
        // A jittered grid of rays: every round is one unbiased estimate of the integral over the wall.
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
        let sum: Rgb = radiance(map, medium, &rays, length, round)
            .into_iter()
            .sum();
        assert!(sum.is_finite());
        for c in 0..3 {
            estimate[c].add(sum[c] as f64 * area / rays.len() as f64);
        }
    }

    let cos = beam.dir.dot(dir) as f64;
    let phase = medium.phase().eval_directions(beam.dir, -dir) as f64;
    let expected = [0, 1, 2].map(|c| {
        let sigma_t = medium.sigma_t()[c] as f64;
        let n = 20_000;
        let mut sum = 0.0;
        for i in 0..n {
            let s = (i as f64 + 0.5) / n as f64 * beam.length as f64;
            let t = before as f64 + (s - 0.5 * beam.length as f64) * cos;
            sum += libm::exp(-sigma_t * (s + t));
        }
        sum / n as f64
            * beam.length as f64
            * phase
            * medium.sigma_s()[c] as f64
            * beam.power[c] as f64
    });
    (estimate, expected)
}

#[test]
fn the_estimate_along_one_ray_is_the_blurred_line() {
    // The 1D kernel at one ray: sigma_s f_p Tr Tr Phi k(u) / sin theta, by hand.
    let beam = PhotonBeam {
        origin: Vec3::new(-1.0, 0.0, 0.0),
        dir: Vec3::X,
        length: 2.0,
        extent: [0.0, 2.0],
        power: Rgb::ONE,
        radius: 0.1,
        radius_slope: 0.0,
        medium: 0,
        steps: 0,
    };
    let medium = medium(Phase::Isotropic);
    let map = BeamMap::new(vec![beam], StepFunctions::default(), &AROUND);
    for (u, kernel) in [(0.0, 7.5), (0.05, 5.625), (0.0999, 0.015), (0.11, 0.0)] {
        let ray = Ray {
            origin: Vec3::new(0.25, u, -2.0),
            dir: Vec3::Z,
        };
        let got = radiance(&map, &medium, &[ray], 4.0, 0)[0];
        for c in 0..3 {
            let (sigma_t, sigma_s) = (medium.sigma_t()[c] as f64, medium.sigma_s()[c] as f64);
            let expected =
                kernel * sigma_s / (4.0 * std::f64::consts::PI) * libm::exp(-sigma_t * 3.25);
            let tolerance = 1e-5 * expected + 1e-4 * sigma_s;
            assert!(
                (got[c] as f64 - expected).abs() < tolerance,
                "u {u}: {got} {expected}"
            );
        }
    }
}
