//! What the estimators of transmittance cost and how much they vary, as a Markdown table:
//! `cargo run --release -p beamfarm-scene --example transmittance`.
//!
//! Per walk from side to side of a lumpy cube: the variance of the transmittance (mean over the way), also relative to
//! one free flight; steps of the function that is kept, its bytes; and the variance times the time of the walk: of two
//! estimators at one price, the one with less of it is better. A look-up is of a kept function in warm caches.
//!
//! Times are medians over rounds in which all estimators take turns, so that whatever else the machine does meets all
//! of them. Everything but the times is the same on every machine.

use beamfarm_render::math::{Ray, Rgb, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::medium::bricks::Bricks;
use beamfarm_render::world::medium::procedural::{Noise, Recipe};
use beamfarm_render::world::medium::transmittance::{Estimator, Step, StepFunctions};
use beamfarm_render::world::medium::{Heterogeneous, Track};
use beamfarm_render::world::phase::Phase;
use glam::{DAffine3, DVec3};
use std::cell::Cell;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

const RAYS: usize = 64;
/// Distances along each ray that the variance is averaged over.
const DISTANCES: usize = 32;
/// Walks along each ray that the variance is taken from.
const WALKS: usize = 5000;
/// Rounds of timing, and how often each ray is walked in one.
const ROUNDS: usize = 150;
const WALKS_PER_ROUND: usize = 4;
const LOOKUPS_PER_ROUND: usize = 16_384;

/// Optical depths of the media: mean over the rays.
const MEDIA: [(&str, f64); 2] = [("dense, 20", 20.0), ("thin, 0.2", 0.2)];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let recipe = Recipe {
        corners: [DVec3::ZERO, DVec3::ONE],
        voxel: 1.0 / 128.0,
        height: None,
        blobs: Vec::new(),
        noise: Some(Noise {
            size: 0.25,
            octaves: 3,
            gain: 0.6,
            contrast: 3.0,
            seed: 5,
        }),
        graph: None,
    };
    let density = Arc::new(Bricks::new(&recipe.sample()?)?);
    let medium = |estimator, sigma_t| {
        let (phase, to_render) = (Phase::Isotropic, DAffine3::IDENTITY);
        let sigma = [Rgb::ZERO, Rgb::splat(sigma_t)];
        Heterogeneous::new(sigma, phase, estimator, density.clone(), to_render)
    };
    let rays = rays();
    let per_sigma = mean_depth(&medium(Estimator::DEFAULT, 1.0), &rays);

    println!(
        "| medium | estimator | variance | relative | steps | look-ups of density | ns per walk | ns per look-up | bytes \
         | variance x ns |"
    );
    println!("|:--|:--|--:|--:|--:|--:|--:|--:|--:|--:|");
    for (medium_name, depth) in MEDIA {
        let medium = |estimator| medium(estimator, (depth / per_sigma) as f32);
        let flight = Estimator::FreeFlight { distances: 1 };
        let flights = Estimator::FreeFlight { distances: 16 };
        let residual = Estimator::ResidualRatioTracking;
        let way = |estimator: Estimator, kept| Way {
            name: match (estimator, kept) {
                (Estimator::FreeFlight { distances: 1 }, _) => "1 free flight".into(),
                (Estimator::ResidualRatioTracking, true) => format!("{estimator}, kept"),
                (Estimator::ResidualRatioTracking, false) => format!("{estimator}, once"),
                _ => estimator.to_string(),
            },
            medium: medium(estimator),
            kept,
        };
        let ways = [
            way(flight, true),
            way(flights, true),
            way(Estimator::RatioTracking, true),
            way(residual, false),
            way(residual, true),
        ];
        let figures: Vec<Figures> = ways.iter().map(|way| way.figures(&rays)).collect();
        let times = times(&ways, &rays);
        for ((way, of), [walk, lookup]) in ways.iter().zip(&figures).zip(times) {
            let variance = of.variance;
            println!(
                "| {medium_name} | {} | {variance:.2e} | {:.4} | {:.1} | {:.1} | {walk:.0} | {lookup:.1} | {:.0} | {:.2e} |",
                way.name,
                variance / figures[0].variance,
                of.steps,
                of.lookups,
                of.bytes,
                variance * walk,
            );
        }
    }
    Ok(())
}

/// Rays across the unit cube, from side to opposite side.
fn rays() -> Vec<Ray> {
    (0..RAYS)
        .map(|i| {
            let mut sampler = Sampler::new(1, 0, Purpose::Test, i as u64);
            let (from, to) = (sampler.next_2d(), sampler.next_2d());
            let origin = Vec3::new(-0.1, from.x, from.y);
            let dir = (Vec3::new(1.1, to.x, to.y) - origin).normalize();
            Ray { origin, dir }
        })
        .collect()
}

fn track<'a>(medium: &'a Heterogeneous, ray: &Ray) -> Track<'a> {
    medium.track(ray, f32::INFINITY).expect("a ray across the box")
}

