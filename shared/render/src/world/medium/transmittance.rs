//! Unbiased estimates of the transmittance along a ray through a medium of varying density. One random walk yields a
//! function of the distance, which is stored and looked up in O(log n).
//!
//! Each such function is unbiased at every distance, for any number of steps (Novák, Selle, Jarosz 2014, *Residual
//! ratio tracking for estimating attenuation in participating media*; free-flight distances: Jarosz et al. 2011,
//! *Progressive photon beams*). Ray marching is biased, and shrinking the radius would not remove that bias.

use super::majorant::Span;
use crate::math::{Rgb, exp_neg, exp_rgb_neg, ln, prefetch};
use crate::sampler::Sampler;
use std::fmt;

/// How the transmittance of a heterogeneous medium is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Estimator {
    /// The share of free flights, sampled by delta tracking, that went farther.
    FreeFlight {
        /// Number of flights, at least 1.
        distances: u16,
    },
    /// One walk at the majorant's rate, multiplied by the share of null collisions at every event.
    RatioTracking,
    /// The mean density of each span in closed form, and the residual by ratio tracking.
    ResidualRatioTracking,
}

impl fmt::Display for Estimator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FreeFlight { distances } => write!(f, "{distances} free flights"),
            Self::RatioTracking => f.write_str("ratio tracking"),
            Self::ResidualRatioTracking => f.write_str("residual ratio tracking"),
        }
    }
}

/// A step of the function of distance, and how it goes on from there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Transmittance at the step, without the next two.
    pub value: Rgb,
    /// Density times length of the closed-form part up to the step, where `value` does not include it.
    pub depth: f32,
    /// Density of the closed-form part from there on. Both are 0 except for residual ratio tracking.
    pub decay: f32,
}

/// Transmittance below which Russian roulette applies, so that walks end soon.
const ROULETTE_BELOW: f32 = 1.0 / 16.0;
/// From this many steps on, a walk continues with a chance of one in sixteen per step: memory is bounded.
const MANY_STEPS: u32 = 1024;
/// Optical depth that counts as opaque: e^-18 is below the rounding of the sums it enters.
pub(super) const OPAQUE_DEPTH: f32 = 18.0;
/// Transmittance at that depth.
const OPAQUE: f32 = 1.523e-8;
/// Most optical depth that residual tracking keeps in closed form, apart from `value`.
const MOST_DEPTH: f32 = 16.0;

impl Estimator {
    /// The default for media whose scene sets none.
    pub const DEFAULT: Self = Self::ResidualRatioTracking;

    /// One estimate. Calls `step(distance, step)` in the order of distances. Before the first step the transmittance is
    /// 1; after the last it is constant.
    ///
    /// `spans`: consecutive stretches of the ray with bounds of the density; `density`: the density at a distance;
    /// `sigma_t`: extinction at density 1, RGB, per scene unit. `often`, at least 1: factor by which residual tracking
    /// samples the density more often than necessary; the variance falls in proportion.
    pub fn walk(
        self,
        spans: impl Iterator<Item = Span> + Clone,
        density: impl Fn(f32) -> f32,
        sigma_t: Rgb,
        often: f32,
        sampler: &mut Sampler,
        step: impl FnMut(f32, Step),
    ) {
        match self {
            Self::FreeFlight { distances } => free_flights(distances, spans, density, sigma_t, sampler, step),
            Self::RatioTracking => ratio_tracking(spans, density, sigma_t, sampler, step),
            Self::ResidualRatioTracking => residual_tracking(spans, density, sigma_t, often, sampler, step),
        }
    }
}

/// Events of a Poisson process along the ray.
pub(super) struct Events {
    /// Optical distance from the last event, or from the span's start, to the next event.
    left: f64,
}

impl Events {
    pub(super) fn new(sampler: &mut Sampler) -> Self {
        Self {
            left: exponential(sampler),
        }
    }

    /// Calls `event(distance, rate)` for each event of a stretch with this `rate`, until it returns false.
    #[inline(always)]
    pub(super) fn within(
        &mut self,
        [start, end]: [f32; 2],
        rate: f32,
        sampler: &mut Sampler,
        mut event: impl FnMut(f32, &mut Sampler) -> bool,
    ) -> bool {
        if rate <= 0.0 {
            return true;
        }
        let depth = (end - start) as f64 * rate as f64;
        // In double precision, so that the walk advances at any rate.
        let mut at = self.left;
        while at < depth {
            if !event((start + (at / rate as f64) as f32).min(end), sampler) {
                return false;
            }
            at += exponential(sampler);
        }
        self.left = at - depth;
        true
    }
}

fn exponential(sampler: &mut Sampler) -> f64 {
    -ln(1.0 - sampler.next_1d()) as f64
}

