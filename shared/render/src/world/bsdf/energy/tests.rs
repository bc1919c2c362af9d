//! Checks the tables against integrals, and generates them.

use super::*;
use crate::world::fresnel::mean_fresnel;
use std::f64::consts::PI;
use std::fmt::Write;

pub(super) const BOTH: [Distribution; 2] = [Distribution::Ggx, Distribution::Beckmann];

/// Masking over twice the cosine.
pub(super) fn extent(distribution: Distribution, alpha: f64, z: f64) -> f64 {
    let sin = (1.0 - z * z).max(0.0).sqrt();
    match distribution {
        Distribution::Ggx => z + (z * z + alpha * alpha * sin * sin).sqrt(),
        Distribution::Beckmann => {
            let t = alpha * sin;
            let a = z / t.max(1e-12);
            z * (1.0 + libm::erf(a)) + t * libm::exp(-a * a) / PI.sqrt()
        }
    }
}

pub(super) fn fresnel(cos: f64, eta: f64) -> f64 {
    let cos_t = (1.0 - (1.0 - cos * cos) / (eta * eta)).max(0.0).sqrt();
    let s = (cos - eta * cos_t) / (cos + eta * cos_t);
    let p = (eta * cos - cos_t) / (eta * cos + cos_t);
    0.5 * (s * s + p * p)
}

/// Integral of one bounce over slopes: the slopes' projected density, times the correlated masking of both directions
/// over the cosine. `reflectance`: of the facets, by the cosine. Walter et al. 2007, eq. 20, over slopes.
fn one_bounce<const N: usize>(
    distribution: Distribution,
    alpha: f64,
    cos: f64,
    steps: u32,
    reflectance: impl Fn(f64) -> [f64; N],
) -> [f64; N] {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let mut sum = [0.0; N];
    for i in 0..steps {
        let t = (f64::from(i) + 0.5) / f64::from(steps);
        let length = slope(distribution, t);
        for j in 0..steps {
            let phi = (f64::from(j) + 0.5) / f64::from(steps) * PI;
            let x = alpha * length * libm::cos(phi);
            let y = alpha * length * libm::sin(phi);
            let inverse = 1.0 / (1.0 + x * x + y * y).sqrt();
            let towards = cos - sin * x;
            let cos_m = towards * inverse;
            let wi_z = 2.0 * cos_m * inverse - cos;
            if towards <= 0.0 || wi_z <= 0.0 {
                continue;
            }
            let weight = 2.0 * t * towards / f64::from(steps * steps);
            let heights = extent(distribution, alpha, cos) * wi_z + extent(distribution, alpha, wi_z) * cos;
            let masked = 2.0 * wi_z / (heights - 2.0 * cos * wi_z);
            for (sum, f) in sum.iter_mut().zip(reflectance(cos_m)) {
                *sum += weight * masked * f;
            }
        }
    }
    sum
}

/// Length of a slope over alpha, given the square root of the share of longer slopes: more samples in the tail.
pub(super) fn slope(distribution: Distribution, t: f64) -> f64 {
    match distribution {
        Distribution::Ggx => (1.0 - t * t).sqrt() / t,
        Distribution::Beckmann => (-2.0 * libm::log(t)).sqrt(),
    }
}

fn eta_of(z: f64) -> f64 {
    (1.0 + z * z) / (1.0 - z * z)
}

#[test]
fn losses_are_the_integrals() {
    for distribution in BOTH {
        for alpha in [0.0015f32, 0.004, 0.013, 0.03, 0.083, 0.2, 0.37, 0.5, 0.74, 0.93, 1.0] {
            let losses = Losses::of(Facets::even(distribution, alpha));
            for cos in [0.003f32, 0.02, 0.11, 0.3, 0.52, 0.77, 1.0] {
                let [kept] = one_bounce(distribution, f64::from(alpha), f64::from(cos), 200, |_| [1.0]);
                let loss = f64::from(losses.at(cos));
                // Losses fall steeply towards the horizon.
                let off = if cos < 0.01 { 6e-3 } else { 2e-3 };
                assert!(
                    (loss - (1.0 - kept)).abs() < off,
                    "{distribution:?} {alpha} {cos}: {loss} {}",
                    1.0 - kept
                );
            }
        }
    }
}

