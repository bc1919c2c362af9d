//! Epanechnikov's kernel, which spreads photons and beams: 1 - x^2 within its radius, where x is the distance over the
//! radius.

use crate::math::Vec2;

/// On a line across a beam, in units of 1/radius: to be divided by the radius. `x2`: square of x.
#[inline(always)]
pub(crate) fn on_line(x2: f32) -> f32 {
    0.75 * (1.0 - x2)
}

/// On a disc, per area. `x2`: square of x; `area`: of the disc.
#[inline(always)]
pub(crate) fn on_disc(x2: f32, area: f32) -> f32 {
    2.0 / area * (1.0 - x2)
}

/// A point on a line, -1 to 1, from three uniform numbers: their median has this density.
pub(super) fn sample_line(u: Vec2, v: f32) -> f32 {
    let median = u.x.max(u.y).min(u.x.min(u.y).max(v));
    2.0 * median - 1.0
}

/// Distance from a disc's centre, 0 to 1, from a uniform number.
pub(super) fn sample_disc(u: f32) -> f32 {
    (1.0 - (1.0 - u).sqrt()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Purpose, Sampler};
    use std::f32::consts::PI;

    /// Checked by the midpoint rule.
    #[test]
    fn both_integrate_to_one() {
        let steps = 10_000;
        let middles = (0..steps).map(|i| (i as f32 + 0.5) / steps as f32);
        let [line, disc] = middles.fold([0.0f64; 2], |[line, disc], x| {
            let ring = 2.0 * PI * x;
            [
                line + f64::from(2.0 * on_line(x * x)),
                disc + f64::from(ring * on_disc(x * x, PI)),
            ]
        });
        for sum in [line, disc] {
            assert!((sum / f64::from(steps) - 1.0).abs() < 1e-5, "{sum}");
        }
    }

    /// The squares of drawn positions have the kernels' means, 1/5 and 1/3, and their fourth powers 3/35 and 1/6,
    /// within four standard errors.
    #[test]
    fn places_are_drawn_by_them() {
        let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
        let n = 100_000;
        let mut sums = [[0.0f64; 2]; 2];
        for _ in 0..n {
            let (u, v) = (sampler.next_2d(), sampler.next_2d());
            for (sum, x) in sums.iter_mut().zip([sample_line(u, v.x), sample_disc(v.y)]) {
                let x2 = f64::from(x * x);
                *sum = [sum[0] + x2, sum[1] + x2 * x2];
            }
        }
        for ([mean, square], expected) in sums.into_iter().zip([[1.0 / 5.0, 3.0 / 35.0], [1.0 / 3.0, 1.0 / 6.0]]) {
            let [mean, square] = [mean, square].map(|sum| sum / f64::from(n));
            let error = libm::sqrt((expected[1] - expected[0] * expected[0]) / f64::from(n));
            assert!((mean - expected[0]).abs() < 4.0 * error, "{mean} {expected:?}");
            // For numbers up to one, fourth powers vary less than squares.
            assert!((square - expected[1]).abs() < 4.0 * error, "{square} {expected:?}");
        }
    }
}
