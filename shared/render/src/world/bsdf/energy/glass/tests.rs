//! Checks the tables against integrals, and generates them.

use super::super::tests::{BOTH, extent, fresnel, slope, wrapped};
use super::*;
use std::f64::consts::PI;
use std::fmt::Write;

/// Integral of one bounce over slopes: the share of light that is kept, on either side. `eta`: index of refraction on
/// the other side over the one here.
fn one_bounce((distribution, alpha): (Distribution, f64), cos: f64, eta: f64, steps: u32) -> f64 {
    let mut sum = 0.0;
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let own = extent(distribution, alpha, cos);
    for i in 0..steps {
        let t = (f64::from(i) + 0.5) / f64::from(steps);
        let length = slope(distribution, t);
        for j in 0..steps {
            let phi = (f64::from(j) + 0.5) / f64::from(steps) * PI;
            let (x, y) = (alpha * length * libm::cos(phi), alpha * length * libm::sin(phi));
            let inverse = 1.0 / (1.0 + x * x + y * y).sqrt();
            let towards = cos - sin * x;
            if towards <= 0.0 {
                continue;
            }
            let cos_m = towards * inverse;
            let weight = 2.0 * t * towards / f64::from(steps * steps);
            let mut goes = |share: f64, z: f64, is_reflection: bool| {
                if share <= 0.0 || z == 0.0 || (z > 0.0) != is_reflection {
                    return;
                }
                let i = z.abs();
                let heights = own * i + extent(distribution, alpha, i) * cos;
                sum += weight * share * 2.0 * i / (heights - 2.0 * cos * i);
            };
            let cos2_t = 1.0 - (1.0 - cos_m * cos_m) / (eta * eta);
            if cos2_t <= 0.0 {
                goes(1.0, 2.0 * cos_m * inverse - cos, true);
                continue;
            }
            let reflectance = fresnel(cos_m, eta);
            goes(reflectance, 2.0 * cos_m * inverse - cos, true);
            goes(
                1.0 - reflectance,
                inverse * (cos_m / eta - cos2_t.sqrt()) - cos / eta,
                false,
            );
        }
    }
    sum
}

/// Both sides of a boundary that is denser inside: whether a direction is on it.
fn sides(eta: f64) -> [(bool, f64); 2] {
    [(false, eta), (true, 1.0 / eta)]
}

fn towards(z: f64) -> Vec3 {
    Vec3::new((1.0 - z * z).max(0.0).sqrt() as f32, 0.0, z as f32)
}

#[test]
fn albedos_are_the_integrals() {
    for distribution in BOTH {
        for (alpha, eta) in [
            (0.05f32, 1.5f32),
            (0.3, 1.33),
            (0.45, 1.5),
            (0.7, 1.8),
            (1.0, 2.4),
            (0.6, 1.05),
        ] {
            let albedo = GlassAlbedo::of(Facets::even(distribution, alpha), eta);
            let turned = GlassAlbedo::of(Facets::even(distribution, alpha), 1.0 / eta);
            for (inside, relative) in sides(f64::from(eta)) {
                let sign = if inside { -1.0 } else { 1.0 };
                for cos in [0.02, 0.05, 0.2, 0.45, 0.7, 0.85, 1.0] {
                    let kept = one_bounce((distribution, f64::from(alpha)), cos, relative, 150).max(LEAST);
                    let found = albedo.towards(towards(sign * cos));
                    // White glass loses nothing.
                    let white = albedo.brightened(towards(sign * cos), Rgb::ONE).x * found;
                    assert!((white - 1.0).abs() < 1e-5, "{white}");
                    // The same when seen from the other side.
                    assert!((found - turned.towards(towards(-sign * cos))).abs() < 1e-5);
                    // Weakly refracting glass loses most towards the horizon, and changes fastest there.
                    let off = if eta < 1.1 && cos < 0.1 { 0.1 } else { 0.022 };
                    assert!(
                        (f64::from(found) - kept).abs() < off,
                        "{distribution:?} {alpha} {eta} inside {inside} {cos}: {found} {kept}"
                    );
                }
                let n = 24;
                let term = |i: u32| {
                    let cos = (f64::from(i) + 0.5) / f64::from(n);
                    2.0 * cos * one_bounce((distribution, f64::from(alpha)), cos, relative, 60) / f64::from(n)
                };
                let (mean, found) = ((0..n).map(term).sum::<f64>(), f64::from(albedo.mean(sign as f32)));
                assert!(
                    (found - mean).abs() < 0.02,
                    "{distribution:?} {alpha} {eta} {inside}: {found} {mean}"
                );
            }
        }
    }
}