#[test]
fn means_are_those_of_the_losses() {
    for distribution in BOTH {
        for i in 0..60 {
            let root = 0.032 + 0.968 * i as f32 / 59.0;
            let losses = Losses::of(Facets::even(distribution, root * root));
            let n = 4000;
            // Denser at grazing angles.
            let term = |i: u32| {
                let u = (i as f32 + 0.5) / n as f32;
                f64::from(losses.at(u * u) * 4.0 * u * u * u)
            };
            let mean = (0..n).map(term).sum::<f64>() / f64::from(n);
            let found = f64::from(losses.mean());
            assert!(
                (found / mean - 1.0).abs() < 0.06,
                "{distribution:?} {root}: {found} {mean}"
            );
            assert!((found - mean).abs() < 3e-4, "{distribution:?} {root}: {found} {mean}");
        }
    }
}

#[test]
fn layers_reflect_what_bounces_do() {
    for (alpha, eta) in [
        (0.01f32, 1.5f32),
        (0.1, 1.33),
        (0.25, 1.5),
        (0.5, 1.8),
        (0.9, 1.2),
        (0.36, 2.4),
        (1.0, 1.5),
    ] {
        let facets = Facets::even(Distribution::Ggx, alpha);
        let layer = Layer::of(facets, eta);
        let mean = f64::from(mean_fresnel(eta));
        assert!((f64::from(layer.mean_fresnel) - mean).abs() < 1e-3, "{eta}");
        for cos in [0.03f32, 0.15, 0.4, 0.7, 1.0] {
            let once = |cos| [fresnel(cos, f64::from(eta)), 1.0];
            let [reflected, kept] = one_bounce(Distribution::Ggx, f64::from(alpha), f64::from(cos), 200, once);
            let whole = reflected + f64::from(layer.further) * (1.0 - kept);
            let found = f64::from(layer.albedo(cos, layer.losses.at(cos)));
            assert!((found - whole).abs() < 1e-2, "{alpha} {eta} {cos}: {found} {whole}");
        }
        let n = 2000;
        let term = |i: u32| {
            let cos = (i as f32 + 0.5) / n as f32;
            f64::from(layer.albedo(cos, layer.losses.at(cos)) * 2.0 * cos)
        };
        let mean = (0..n).map(term).sum::<f64>() / f64::from(n);
        let found = f64::from(layer.mean_albedo());
        assert!((found - mean).abs() < 1e-3, "{alpha} {eta}: {found} {mean}");
    }
}

#[test]
fn what_is_lost_comes_back() {
    // Fully reflecting conductors lose nothing, others something.
    let losses = Losses::of(Facets::even(Distribution::Ggx, 0.8));
    let [white, grey] = [1.0, 0.5].map(|f| losses.further_bounces(Rgb::splat(f)).x);
    assert!((white - 1.0).abs() < 1e-6, "{white}");
    // 1/4 (1 - m) / (1 - m / 2).
    let mean = losses.mean();
    assert!((grey - 0.25 * (1.0 - mean) / (1.0 - 0.5 * mean)).abs() < 1e-6, "{grey}");
    let gold = (Rgb::new(0.143, 0.375, 1.442), Rgb::new(3.983, 2.386, 1.603));
    let n = 20_000;
    let term = |i: u32| {
        let cos = (i as f32 + 0.5) / n as f32;
        f64::from(fresnel_conductor(cos, gold.0, gold.1).y * 2.0 * cos)
    };
    let integral = (0..n).map(term).sum::<f64>() / f64::from(n);
    assert!((f64::from(mean_of_conductor(gold.0, gold.1).y) - integral).abs() < 1e-4);
}