fn ratio_tracking(
    spans: impl Iterator<Item = Span>,
    density: impl Fn(f32) -> f32,
    sigma_t: Rgb,
    sampler: &mut Sampler,
    mut step: impl FnMut(f32, Step),
) {
    let top = sigma_t.max_element();
    let mut events = Events::new(sampler);
    let (mut value, mut count) = (Rgb::ONE, 0);
    for span in spans {
        let rate = span.density.majorant * top;
        let goes_on = events.within([span.start, span.end], rate, sampler, |t, sampler| {
            let rho = density(t);
            if rho > 0.0 {
                value *= (Rgb::ONE - sigma_t * (rho / rate)).max(Rgb::ZERO);
                value *= roulette(value, count, sampler);
                count += 1;
                step(t, Step { value, ..Step::NONE });
            }
            value != Rgb::ZERO
        });
        if !goes_on {
            return;
        }
    }
}

fn residual_tracking(
    spans: impl Iterator<Item = Span>,
    density: impl Fn(f32) -> f32,
    sigma_t: Rgb,
    often: f32,
    sampler: &mut Sampler,
    mut step: impl FnMut(f32, Step),
) {
    let (top, least) = (sigma_t.max_element(), sigma_t.min_element());
    // `value` grows to make up for the closed form's shortfall, separately by channel. The two are combined before
    // either overflows.
    let put_together = |now: &mut Step| {
        if now.depth * top > MOST_DEPTH {
            now.value *= exp_rgb_neg(sigma_t * -now.depth);
            now.depth = 0.0;
        }
    };
    let mut events = Events::new(sampler);
    // `now` at the distance `at`.
    let (mut now, mut at) = (Step::NONE, 0.0);
    let (mut count, mut end) = (0, 0.0);
    for span in spans {
        // No step where the previous density serves about as well as the span's mean.
        let control = if span.density.is_near_mean(now.decay) {
            now.decay
        } else {
            span.density.mean
        };
        if control != now.decay {
            now.depth += now.decay * (span.start - at);
            (now.decay, at) = (control, span.start);
            put_together(&mut now);
            if now.value.max_element() * exp_neg(-least * now.depth) < OPAQUE {
                now.value = Rgb::ZERO;
            }
            step(at, now);
            if now.value == Rgb::ZERO {
                return;
            }
        }
        let rate = span.density.deviation_from(control) * top * often;
        let goes_on = events.within([span.start, span.end], rate, sampler, |t, sampler| {
            let residual = density(t) - control;
            now.depth += now.decay * (t - at);
            at = t;
            now.value *= (Rgb::ONE - sigma_t * (residual / rate)).max(Rgb::ZERO);
            put_together(&mut now);
            let decayed = now.value * exp_neg(-least * now.depth);
            now.value *= roulette(decayed, count, sampler);
            count += 1;
            step(at, now);
            now.value != Rgb::ZERO
        });
        if !goes_on {
            return;
        }
        end = span.end;
    }
    if now.decay != 0.0 {
        now.depth += now.decay * (end - at);
        step(end, Step { decay: 0.0, ..now });
    }
}

fn free_flights(
    distances: u16,
    spans: impl Iterator<Item = Span> + Clone,
    density: impl Fn(f32) -> f32,
    sigma_t: Rgb,
    sampler: &mut Sampler,
    mut step: impl FnMut(f32, Step),
) {
    let top = sigma_t.max_element();
    // Where flights ended, and in which channels.
    let mut ends: Vec<(f32, Rgb)> = Vec::new();
    for _ in 0..distances {
        let mut events = Events::new(sampler);
        let mut alive = Rgb::ONE;
        for span in spans.clone() {
            let rate = span.density.majorant * top;
            let goes_on = events.within([span.start, span.end], rate, sampler, |t, sampler| {
                let rho = density(t);
                if rho > 0.0 {
                    let u = sampler.next_1d();
                    let collides = sigma_t * (rho / rate);
                    let after = Rgb::select(collides.cmpgt(Rgb::splat(u)), Rgb::ZERO, alive);
                    if after != alive {
                        ends.push((t, alive - after));
                        alive = after;
                    }
                }
                alive != Rgb::ZERO
            });
            if !goes_on {
                break;
            }
        }
    }
    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut gone = Rgb::ZERO;
    for (t, channels) in ends {
        gone += channels;
        let value = (Rgb::splat(distances as f32) - gone) / distances as f32;
        step(t, Step { value, ..Step::NONE });
    }
}

/// Roulette factor on a walk's value, for low values or many steps; its mean is 1.
fn roulette(value: Rgb, count: u32, sampler: &mut Sampler) -> f32 {
    let survival = if count >= MANY_STEPS {
        1.0 / 16.0
    } else if value.max_element() < ROULETTE_BELOW {
        0.5
    } else {
        return 1.0;
    };
    if sampler.next_1d() < survival {
        1.0 / survival
    } else {
        0.0
    }
}

/// Functions of the distance, one after another.
#[derive(Clone, Debug, Default)]
pub struct StepFunctions {
    /// By function: index of its first step.
    first: Vec<u32>,
    distances: Vec<f32>,
    steps: Vec<Step>,
}

impl StepFunctions {
    /// Removes all functions.
    pub fn clear(&mut self) {
        self.first.clear();
        self.distances.clear();
        self.steps.clear();
    }

    /// Begins a function, which is 1 up to its first step. Returns its number.
    pub fn begin(&mut self) -> u32 {
        self.first.push(self.steps.len() as u32);
        self.push(f32::MIN, Step::NONE);
        self.first.len() as u32 - 1
    }

