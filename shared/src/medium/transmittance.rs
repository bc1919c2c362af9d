//! Unbiased estimates of the transmittance along a ray through a medium whose density varies: one random walk makes a
//! function of the distance, which is kept and looked up in O(log n).
//!
//! Every function here is right on average at every distance, whatever its number of steps (Novák, Selle, Jarosz 2014,
//! *Residual ratio tracking for estimating attenuation in participating media*; free-flight distances: Jarosz et al.
//! 2011, *Progressive photon beams*). Ray marching is not, and no shrinking radius would mend it.

use super::bricks::Range;
use super::majorant::Span;
use crate::math::{Rgb, exp_rgb_neg, ln};
use crate::sampler::Sampler;
use std::fmt;

/// How the transmittance of a heterogeneous medium is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Estimator {
    /// The share of so many free flights, sampled by delta tracking, that went farther.
    FreeFlight {
        /// Number of flights, at least 1.
        distances: u16,
    },
    /// One walk at the majorant's rate, multiplied by the share of null collisions at every event.
    RatioTracking,
    /// The mean density of each span's surroundings in closed form, and what is left of it by ratio tracking.
    ResidualRatioTracking,
    /// The ray's own mean density over each span in closed form, so that the transmittance is exact at the knots between
    /// spans; between two of them, residual ratio tracking that starts anew at each.
    ExactKnots,
}

impl fmt::Display for Estimator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FreeFlight { distances } => write!(f, "{distances} free flights"),
            Self::RatioTracking => f.write_str("ratio tracking"),
            Self::ResidualRatioTracking => f.write_str("residual ratio tracking"),
            Self::ExactKnots => f.write_str("residual ratio tracking between exact knots"),
        }
    }
}

/// Where a function of the distance takes a step, and how it goes on from there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Transmittance at the step.
    pub value: Rgb,
    /// Density by which it decays from there; 0 but for residual ratio tracking.
    pub decay: f32,
}

/// Transmittance below which a walk is continued by roulette, so that it ends soon.
const ROULETTE_BELOW: f32 = 1.0 / 16.0;
/// From this many steps on, a walk goes on with one chance in sixteen at every further one: memory is bounded.
const MANY_STEPS: u32 = 1024;
/// Transmittance that counts as none: below the rounding of what it is added to.
const OPAQUE: f32 = 1.5e-8;

impl Estimator {
    /// What a medium has whose scene does not say.
    pub const DEFAULT: Self = Self::ExactKnots;