/// Makes `tables.rs`: `cargo test --release -p beamfarm-render --lib write_tables -- --ignored`.
#[test]
#[ignore = "writes a file of the source"]
fn write_tables() {
    const STEPS: u32 = 400;
    let whole = |share: f64| (share.clamp(0.0, 1.0) * 65535.0).round() as u16;
    let rooted = |loss: f64| whole(loss.max(0.0).sqrt());
    let alpha_of = |i: usize, rows: usize| {
        let root = i as f64 / (rows - 1) as f64;
        (root * root).max(1e-3)
    };
    let mut text = TEXT.to_owned();
    let losses = |table: &[Vec<u16>], alpha: f64, cos: f64| {
        let between = |x: f64, count: usize, value: &dyn Fn(usize) -> f64| {
            let x = x * (count - 1) as f64;
            let first = (x as usize).min(count - 2);
            let on = x - first as f64;
            value(first) * (1.0 - on) + value(first + 1) * on
        };
        between(alpha.sqrt(), ROWS, &|row| {
            between(cos * (1.0 + alpha) / (cos + alpha), COSINES, &|column| {
                let root = f64::from(table[row][column]) / 65535.0;
                root * root
            })
        })
    };
    let mut ggx = Vec::new();
    for (distribution, name) in BOTH.into_iter().zip(["GGX", "BECKMANN"]) {
        let table: Vec<Vec<u16>> = (0..ROWS)
            .map(|i| {
                let alpha = alpha_of(i, ROWS);
                let entry = |j: usize| {
                    let y = j as f64 / (COSINES - 1) as f64;
                    let cos = (y * alpha / (1.0 + alpha - y)).max(1e-7);
                    rooted(1.0 - one_bounce(distribution, alpha, cos, STEPS, |_| [1.0])[0])
                };
                (0..COSINES).map(entry).collect()
            })
            .collect();
        let mean = |i: usize| {
            let alpha = alpha_of(i, MEANS);
            let n = 20_000;
            let term = |i: u32| {
                let u = (f64::from(i) + 0.5) / f64::from(n);
                losses(&table, alpha, u * u) * 4.0 * u * u * u
            };
            rooted((0..n).map(term).sum::<f64>() / f64::from(n))
        };
        let means: Vec<u16> = (0..MEANS).map(mean).collect();
        let _ = writeln!(text, "\npub static {name}: [[u16; COSINES]; ROWS] = {table:?};");
        let _ = writeln!(text, "\npub static {name}_MEANS: [u16; MEANS] = {means:?};");
        if distribution == Distribution::Ggx {
            ggx = table;
        }
    }
    let zs: [f64; ETAS] = std::array::from_fn(|i| f64::from(MOST_Z) * i as f64 / (ETAS - 1) as f64);
    let share = |z: f64, value: f64| {
        let normal = z * z * z * z;
        (value - normal) / (1.0 - normal)
    };
    let means: Vec<f64> = zs.iter().map(|z| f64::from(mean_fresnel(eta_of(*z) as f32))).collect();
    let mut layers = vec![Vec::new(); ETAS];
    let mut mean_layers = vec![Vec::new(); ETAS];
    for i in 0..LAYER_ROWS {
        let alpha = alpha_of(i, LAYER_ROWS);
        let mut of_cosines = [[0.0; LAYER_COSINES]; ETAS];
        for j in 0..LAYER_COSINES {
            let root = j as f64 / (LAYER_COSINES - 1) as f64;
            let cos = (root * root).max(1e-7);
            let [kept] = one_bounce(Distribution::Ggx, alpha, cos, STEPS, |_| [1.0]);
            let reflected = one_bounce(Distribution::Ggx, alpha, cos, STEPS, |cos| {
                zs.map(|z| fresnel(cos, eta_of(z)))
            });
            for (k, of_eta) in of_cosines.iter_mut().enumerate() {
                of_eta[j] = share(zs[k], reflected[k] / kept);
            }
        }
        let n = 5000;
        let cosines = || (0..n).map(|i| (f64::from(i) + 0.5) / f64::from(n));
        let mean_loss = cosines().map(|c| losses(&ggx, alpha, c) * 2.0 * c).sum::<f64>() / f64::from(n);
        for k in 0..ETAS {
            layers[k].push(of_cosines[k].map(whole));
            let further = means[k] * means[k] * (1.0 - mean_loss) / (1.0 - means[k] * mean_loss);
            let normal = zs[k] * zs[k] * zs[k] * zs[k];
            let albedo = |cos: f64| {
                let x = cos.sqrt() * (LAYER_COSINES - 1) as f64;
                let first = (x as usize).min(LAYER_COSINES - 2);
                let on = x - first as f64;
                let share = of_cosines[k][first] * (1.0 - on) + of_cosines[k][first + 1] * on;
                let loss = losses(&ggx, alpha, cos);
                (normal + (1.0 - normal) * share) * (1.0 - loss) + further * loss
            };
            let mean = cosines().map(|c| albedo(c) * 2.0 * c).sum::<f64>() / f64::from(n);
            // An index of 1 has none.
            mean_layers[k].push(whole(mean / means[k].max(1e-12)));
        }
    }
    let _ = writeln!(
        text,
        "\npub static LAYERS: [[[u16; LAYER_COSINES]; LAYER_ROWS]; ETAS] = {layers:?};"
    );
    mean_layers[0] = mean_layers[1].clone();
    let _ = writeln!(
        text,
        "\npub static MEAN_LAYERS: [[u16; LAYER_ROWS]; ETAS] = {mean_layers:?};"
    );
    let fresnels: Vec<u16> = zs.iter().zip(&means).map(|(z, mean)| whole(share(*z, *mean))).collect();
    let _ = writeln!(text, "\npub static MEAN_FRESNEL: [u16; ETAS] = {fresnels:?};");
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/world/bsdf/energy/tables.rs");
    std::fs::write(path, wrapped(&text)).unwrap();
}