    /// Adds a step to the latest function, no nearer than the step before.
    pub fn push(&mut self, distance: f32, step: Step) {
        self.distances.push(distance);
        self.steps.push(step);
    }

    /// One of the functions.
    #[inline]
    pub fn get(&self, number: u32) -> StepFunction<'_> {
        let first = self.first[number as usize] as usize;
        let end = match self.first.get(number as usize + 1) {
            Some(next) => *next as usize,
            None => self.steps.len(),
        };
        StepFunction {
            distances: &self.distances[first..end],
            steps: &self.steps[first..end],
        }
    }

    /// Prefetches the position of a function, for [`StepFunctions::prefetch`].
    #[inline(always)]
    pub fn prefetch_number(&self, number: u32) {
        if let Some(first) = self.first.get(number as usize) {
            prefetch(first);
        }
    }

    /// Prefetches a function.
    #[inline(always)]
    pub fn prefetch(&self, number: u32) {
        let Some(first) = self.first.get(number as usize) else {
            return;
        };
        let first = *first as usize;
        prefetch(&self.distances[first]);
        for line in 0..4 {
            // Four cache lines hold a dozen steps.
            if let Some(step) = self.steps.get(first + line * 3) {
                prefetch(step);
            }
        }
    }

    /// Appends the functions of another collection. Their numbers grow by the returned number.
    pub fn append(&mut self, other: &Self) -> u32 {
        let (functions, steps) = (self.first.len() as u32, self.steps.len() as u32);
        self.first.extend(other.first.iter().map(|f| f + steps));
        self.distances.extend_from_slice(&other.distances);
        self.steps.extend_from_slice(&other.steps);
        functions
    }

    /// Bytes of memory.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.first[..]) + size_of_val(&self.distances[..]) + size_of_val(&self.steps[..])
    }
}

impl Step {
    /// Transmittance at the step. `sigma_t`: extinction at density 1.
    pub fn transmittance(&self, sigma_t: Rgb) -> Rgb {
        if self.depth > 0.0 {
            self.value * exp_rgb_neg(sigma_t * -self.depth)
        } else {
            self.value
        }
    }

    /// The start of a walk.
    pub const NONE: Self = Self {
        value: Rgb::ONE,
        depth: 0.0,
        decay: 0.0,
    };
}

/// One of the functions.
#[derive(Clone, Copy, Debug)]
pub struct StepFunction<'a> {
    /// Distances of the steps, increasing; the first is before all distances.
    distances: &'a [f32],
    steps: &'a [Step],
}

impl StepFunction<'_> {
    /// 1 everywhere.
    pub const EMPTY: Self = StepFunction {
        distances: &[f32::MIN],
        steps: &[Step::NONE],
    };

    /// The value of the last step up to a distance, and the density times length of the closed-form part.
    #[inline(always)]
    pub fn step_at(&self, distance: f32) -> (Rgb, f32) {
        let n = self.distances.partition_point(|d| *d <= distance).max(1) - 1;
        let step = &self.steps[n];
        // In this order, two numbers of the step give the depths at many distances.
        let depth = (step.depth - step.decay * self.distances[n]) + step.decay * distance;
        (step.value, depth)
    }

    /// Transmittance from the start to a distance. `sigma_t`: extinction at density 1.
    #[inline]
    pub fn at(&self, distance: f32, sigma_t: Rgb) -> Rgb {
        let (value, depth) = self.step_at(distance);
        if depth > 0.0 {
            value * exp_rgb_neg(sigma_t * -depth)
        } else {
            value
        }
    }

    /// Transmittance over the whole walk.
    pub fn last(&self, sigma_t: Rgb) -> Rgb {
        self.steps.last().map_or(Rgb::ONE, |step| step.transmittance(sigma_t))
    }

    /// Distance beyond which nothing is transmitted, if any.
    pub fn end(&self) -> Option<f32> {
        match (self.steps.last(), self.distances.last()) {
            (Some(step), Some(distance)) if step.value == Rgb::ZERO => Some(*distance),
            _ => None,
        }
    }

    /// The steps between two distances, from the last one before the first distance on. `near`: position of the
    /// previous search, updated.
    #[inline(always)]
    pub fn between(&self, from: f32, to: f32, near: &mut usize) -> impl Iterator<Item = (&f32, &Step)> {
        let is_before = |n: usize| self.distances.get(n).is_some_and(|d| *d <= from);
        if !is_before(*near) || is_before(*near + 1) {
            *near = self.distances.partition_point(|d| *d <= from).max(1) - 1;
        }
        // Usually none: a search would take longer.
        let reached = move |(distance, _): &(&f32, &Step)| **distance <= to;
        let rest = self.distances[*near..].iter().zip(&self.steps[*near..]);
        rest.take_while(reached)
    }

    /// A step, counted from 0, and its distance.
    pub fn step(&self, n: usize) -> Option<(f32, Step)> {
        Some((*self.distances.get(n + 1)?, *self.steps.get(n + 1)?))
    }

    /// Number of steps.
    pub fn steps(&self) -> usize {
        self.steps.len() - 1
    }
}