    /// One estimate. Calls `step(distance, step)` in the order of distances; before the first the transmittance is 1, and
    /// after the last it does not change any more.
    ///
    /// `spans`: consecutive stretches of the ray with bounds of the density, and its mean, which has to be the ray's own
    /// for exact knots and may be any value between the bounds for the others; `density`: the density at a distance;
    /// `sigma_t`: extinction at density 1, RGB, per scene unit.
    pub fn walk(
        self,
        spans: impl Iterator<Item = Span> + Clone,
        density: impl Fn(f32) -> f32,
        sigma_t: Rgb,
        sampler: &mut Sampler,
        step: impl FnMut(f32, Step),
    ) {
        match self {
            Self::FreeFlight { distances } => {
                free_flights(distances, spans, density, sigma_t, sampler, step)
            }
            Self::RatioTracking => ratio_tracking(spans, density, sigma_t, sampler, step),
            Self::ResidualRatioTracking => {
                residual_tracking(spans, density, sigma_t, sampler, step)
            }
            Self::ExactKnots => knotted_tracking(spans, density, sigma_t, sampler, step),
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

    /// Calls `event(distance, rate)` for each event in a stretch where they come at `rate`, until it says that it wants
    /// no more (and returns false).
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
        // In double precision, so that the walk gets on at any rate.
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
                step(t, Step { value, decay: 0.0 });
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
    sampler: &mut Sampler,
    mut step: impl FnMut(f32, Step),
) {
    let top = sigma_t.max_element();
    let mut events = Events::new(sampler);
    // `value` at the distance `at`, from where on it decays by `decay`.
    let (mut value, mut at, mut decay) = (Rgb::ONE, 0.0, 0.0);
    let (mut count, mut end) = (0, 0.0);
    let decayed =
        |value: Rgb, decay: f32, distance: f32| value * exp_rgb_neg(sigma_t * -(decay * distance));
    for span in spans {
        let control = span.density.mean;
        if control != decay {
            (value, at, decay) = (decayed(value, decay, span.start - at), span.start, control);
            if value.max_element() < OPAQUE {
                value = Rgb::ZERO;
            }
            step(at, Step { value, decay });
            if value == Rgb::ZERO {
                return;
            }
        }
        let Range {
            minorant, majorant, ..
        } = span.density;
        let rate = (majorant - control).max(control - minorant) * top;
        let goes_on = events.within([span.start, span.end], rate, sampler, |t, sampler| {
            let residual = density(t) - control;
            value = decayed(value, decay, t - at);
            value *= (Rgb::ONE - sigma_t * (residual / rate)).max(Rgb::ZERO);
            value *= roulette(value, count, sampler);
            count += 1;
            at = t;
            step(at, Step { value, decay });
            value != Rgb::ZERO
        });
        if !goes_on {
            return;
        }
        end = span.end;
    }
    if decay != 0.0 {
        value = decayed(value, decay, end - at);
        step(end, Step { value, decay: 0.0 });
    }
}

fn knotted_tracking(
    spans: impl Iterator<Item = Span>,
    density: impl Fn(f32) -> f32,
    sigma_t: Rgb,
    sampler: &mut Sampler,
    mut step: impl FnMut(f32, Step),
) {
    let top = sigma_t.max_element();
    let transmitted = |depth: f32| exp_rgb_neg(sigma_t * -depth);
    // Density times length up to the span, exactly; and the decay that the last step goes on with.
    let (mut depth, mut decay, mut end) = (0.0, 0.0, 0.0);
    let (mut count, mut strayed) = (0, false);
    for span in spans {
        let Range {
            minorant,
            majorant,
            mean: control,
        } = span.density;
        if strayed || control != decay {
            let mut value = transmitted(depth);
            if value.max_element() < OPAQUE {
                value = Rgb::ZERO;
            }
            decay = control;
            step(span.start, Step { value, decay });
            if value == Rgb::ZERO {
                return;
            }
            strayed = false;
        }
        // Factor on the exponential by which the control decays from the knot.
        let mut factor = Rgb::ONE;
        let rate = (majorant - control).max(control - minorant) * top;
        let range = [span.start, span.end];
        Events::new(sampler).within(range, rate, sampler, |t, sampler| {
            let residual = density(t) - control;
            factor *= (Rgb::ONE - sigma_t * (residual / rate)).max(Rgb::ZERO);
            factor *= roulette(factor, count, sampler);
            count += 1;
            strayed = true;
            let value = factor * transmitted(depth + control * (t - span.start));
            step(t, Step { value, decay });
            factor != Rgb::ZERO
        });
        depth += control * (span.end - span.start);
        end = span.end;
    }
    if strayed || decay != 0.0 {
        let value = transmitted(depth);
        step(end, Step { value, decay: 0.0 });
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
    // Where a flight ended, in which channels.
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
        step(t, Step { value, decay: 0.0 });
    }
}

/// Factor on a walk's value that ends it by and by when little or many steps are left of it; 1 on average.
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
    /// Forget all functions.
    pub fn clear(&mut self) {
        self.first.clear();
        self.distances.clear();
        self.steps.clear();
    }

    /// Begin a function, which is 1 up to its first step. Its number is returned.
    pub fn begin(&mut self) -> u32 {
        self.first.push(self.steps.len() as u32);
        self.push(f32::MIN, Step::NONE);
        self.first.len() as u32 - 1
    }

    /// Add a step to the function that was begun last, no nearer than the step before.
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

    /// Add the functions of another collection after these. Their numbers grow by the number that is returned.
    pub fn append(&mut self, other: &Self) -> u32 {
        let (functions, steps) = (self.first.len() as u32, self.steps.len() as u32);
        self.first.extend(other.first.iter().map(|f| f + steps));
        self.distances.extend_from_slice(&other.distances);
        self.steps.extend_from_slice(&other.steps);
        functions
    }

    /// Bytes that the functions take.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.first[..])
            + size_of_val(&self.distances[..])
            + size_of_val(&self.steps[..])
    }
}

impl Step {
    /// Where nothing has been met.
    pub const NONE: Self = Self {
        value: Rgb::ONE,
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

    /// The last step up to a distance, and the density times length that it has decayed by since.
    #[inline(always)]
    pub fn step_at(&self, distance: f32) -> (Rgb, f32) {
        let after = self.distances.partition_point(|d| *d <= distance);
        let Step { value, decay } = self.steps[after.max(1) - 1];
        // The first step, infinitely long ago, does not decay.
        let since = match decay > 0.0 {
            true => decay * (distance - self.distances[after.max(1) - 1]),
            false => 0.0,
        };
        (value, since)
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

    /// Transmittance over the whole of what was walked.
    pub fn last(&self) -> Rgb {
        self.steps.last().map_or(Rgb::ONE, |step| step.value)
    }

    /// Distance from where on nothing is transmitted, if there is one.
    pub fn end(&self) -> Option<f32> {
        match (self.steps.last(), self.distances.last()) {
            (Some(step), Some(distance)) if step.value == Rgb::ZERO => Some(*distance),
            _ => None,
        }
    }

    /// The steps that lie between two distances, after the last one up to the first of them.
    #[inline(always)]
    pub fn between(&self, from: f32, to: f32) -> impl Iterator<Item = (&f32, &Step)> {
        let first = self.distances.partition_point(|d| *d <= from).max(1) - 1;
        let end = first + self.distances[first..].partition_point(|d| *d <= to);
        self.distances[first..end]
            .iter()
            .zip(&self.steps[first..end])
    }

    /// The n-th step.
    pub fn step(&self, n: usize) -> Option<(f32, Step)> {
        Some((*self.distances.get(n + 1)?, *self.steps.get(n + 1)?))
    }

    /// Number of steps.
    pub fn steps(&self) -> usize {
        self.steps.len() - 1
    }
}