/// Optical depth across the medium by quadrature, mean over the rays.
fn mean_depth(medium: &Heterogeneous, rays: &[Ray]) -> f64 {
    const POINTS: usize = 4096;
    let depth = |ray: &Ray| {
        let track = track(medium, ray);
        let sum: f64 = along(&track, POINTS).map(|t| track.density(t) as f64).sum();
        sum / POINTS as f64 * (track.range[1] - track.range[0]) as f64
    };
    let sum: f64 = rays.iter().map(depth).sum();
    sum / rays.len() as f64 * medium.sigma_t().x as f64
}

/// Middles of equal parts of a track.
fn along(track: &Track, parts: usize) -> impl Iterator<Item = f32> {
    let [start, end] = track.range;
    (0..parts).map(move |i| start + (end - start) * (i as f32 + 0.5) / parts as f32)
}

/// A way to estimate transmittance.
struct Way {
    name: String,
    medium: Heterogeneous,
    /// Whether functions are kept and looked up by many (beams, camera segments) or used once (shadow rays): residual
    /// tracking tells them apart.
    kept: bool,
}

/// Means over walks, and rays.
struct Figures {
    /// Of the transmittance, over distances along the ray.
    variance: f64,
    steps: f64,
    lookups: f64,
    bytes: f64,
}

impl Way {
    /// What the medium does, but that steps are kept in any case, and the density is at hand.
    fn walk(
        &self,
        track: &Track,
        density: impl Fn(f32) -> f32,
        sampler: &mut Sampler,
        steps: &mut StepFunctions,
    ) -> u32 {
        let often = if self.kept { self.medium.often(track) } else { 1.0 };
        let number = steps.begin();
        let push = |t, step: Step| steps.push(t, step);
        let sigma_t = self.medium.sigma_t();
        self.medium
            .estimator
            .walk(track.spans(), density, sigma_t, often, sampler, push);
        number
    }

    fn figures(&self, rays: &[Ray]) -> Figures {
        let sigma_t = self.medium.sigma_t();
        let mut functions = StepFunctions::default();
        let (mut variance, mut steps, mut bytes) = (0.0, 0, 0);
        let lookups = Cell::new(0u64);
        for (i, ray) in rays.iter().enumerate() {
            let track = track(&self.medium, ray);
            let distances: Vec<f32> = along(&track, DISTANCES).collect();
            let density = |t| {
                lookups.set(lookups.get() + 1);
                track.density(t)
            };
            // Sum of values and of squares.
            let mut sums = [[0.0f64; 2]; DISTANCES];
            for walk in 0..WALKS {
                let mut sampler = Sampler::new(2, i as u64, Purpose::Test, walk as u64);
                functions.clear();
                let number = self.walk(&track, density, &mut sampler, &mut functions);
                let function = functions.get(number);
                for (sums, t) in sums.iter_mut().zip(&distances) {
                    let value = function.at(*t, sigma_t).x as f64;
                    sums[0] += value;
                    sums[1] += value * value;
                }
                steps += function.steps();
                bytes += functions.bytes();
            }
            let n = WALKS as f64;
            let of = |[sum, squares]: [f64; 2]| (squares - sum * sum / n) / (n - 1.0);
            variance += sums.into_iter().map(of).sum::<f64>() / DISTANCES as f64;
        }
        let walks = (rays.len() * WALKS) as f64;
        Figures {
            variance: variance / rays.len() as f64,
            steps: steps as f64 / walks,
            lookups: lookups.get() as f64 / walks,
            bytes: bytes as f64 / walks,
        }
    }
}

/// Nanoseconds per walk and per look-up of the transmittance in what was kept, by way.
fn times(ways: &[Way], rays: &[Ray]) -> Vec<[f64; 2]> {
    let mut sampler = Sampler::new(3, 0, Purpose::Test, 0);
    // Rays, as numbers of functions, and distances, in no order.
    let places: Vec<(u32, f32)> = (0..LOOKUPS_PER_ROUND)
        .map(|_| {
            let i = sampler.next_u32() % rays.len() as u32;
            let [start, end] = track(&ways[0].medium, &rays[i as usize]).range;
            (i, start + (end - start) * sampler.next_1d())
        })
        .collect();
    let mut rounds = vec![[Vec::new(), Vec::new()]; ways.len()];
    let mut functions = StepFunctions::default();
    for _ in 0..ROUNDS {
        for (way, [walks, lookups]) in ways.iter().zip(&mut rounds) {
            let begin = Instant::now();
            for _ in 0..WALKS_PER_ROUND {
                functions.clear();
                for ray in rays {
                    let track = track(&way.medium, ray);
                    way.walk(&track, |t| track.density(t), &mut sampler, &mut functions);
                }
            }
            let time = begin.elapsed().as_secs_f64();
            walks.push(time / (WALKS_PER_ROUND * rays.len()) as f64);

            let sigma_t = way.medium.sigma_t();
            let begin = Instant::now();
            let mut sum = Rgb::ZERO;
            for (number, t) in &places {
                sum += functions.get(*number).at(*t, sigma_t);
            }
            black_box(sum);
            lookups.push(begin.elapsed().as_secs_f64() / places.len() as f64);
        }
    }
    let median = |mut times: Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2] * 1e9
    };
    rounds.into_iter().map(|both| both.map(&median)).collect()
}