/// Breaks tables into lines of the right width.
pub(super) fn wrapped(text: &str) -> String {
    let mut wrapped = String::new();
    for line in text.lines() {
        let mut length = 0;
        for word in line.split_inclusive(' ') {
            if length + word.trim_end().len() > 118 && line.starts_with("pub static") {
                wrapped.truncate(wrapped.trim_end().len());
                wrapped.push_str("\n    ");
                length = 4;
            }
            wrapped.push_str(word);
            length += word.len();
        }
        wrapped.push('\n');
    }
    wrapped
}

const TEXT: &str =
    "//! Energy that microfacets lose in one bounce, and the reflectance of layers of them. Made by `write_tables` in
//! the tests beside it. All numbers are times 65535.
//!
//! Square roots of losses: rows by sqrt(alpha), columns by c (1 + alpha) / (c + alpha), with c the cosine, both from 0
//! to 1; means for diffuse light by sqrt(alpha). Layers by sqrt((eta - 1) / (eta + 1)) from 0 to 0.7, sqrt(alpha) and
//! sqrt(c): what facets reflect in one bounce over what white ones would, as the way from the reflectance at normal
//! incidence to 1. Mean layers: what they reflect of diffuse light in all bounces, over the mean Fresnel reflectance.
#![cfg_attr(rustfmt, rustfmt_skip)]
#![allow(clippy::unreadable_literal, missing_docs, reason = \"numbers\")]

/// Rows of losses.
pub const ROWS: usize = 32;
/// Columns of losses.
pub const COSINES: usize = 24;
/// Means of losses.
pub const MEANS: usize = 125;
/// Indices of refraction of layers.
pub const ETAS: usize = 12;
/// Rows of layers.
pub const LAYER_ROWS: usize = 12;
/// Columns of layers.
pub const LAYER_COSINES: usize = 28;
";
