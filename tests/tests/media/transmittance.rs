//! The estimators of transmittance against closed forms and quadrature.

use beamfarm_harness::render::is_long;
use beamfarm_harness::{MeanEstimate, Suite};
use beamfarm_render::math::{Ray, Rgb, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::medium::bricks::{Bricks, Range};
use beamfarm_render::world::medium::majorant::Span;
use beamfarm_render::world::medium::procedural::{Blob, Height, Noise, Recipe};
use beamfarm_render::world::medium::transmittance::{Estimator, StepFunctions};
use beamfarm_render::world::medium::{Flight, Heterogeneous, Homogeneous, Medium};
use beamfarm_render::world::phase::Phase;
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use std::sync::Arc;

const LENGTH: f64 = 2.0;
/// Extinction at density 1.
const SIGMA_T: Rgb = Rgb::new(1.0, 0.6, 0.25);

/// A density along [0, LENGTH], and its integral from 0.
#[derive(Clone, Copy, Debug)]
enum Profile {
    Homogeneous,
    Step,
    Exponential,
    Gaussian,
}

const PROFILES: [Profile; 4] = [
    Profile::Homogeneous,
    Profile::Step,
    Profile::Exponential,
    Profile::Gaussian,
];

impl Profile {
    fn density(self, t: f64) -> f64 {
        match self {
            Self::Homogeneous => 1.5,
            Self::Step => [0.3, 2.5][(t >= 1.1) as usize],
            Self::Exponential => 0.2 * libm::exp(1.4 * t),
            Self::Gaussian => 3.0 * libm::exp(-8.0 * (t - 0.9) * (t - 0.9)),
        }
    }

    fn depth(self, t: f64) -> f64 {
        match self {
            Self::Homogeneous => 1.5 * t,
            Self::Step => 0.3 * t + 2.2 * (t - 1.1).max(0.0),
            Self::Exponential => 0.2 / 1.4 * (libm::exp(1.4 * t) - 1.0),
            Self::Gaussian => {
                let scale = 3.0 * libm::sqrt(std::f64::consts::PI / 8.0) / 2.0;
                let at = |t: f64| libm::erf(libm::sqrt(8.0) * (t - 0.9));
                scale * (at(t) - at(0.0))
            }
        }
    }

    /// Least and greatest density over a stretch: the profiles rise, or rise and fall around 0.9.
    fn range(self, start: f64, end: f64) -> [f64; 2] {
        let (a, b) = (self.density(start), self.density(end));
        let inner = if start < 0.9 && 0.9 < end { self.density(0.9) } else { a };
        [a.min(b), a.max(b).max(inner)]
    }
}

#[derive(Clone, Copy, Debug)]
enum Bounds {
    Tight,
    TenTimesLoose,
    PerCell,
}

/// A profile traversed from one of its ends.
#[derive(Clone, Copy, Debug)]
struct Way {
    profile: Profile,
    backward: bool,
    bounds: Bounds,
    estimator: Estimator,
}

impl Way {
    fn place(&self, t: f64) -> f64 {
        if self.backward { LENGTH - t } else { t }
    }

    fn transmittance(&self, t: f64) -> [f64; 3] {
        let depth = (self.profile.depth(self.place(t)) - self.profile.depth(self.place(0.0))).abs();
        [0, 1, 2].map(|c| libm::exp(-depth * SIGMA_T[c] as f64))
    }

    fn spans(&self) -> Vec<Span> {
        let cells = if matches!(self.bounds, Bounds::PerCell) { 13 } else { 1 };
        let at = |i: usize| LENGTH * i as f64 / cells as f64;
        (0..cells)
            .map(|i| {
                let (a, b) = (self.place(at(i)), self.place(at(i + 1)));
                let [low, high] = self.profile.range(a.min(b), a.max(b));
                let depth = self.profile.depth(a) - self.profile.depth(b);
                let mean = (depth / (a - b)).clamp(low, high);
                let [low, high] = match self.bounds {
                    Bounds::TenTimesLoose => [0.1 * low, 10.0 * high],
                    _ => [low, high],
                };
                Span {
                    start: at(i) as f32,
                    end: at(i + 1) as f32,
                    density: Range {
                        minorant: low as f32,
                        majorant: high as f32,
                        mean: mean as f32,
                    },
                }
            })
            .collect()
    }

    /// One step function of the distance, as it is cached.
    fn walk(&self, spans: &[Span], sampler: &mut Sampler, steps: &mut StepFunctions) -> u32 {
        let number = steps.begin();
        let density = |t: f32| self.profile.density(self.place(t as f64)) as f32;
        let spans = spans.iter().copied();
        let push = |t, step| steps.push(t, step);
        self.estimator.walk(spans, density, SIGMA_T, 1.0, sampler, push);
        number
    }
}

const ESTIMATORS: [Estimator; 3] = [
    Estimator::FreeFlight { distances: 4 },
    Estimator::RatioTracking,
    Estimator::ResidualRatioTracking,
];

fn ways() -> Vec<Way> {
    let mut ways = Vec::new();
    for profile in PROFILES {
        for estimator in ESTIMATORS {
            for bounds in [Bounds::Tight, Bounds::TenTimesLoose, Bounds::PerCell] {
                for backward in [false, true] {
                    ways.push(Way {
                        profile,
                        backward,
                        bounds,
                        estimator,
                    });
                }
            }
        }
    }
    ways
}

/// Batches of 2048 repetitions, and the distances examined.
const BATCHES: usize = 24;
const REPETITIONS: usize = 2048;
const DISTANCES: usize = 12;

#[test]
fn profiles_are_met_at_every_distance_and_the_error_falls_as_one_over_root_n() {
    let failures: Vec<String> = ways()
        .par_iter()
        .enumerate()
        .flat_map_iter(|(i, way)| check(i as u64, way))
        .collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// What is wrong with a way, if anything.
fn check(index: u64, way: &Way) -> Vec<String> {
    let spans = way.spans();
    let distance = |k: usize| LENGTH * (k as f64 + 0.7) / DISTANCES as f64;
    // By distance and channel.
    let expected: Vec<f64> = (0..DISTANCES)
        .flat_map(|k| way.transmittance(distance(k).min(LENGTH)))
        .collect();
    let n = BATCHES * REPETITIONS;
    let mut values = vec![Vec::with_capacity(n); expected.len()];
    let mut steps = StepFunctions::default();
    for repetition in 0..n {
        let mut sampler = Sampler::new(17, index, Purpose::Test, repetition as u64);
        steps.clear();
        let number = way.walk(&spans, &mut sampler, &mut steps);
        let function = steps.get(number);
        for k in 0..DISTANCES {
            let value = function.at(distance(k).min(LENGTH) as f32, SIGMA_T);
            for c in 0..3 {
                values[3 * k + c].push(value[c] as f64);
            }
        }
    }
    let mut failures = Vec::new();
    for (place, (values, &expected)) in values.iter().zip(&expected).enumerate() {
        // Where almost nothing is hit, means of 2048 are as far from normal as single values.
        if expected > 0.99 {
            continue;
        }
        let all: MeanEstimate = values.iter().copied().collect();
        let sigma = all.variance().sqrt();
        // Rounding in single precision, where there is hardly any variance.
        let rounding = 3e-7;
        let mut fail = |what: String| {
            let (k, c) = (place / 3, place % 3);
            failures.push(format!("{way:?} at {}, channel {c}: {what}", distance(k)));
        };
        for count in [1, 16, REPETITIONS] {
            let errors: Vec<f64> = values
                .chunks_exact(count)
                .map(|group| group.iter().sum::<f64>() / count as f64 - expected)
                .collect();
            // The first mean of 2048 lies within 4 standard errors. Means of few repetitions are not normally
            // distributed, and more of them may lie outside: Chebyshev's inequality allows one in sixteen.
            let bound = 4.0 * sigma / (count as f64).sqrt() + rounding;
            let outside = errors.iter().filter(|e| e.abs() > bound).count();
            let first_is = count == REPETITIONS && errors[0].abs() > bound;
            if first_is || outside > errors.len() / 16 {
                fail(format!(
                    "{outside} of {} means of {count} are further than {bound} from {expected}",
                    errors.len()
                ));
            }
            // Their mean squared error is sigma^2 / n.
            let squares: MeanEstimate = errors.iter().map(|error| error * error).collect();
            let predicted = all.variance() / count as f64;
            let bound = 4.0 * squares.std_error() + rounding * rounding + 1e-9 * predicted;
            // With few groups their spread is itself uncertain: chi-square with 24 degrees of freedom is far from
            // normal.
            let bound = bound.max(if count == REPETITIONS { 1.3 * predicted } else { 0.0 });
            if (squares.mean() - predicted).abs() > bound {
                fail(format!("squared error of {count}: {} not {predicted}", squares.mean()));
            }
        }
        if (all.mean() - expected).abs() > 4.0 * all.std_error() + rounding {
            fail(format!("{} +- {} not {expected}", all.mean(), all.std_error()));
        }
    }
    failures
}

/// Where it is thin in one channel and hundreds of mean free paths in another, estimates are still finite, and right.
#[test]
fn channels_may_differ_as_much_as_they_like() {
    let mut failures = Vec::new();
    for (profile, scale) in [
        (Profile::Step, 0.01),
        (Profile::Gaussian, 0.01),
        (Profile::Step, 0.2),
        (Profile::Step, 1.0),
        (Profile::Gaussian, 10.0),
    ] {
        let sigma_t = Rgb::new(2.6, 157.0, 131.0) * scale as f32;
        let [low, high] = profile.range(0.0, LENGTH);
        let span = Span {
            start: 0.0,
            end: LENGTH as f32,
            density: Range {
                minorant: low as f32,
                majorant: high as f32,
                mean: (profile.depth(LENGTH) / LENGTH) as f32,
            },
        };
        for (index, estimator) in ESTIMATORS.into_iter().enumerate() {
            let mut means = [MeanEstimate::new(); 3];
            let mut steps = StepFunctions::default();
            for repetition in 0..if is_long() { 20_000 } else { 2_000 } {
                let mut sampler = Sampler::new(23, index as u64, Purpose::Test, repetition);
                steps.clear();
                let number = steps.begin();
                let density = |t: f32| profile.density(f64::from(t)) as f32;
                let spans = [span].into_iter();
                let push = |t, step| steps.push(t, step);
                estimator.walk(spans, density, sigma_t, 1.0, &mut sampler, push);
                for distance in [0.3, 0.9, 1.7] {
                    assert!(steps.get(number).at(distance, sigma_t).is_finite());
                }
                let value = steps.get(number).at(LENGTH as f32, sigma_t);
                for (mean, value) in means.iter_mut().zip(value.to_array()) {
                    mean.add(f64::from(value));
                }
            }
            for (mean, sigma_t) in means.iter().zip(sigma_t.to_array()) {
                let expected = libm::exp(-f64::from(sigma_t) * profile.depth(LENGTH));
                // Lower values come from tails that this few walks do not reach.
                if expected > 0.01 && (mean.mean() - expected).abs() > 4.0 * mean.std_error() + 3e-7 {
                    failures.push(format!(
                        "{profile:?} * {scale}, {estimator}: {} +- {} not {expected}",
                        mean.mean(),
                        mean.std_error()
                    ));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// A lumpy density in a box that is rotated, stretched and moved.
fn lumps(estimator: Estimator) -> Heterogeneous {
    let recipe = Recipe {
        corners: [DVec3::new(-1.0, 0.0, -1.0), DVec3::new(1.0, 1.5, 1.2)],
        voxel: 0.07,
        height: Some(Height { base: 0.3, scale: 0.8 }),
        blobs: vec![
            Blob {
                center: DVec3::new(0.2, 0.4, 0.1),
                radius: 0.3,
                density: 4.0,
            },
            Blob {
                center: DVec3::new(-0.6, 0.9, -0.5),
                radius: 0.5,
                density: 1.5,
            },
        ],
        noise: Some(Noise {
            size: 0.5,
            octaves: 3,
            gain: 0.6,
            contrast: 3.0,
            seed: 5,
        }),
        graph: None,
    };
    let raw = recipe.sample().expect("a recipe within limits");
    let bricks = Bricks::new(&raw).expect("samples within limits");
    let to_render = DAffine3::from_translation(DVec3::new(3.0, -2.0, 1.0))
        * DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.8)
        * DAffine3::from_scale(DVec3::new(1.0, 1.6, 0.7));
    Heterogeneous::new(
        [Rgb::new(0.5, 0.2, 0.0), Rgb::new(1.5, 1.0, 0.4)],
        Phase::Isotropic,
        estimator,
        Arc::new(bricks),
        to_render,
    )
}

/// Rays through the box: from outside, from within, past it, and one along a coordinate axis.
fn rays() -> Vec<(Ray, f32)> {
    let middle = Vec3::new(3.0, -1.0, 1.0);
    let mut sampler = Sampler::new(3, 0, Purpose::Test, 0);
    let mut rays: Vec<(Ray, f32)> = (0..12)
        .map(|i| {
            let mut around = |r: f32| {
                let u = Vec3::new(sampler.next_1d(), sampler.next_1d(), sampler.next_1d());
                middle + (u - 0.5) * r
            };
            let origin = around(if i % 2 == 0 { 8.0 } else { 1.0 });
            let dir = (around(1.2) - origin).normalize();
            let length = [f32::INFINITY, 4.0, 1.1][i % 3];
            (Ray { origin, dir }, length)
        })
        .collect();
    let dir = Vec3::Y;
    rays.push((
        Ray {
            origin: middle - dir * 5.0,
            dir,
        },
        100.0,
    ));
    let origin = middle + Vec3::X * 50.0;
    rays.push((Ray { origin, dir }, 100.0));
    rays
}

/// Optical depth at density 1 by quadrature in small steps.
fn depth(medium: &Heterogeneous, ray: &Ray, length: f32) -> f64 {
    let Some(track) = medium.track(ray, length) else {
        return 0.0;
    };
    let [start, end] = track.range.map(|t| t as f64);
    let n = 40_000;
    let step = (end - start) / n as f64;
    let density = |i: u32| medium.density(ray.at((start + step * (i as f64 + 0.5)) as f32)) as f64;
    (0..n).map(density).sum::<f64>() * step
}

#[test]
fn grids_transmit_what_quadrature_says() {
    // Significance 1e-3 for the whole suite.
    let mut suite = Suite::new(1e-3);
    for estimator in ESTIMATORS {
        let medium = lumps(estimator);
        for (i, (ray, length)) in rays().into_iter().enumerate() {
            let depth = depth(&medium, &ray, length);
            let mut once = [(); 3].map(|_| MeanEstimate::new());
            let mut kept = once;
            let mut steps = StepFunctions::default();
            for round in 0..20_000 {
                let mut sampler = Sampler::new(5, i as u64, Purpose::Test, round);
                let value = medium.transmittance(&ray, length, &mut sampler);
                let last = match medium.track(&ray, length) {
                    Some(track) => {
                        steps.clear();
                        let number = medium.walk(&track, &mut sampler, &mut steps);
                        steps.get(number).last(medium.sigma_t())
                    }
                    None => Rgb::ONE,
                };
                for c in 0..3 {
                    once[c].add(value[c] as f64);
                    kept[c].add(last[c] as f64);
                }
            }
            for c in 0..3 {
                let expected = libm::exp(-depth * medium.sigma_t()[c] as f64);
                for (kind, means) in [("once", &once), ("kept", &kept)] {
                    let name = format!("{estimator}, {kind}, ray {i}, channel {c}");
                    suite.mean(name, &means[c], expected);
                }
            }
        }
    }
    suite.finish();
}

#[test]
fn flights_scatter_where_and_as_much_as_they_should() {
    let mut suite = Suite::new(1e-3);
    let medium = lumps(Estimator::DEFAULT);
    let power = Rgb::new(1.0, 3.0, 0.5);
    for (i, (ray, length)) in rays().into_iter().enumerate() {
        let Some(track) = medium.track(&ray, length) else {
            continue;
        };
        let [start, end] = track.range;
        let edges = [0.3, 0.6, 1.0].map(|f| start + (end - start) * f);
        // By third of the path and channel, and what passed.
        let mut means = vec![MeanEstimate::new(); 12];
        for round in 0..20_000 {
            let mut sampler = Sampler::new(6, i as u64, Purpose::Test, round);
            let (place, weight) = match medium.sample_flight(&track, power, &mut sampler) {
                Flight::Scattered { distance, weight } => {
                    assert!(distance >= start && distance <= end);
                    let third = edges.iter().position(|e| distance <= *e).unwrap_or(2);
                    (third, weight)
                }
                Flight::Passed { weight } => (3, weight),
            };
            for (k, mean) in means.iter_mut().enumerate() {
                mean.add(if k / 3 == place { weight[k % 3] as f64 } else { 0.0 });
            }
        }
        let mut before = 0.0;
        for (third, edge) in edges.into_iter().enumerate() {
            let after = depth(&medium, &ray, edge);
            for c in 0..3 {
                let (sigma_t, sigma_s) = (medium.sigma_t()[c] as f64, medium.sigma_s[c] as f64);
                let lost = libm::exp(-before * sigma_t) - libm::exp(-after * sigma_t);
                let name = format!("ray {i}, third {third}, channel {c}");
                suite.mean(name, &means[3 * third + c], lost * sigma_s / sigma_t);
            }
            before = after;
        }
        for c in 0..3 {
            let passed = libm::exp(-before * medium.sigma_t()[c] as f64);
            suite.mean(format!("ray {i}, passed, channel {c}"), &means[9 + c], passed);
        }
    }
    suite.finish();
}

/// Where every channel collides at every event, or some do and the light of some channels is zero or almost zero,
/// nothing is lost, gained or undefined: without absorption, flights keep the flux exactly.
#[test]
fn flights_keep_the_flux_where_channels_differ_as_much_as_they_can() {
    let recipe = Recipe {
        corners: [DVec3::ZERO, DVec3::ONE],
        voxel: 0.1,
        height: None,
        blobs: Vec::new(),
        noise: None,
        graph: None,
    };
    let raw = recipe.sample().expect("a recipe within limits");
    let bricks = Arc::new(Bricks::new(&raw).expect("samples within limits"));
    let ray = Ray {
        origin: Vec3::new(-1.0, 0.4, 0.6),
        dir: Vec3::X,
    };
    let colours = [
        Rgb::ONE,
        Rgb::new(1.0, 1.0, 0.999_999_94),
        Rgb::new(1.0, 0.7, 0.0),
        Rgb::new(1.0, 1e-4, 1e-4),
        Rgb::new(0.3, 1e-30, 1.0),
        Rgb::new(0.0, 0.0, 1.0),
    ];
    for sigma_s in colours {
        for scale in [0.1, 3.0, 1e4] {
            let sigma_s = sigma_s * scale;
            let phase = Phase::Isotropic;
            let media = [
                Medium::Homogeneous(Homogeneous {
                    sigma_a: Rgb::ZERO,
                    sigma_s,
                    phase,
                }),
                Medium::Heterogeneous(Heterogeneous::new(
                    [Rgb::ZERO, sigma_s],
                    phase,
                    Estimator::DEFAULT,
                    bricks.clone(),
                    DAffine3::IDENTITY,
                )),
            ];
            for power in colours.map(|c| [c, c * 1e-30, c * 1e30]).into_iter().flatten() {
                for (i, medium) in media.iter().enumerate() {
                    for round in 0..300 {
                        let mut sampler = Sampler::new(12, i as u64, Purpose::Test, round);
                        let (Flight::Scattered { weight, .. } | Flight::Passed { weight }) =
                            medium.sample_flight(&ray, 3.0, power, &mut sampler);
                        let kept = (power * weight).element_sum() / power.element_sum();
                        assert!(
                            weight.min_element() >= 0.0 && (kept - 1.0).abs() < 1e-4,
                            "sigma {sigma_s}, power {power}: {weight}"
                        );
                    }
                }
            }
        }
    }
}
