use super::*;
use crate::sampler::{Purpose, Sampler};
use crate::warp;

fn hair(beta: [f32; 2], alpha: f32, absorption: f32) -> Hair {
    Hair {
        fibre: Fibre::new(beta, alpha, 1.55, 1.0),
        absorption: Rgb::new(0.5, 1.0, 2.0) * absorption,
    }
}

/// Directions that see the fibre from all sides of its front, including nearly along it.
fn looks(sampler: &mut Sampler) -> Vec3 {
    let w = warp::uniform_sphere(sampler.next_2d());
    w.with_z(w.z.abs().max(1e-3)).normalize()
}

const BETAS: [[f32; 2]; 5] = [[0.3, 0.3], [0.1, 0.6], [0.6, 0.1], [1.0, 1.0], [0.05, 0.15]];

/// Over all directions, by the midpoints of cells.
fn integral(value: impl Fn(Vec3) -> f32) -> f32 {
    const ALONG: usize = 1000;
    const AROUND: usize = 300;
    let mut sum = 0.0f64;
    for i in 0..ALONG {
        let x = 2.0 * (i as f32 + 0.5) / ALONG as f32 - 1.0;
        let across = (1.0 - x * x).sqrt();
        for k in 0..AROUND {
            let (sin, cos) = sin_cos(2.0 * PI * (k as f32 + 0.5) / AROUND as f32);
            sum += f64::from(value(Vec3::new(x, across * cos, across * sin)));
        }
    }
    (4.0 * std::f64::consts::PI * sum / (ALONG * AROUND) as f64) as f32
}

/// Without absorption all light leaves the fibre, and densities integrate to one, by quadrature.
#[test]
fn a_furnace_is_white() {
    let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
    for beta in BETAS {
        let white = hair(beta, 3.0, 0.0);
        let dark = hair(beta, 3.0, 0.7);
        let wo = looks(&mut sampler);
        for mode in [TransportMode::Radiance, TransportMode::Flux] {
            let all = integral(|wi| white.eval(wo, wi, mode).x * wi.z.abs());
            let tolerance = match mode {
                TransportMode::Radiance => 2e-3,
                // With Fresnel's share taken at the other direction, energy is conserved only on average.
                TransportMode::Flux => 0.25,
            };
            assert!((all - 1.0).abs() < tolerance, "{beta:?} {mode:?} {wo}: {all}");
        }
        let density = integral(|wi| dark.pdf(wo, wi));
        assert!((density - 1.0).abs() < 2e-3, "{beta:?} {wo}: {density}");
    }
}

/// Samples match the scattering function: the mean of their weights is the quadrature's, and their pdf and weight agree
/// with the value.
#[test]
fn samples_weigh_what_is_scattered() {
    let mut sampler = Sampler::new(2, 0, Purpose::Test, 0);
    for beta in BETAS {
        let hair = hair(beta, 2.0, 0.3);
        for mode in [TransportMode::Radiance, TransportMode::Flux] {
            let wo = looks(&mut sampler);
            let n = 20_000;
            let (mut sum, mut squares) = (0.0f64, 0.0f64);
            for _ in 0..n {
                let sample = hair.sample(wo, sampler.next_1d(), sampler.next_2d(), mode);
                let Some(sample) = sample else { continue };
                assert!((sample.wi.length() - 1.0).abs() < 1e-4);
                if sample.wi.z.abs() < 1e-5 {
                    continue;
                }
                let value = hair.eval(wo, sample.wi, mode) * sample.wi.z.abs() / sample.pdf;
                assert!(
                    (value - sample.weight).length() <= 2e-3 * sample.weight.length(),
                    "{value} {sample:?}"
                );
                sum += f64::from(sample.weight.y);
                squares += f64::from(sample.weight.y * sample.weight.y);
            }
            let mean = sum / f64::from(n);
            let error = ((squares / f64::from(n) - mean * mean) / f64::from(n)).max(0.0).sqrt();
            let all = f64::from(integral(|wi| hair.eval(wo, wi, mode).y * wi.z.abs()));
            assert!(
                (mean - all).abs() < 4.0 * error + 2e-3,
                "{beta:?} {mode:?}: {mean} +- {error}, {all}"
            );
        }
    }
}

/// Over all offsets across a fibre together, light goes both ways alike where scales are not tilted: photons carry what
/// paths find.
#[test]
fn photons_carry_what_paths_find() {
    let hair = hair([0.3, 0.4], 0.0, 0.4);
    let over_offsets = |o: (f32, f32), i: (f32, f32), mode: TransportMode| {
        const N: usize = 4000;
        let mut sum = Rgb::ZERO;
        for k in 0..N {
            // The direction that sees this offset, and the other one turned by the same angle.
            let h = 2.0 * (k as f32 + 0.5) / N as f32 - 1.0;
            let start = 0.5 * PI + asin(h);
            let direction = |(theta, phi): (f32, f32)| {
                let ((s, c), (sin, cos)) = (sin_cos(theta), sin_cos(start + phi));
                Vec3::new(s, c * cos, c * sin)
            };
            let (wo, wi) = (direction((o.0, 0.0)), direction((i.0, i.1 - o.1)));
            sum += hair.scattered(wo, wi, mode);
        }
        sum / N as f32
    };
    for (o, i) in [
        ((0.3, 0.2), (-0.5, 1.4)),
        ((0.9, 0.0), (-0.8, 3.0)),
        ((-0.2, 1.0), (0.1, -1.2)),
    ] {
        let by_paths = over_offsets(o, i, TransportMode::Radiance);
        let by_photons = over_offsets(i, o, TransportMode::Flux);
        assert!(
            (by_paths - by_photons).length() < 2e-3 * by_paths.length(),
            "{by_paths} {by_photons}"
        );
    }
}

/// Colours become absorption and back, and no pigment is white.
#[test]
fn colours_are_kept() {
    let fibre = Fibre::new([0.3, 0.5], 2.0, 1.55, 1.0);
    for color in [Rgb::new(0.9, 0.5, 0.1), Rgb::splat(0.02), Rgb::ONE] {
        let hair = Hair {
            fibre,
            absorption: fibre.absorption_of(color),
        };
        assert!((hair.albedo() - color).length() < 1e-4, "{color} {}", hair.albedo());
    }
}
