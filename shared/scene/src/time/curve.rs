//! Interpolation between keys.

use super::form::Parts;
use glam::DVec4;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Linear; rotations turn at constant speed.
    Linear,
    /// Smooth: monotone cubics (Fritsch and Butland 1984) with continuous speed, at rest at both ends, never
    /// overshooting the keys.
    Smooth,
    /// Each key holds until the next one.
    Step,
}

/// Numbers over time.
#[derive(Debug)]
pub struct Curve {
    times: Vec<f64>,
    /// One list of numbers per key.
    values: Vec<Vec<f64>>,
    /// Offsets of the unit quaternions.
    turns: Vec<usize>,
    interpolation: Interpolation,
}

impl Curve {
    pub fn new(times: Vec<f64>, parts: Parts, interpolation: Interpolation) -> Self {
        let Parts { mut values, turns } = parts;
        // Take the shorter way between successive rotations.
        for start in &turns {
            for k in 1..values.len() {
                let (before, after) = (quaternion(&values[k - 1], *start), quaternion(&values[k], *start));
                if before.dot(after) < 0.0 {
                    put(&mut values[k], *start, -after);
                }
            }
        }
        Self {
            times,
            values,
            turns,
            interpolation,
        }
    }

    /// The numbers at a time; held before the first key and after the last.
    pub fn at(&self, time: f64) -> Vec<f64> {
        let last = self.times.len() - 1;
        let later = self.times.partition_point(|key| *key <= time);
        if later == 0 {
            return self.values[0].clone();
        }
        let k = later - 1;
        if k == last || self.times[k] == time || self.interpolation == Interpolation::Step {
            return self.values[k].clone();
        }
        let span = self.times[k + 1] - self.times[k];
        let u = (time - self.times[k]) / span;
        let (from, to) = (&self.values[k], &self.values[k + 1]);
        let mut found: Vec<f64> = match self.interpolation {
            Interpolation::Smooth => (0..from.len()).map(|i| self.cubic(i, k, u)).collect(),
            _ => from.iter().zip(to).map(|(a, b)| a + (b - a) * u).collect(),
        };
        for start in &self.turns {
            let turned = match self.interpolation {
                Interpolation::Smooth => quaternion(&found, *start),
                _ => slerp(quaternion(from, *start), quaternion(to, *start), u),
            };
            put(&mut found, *start, turned.normalize_or(DVec4::W));
        }
        found
    }

    /// Number `i` at fraction `u` between key `k` and the next.
    fn cubic(&self, i: usize, k: usize, u: f64) -> f64 {
        let span = self.times[k + 1] - self.times[k];
        let (from, to) = (self.values[k][i], self.values[k + 1][i]);
        let [slope, next] = [self.slope(i, k), self.slope(i, k + 1)];
        let way = u * u * (3.0 - 2.0 * u);
        let ease = span * u * (1.0 - u) * ((1.0 - u) * slope - u * next);
        from + (to - from) * way + ease
    }

    fn slope(&self, i: usize, k: usize) -> f64 {
        if k == 0 || k + 1 == self.times.len() {
            return 0.0;
        }
        let span = |k: usize| self.times[k + 1] - self.times[k];
        let secant = |k: usize| (self.values[k + 1][i] - self.values[k][i]) / span(k);
        let (before, after) = (secant(k - 1), secant(k));
        if before * after <= 0.0 {
            return 0.0;
        }
        let weights = [2.0 * span(k) + span(k - 1), span(k) + 2.0 * span(k - 1)];
        (weights[0] + weights[1]) / (weights[0] / before + weights[1] / after)
    }
}

fn quaternion(values: &[f64], start: usize) -> DVec4 {
    DVec4::from_slice(&values[start..start + 4])
}

fn put(values: &mut [f64], start: usize, q: DVec4) {
    values[start..start + 4].copy_from_slice(&q.to_array());
}

/// Constant-speed interpolation between unit quaternions at most a right angle apart.
fn slerp(from: DVec4, to: DVec4, u: f64) -> DVec4 {
    let angle = libm::acos(from.dot(to).clamp(-1.0, 1.0));
    if angle < 1e-6 {
        return from + (to - from) * u;
    }
    let part = |u: f64| libm::sin(u * angle) / libm::sin(angle);
    from * part(1.0 - u) + to * part(u)
}