/// Least share in the tables.
const LEAST: f64 = 0.1;
/// Steps of the tables' integrals.
const STEPS: u32 = 240;

/// Makes `tables.rs`: `cargo test --release -p beamfarm-render --lib write_glass_tables -- --ignored`.
#[test]
#[ignore = "writes a file of the source"]
fn write_glass_tables() {
    let mut text = TEXT.to_owned();
    for (distribution, name) in BOTH.into_iter().zip(["GGX", "BECKMANN"]) {
        let table: Vec<Vec<[Vec<u16>; 2]>> = (0..ETAS)
            .map(|k| {
                let z = f64::from(MOST_Z) * k as f64 / (ETAS - 1) as f64;
                // Equal indices on both sides bend nothing, but the facets are still there.
                let eta = ((1.0 + z * z) / (1.0 - z * z)).max(1.0 + 1e-4);
                (0..ROWS)
                    .map(|i| {
                        let root = i as f64 / (ROWS - 1) as f64;
                        let facets = (distribution, (root * root).max(1e-3));
                        sides(eta).map(|(_, relative)| with_mean(facets.1, |j| share(facets, relative, j)))
                    })
                    .collect()
            })
            .collect();
        let _ = writeln!(text, "\npub static {name}: super::Table = {table:?};");
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/world/bsdf/energy/glass/tables.rs");
    std::fs::write(path, wrapped(&text)).unwrap();
}

/// Columns, and the mean of the values between them.
fn with_mean(alpha: f64, share: impl Fn(usize) -> u16) -> Vec<u16> {
    let mut columns: Vec<u16> = (0..COSINES).map(share).collect();
    let n = 4000;
    let term = |i: u32| {
        let cos = (f64::from(i) + 0.5) / f64::from(n);
        let x = cos * (1.0 + alpha) / (cos + alpha) * (COSINES - 1) as f64;
        let first = (x as usize).min(COSINES - 2);
        let on = x - first as f64;
        (f64::from(columns[first]) * (1.0 - on) + f64::from(columns[first + 1]) * on) * 2.0 * cos
    };
    columns.push(((0..n).map(term).sum::<f64>() / f64::from(n)).round() as u16);
    columns
}

fn share(facets: (Distribution, f64), eta: f64, column: usize) -> u16 {
    let (y, alpha) = (column as f64 / (COSINES - 1) as f64, facets.1);
    let cos = (y * alpha / (1.0 + alpha - y)).max(1e-6);
    // Keeps divisions by it finite.
    (one_bounce(facets, cos, eta, STEPS).clamp(LEAST, 1.0) * 65535.0).round() as u16
}

const TEXT: &str =
    "//! Light that rough glass keeps in one bounce, reflected or transmitted. Made by `write_glass_tables` in the tests
//! beside it.
//!
//! By sqrt((eta - 1) / (eta + 1)) from 0 to 0.7, sqrt(alpha) from 0 to 1, side (that of the lower index first), and
//! c (1 + alpha) / (c + alpha), with c the cosine, from 0 to 1; the last column is for diffuse light. Times 65535.
#![cfg_attr(rustfmt, rustfmt_skip)]
#![allow(clippy::unreadable_literal, missing_docs, reason = \"numbers\")]

/// Indices of refraction.
pub const ETAS: usize = 8;
/// Roughnesses.
pub const ROWS: usize = 12;
/// Cosines.
pub const COSINES: usize = 14;
";
