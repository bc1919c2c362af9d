//! How a value depends on the radius: least squares over passes, for each exponent with which the bias may grow.

use super::BIAS_EXPONENTS;
use super::sums::{EXPONENTS, RadiusSums, Sums};

/// Index of the middle exponent, which finds growth with another exponent almost as well.
const MIDDLE: usize = 1;
/// With this many own pairs of passes, a tile's own pairs count as much as those of all tiles for how its noise changes
/// with the radius.
const OWN_PAIRS: f64 = 256.0;
/// Radius scales with a relative variance below this count as equal.
const EQUAL: f64 = 1e-9;

/// The bias of the average if it grows with one power of the radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// The bias.
    pub bias: f64,
    /// Its standard error; infinite if nothing is known.
    pub standard_error: f64,
}

impl Fit {
    const UNKNOWN: Self = Self {
        bias: 0.0,
        standard_error: f64::INFINITY,
    };

    fn z(&self) -> f64 {
        match self.bias == 0.0 {
            true => 0.0,
            false => self.bias / self.standard_error,
        }
    }
}

/// How far the mean of a value over passes deviates from the truth because of the radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BiasEstimate {
    /// Mean of the value.
    pub mean: f64,
    /// Its bias, to be subtracted for an estimate of the truth: the mean of what each of [`BIAS_EXPONENTS`] says,
    /// weighted by how well it explains the passes.
    pub bias: f64,
    /// Standard error of the bias, including the uncertainty of the exponent; infinite if nothing is known.
    pub standard_error: f64,
    /// The result for each exponent.
    pub fits: [Fit; BIAS_EXPONENTS.len()],
    /// Probability that noise alone looks at least as much like a bias.
    pub p_value: f64,
}

impl BiasEstimate {
    /// The least bias that is found almost always (five times in six): three standard errors, for any exponent.
    pub fn least_seen(&self) -> f64 {
        let errors = self.fits.iter().map(|fit| fit.standard_error);
        3.0 * errors.fold(0.0, f64::max)
    }
}

/// The radius scales of some passes.
pub(super) struct Scales {
    passes: f64,
    /// Number of pairs of alike passes; means over them of R and of 1 / R.
    pairs: f64,
    pair_mean: f64,
    pair_inverse: f64,
    /// Number of the other pairs; sums over them of differences of R^p.
    unlike: f64,
    steps: [f64; BIAS_EXPONENTS.len()],
    sums: [f64; EXPONENTS.len()],
}

/// Model of the noise: a pass's variance is proportional to flat + kernel / R, which is one on average.
#[derive(Clone, Copy)]
struct Noise {
    flat: f64,
    kernel: f64,
}

/// Sums over passes of u^2, u w and w^2, with u = R - mean R and w = R^2 - mean R^2, times a common weight.
#[derive(Clone, Copy)]
struct Products {
    uu: f64,
    uw: f64,
    ww: f64,
}

impl Scales {
    pub fn new(sums: &RadiusSums, passes: u64) -> Self {
        let [pairs, r, inverse] = sums.alike;
        let [unlike, steps @ ..] = sums.unlike;
        Self {
            passes: passes as f64,
            pairs,
            pair_mean: r / pairs,
            pair_inverse: inverse / pairs,
            unlike,
            steps,
            sums: sums.scales,
        }
    }

    /// Mean of R^e.
    fn mean(&self, exponent: f64) -> f64 {
        let sums = EXPONENTS.iter().zip(self.sums);
        let found = sums.filter(|(e, _)| **e == exponent).map(|(_, sum)| sum);
        match exponent == 0.0 {
            true => 1.0,
            false => found.sum::<f64>() / self.passes,
        }
    }

    /// Whether all passes have practically the same radii.
    pub fn are_equal(&self) -> bool {
        let (r, rr) = (self.mean(1.0), self.mean(2.0));
        let variance = rr - r * r;
        variance.is_nan() || variance <= EQUAL * rr
    }

    /// Products for passes weighted by R^e, with e 0 or -1; per pass.
    fn products(&self, e: f64) -> Products {
        let (r, rr) = (self.mean(1.0), self.mean(2.0));
        let m = |exponent: f64| self.mean(exponent + e);
        Products {
            uu: m(2.0) - 2.0 * r * m(1.0) + r * r * m(0.0),
            uw: m(3.0) - r * m(2.0) - rr * m(1.0) + r * rr * m(0.0),
            ww: m(4.0) - 2.0 * rr * m(2.0) + rr * rr * m(0.0),
        }
    }

    /// Mean of R over pairs, weighted by their squared differences; none if all of these are zero.
    fn noisy_scale(sums: &Sums) -> Option<f64> {
        let [_, _, _, d2, d2_r, ..] = *sums;
        (d2 > 0.0).then(|| d2_r / d2)
    }

    /// The mean of that over many values.
    pub fn mean_noisy_scale<'a>(&self, all: impl Iterator<Item = &'a Sums>) -> f64 {
        let (sum, count) = all
            .filter_map(Self::noisy_scale)
            .fold((0.0, 0.0), |(sum, count), scale| (sum + scale, count + 1.0));
        match count > 0.0 {
            true => sum / count,
            false => self.pair_mean,
        }
    }

    /// How the variance of passes changes with the radius. `noisy_scale`: [`Self::mean_noisy_scale`] of many values.
    fn noise(&self, sums: &Sums, noisy_scale: f64) -> Noise {
        let own = Self::noisy_scale(sums).unwrap_or(noisy_scale);
        let weight = self.pairs / (self.pairs + OWN_PAIRS);
        let noisy_scale = weight * own + (1.0 - weight) * noisy_scale;
        // The mean of that scale is the mean of R if the variance is flat, and the harmonic mean of R if it goes as 1 /
        // R.
        let (arithmetic, harmonic) = (self.pair_mean, 1.0 / self.pair_inverse);
        let kernel = (arithmetic - noisy_scale) / (arithmetic - harmonic);
        let kernel = match kernel.is_nan() {
            true => 0.0,
            false => kernel.clamp(0.0, 1.0),
        };
        Noise {
            flat: 1.0 - kernel,
            kernel: kernel * harmonic,
        }
    }

    /// The estimate with the smallest variance among sums over passes of (alpha u + beta w) x that give one for x =
    /// R^p. Its standard error is for noise of variance one.
    fn fit(&self, sums: &Sums, noise: Noise, exponent: f64) -> Fit {
        let [x, r_x, rr_x, ..] = sums.map(|sum| sum / self.passes);
        let (r, rr) = (self.mean(1.0), self.mean(2.0));
        let m = |plus: f64| self.mean(exponent + plus);
        // Products of R^p and of x with u and w.
        let (u, w) = (m(1.0) - r * m(0.0), m(2.0) - rr * m(0.0));
        let (u_x, w_x) = (r_x - r * x, rr_x - rr * x);
        let (flat, kernel) = (self.products(0.0), self.products(-1.0));
        let sum = |f: f64, k: f64| noise.flat * f + noise.kernel * k;
        let (uu, uw, ww) = (
            sum(flat.uu, kernel.uu),
            sum(flat.uw, kernel.uw),
            sum(flat.ww, kernel.ww),
        );
        let determinant = uu * ww - uw * uw;
        let (mut alpha, mut beta) = (ww * u - uw * w, uu * w - uw * u);
        if determinant.is_nan() || determinant <= EQUAL * uu * ww {
            // With two scales, for example: u and w are equal up to a factor.
            (alpha, beta) = (1.0, 0.0);
        }
        let gain = alpha * u + beta * w;
        let (alpha, beta) = (alpha / gain, beta / gain);
        let variance = alpha * alpha * uu + 2.0 * alpha * beta * uw + beta * beta * ww;
        Fit {
            bias: (alpha * u_x + beta * w_x) * m(0.0),
            standard_error: (variance.max(0.0) / self.passes).sqrt() * m(0.0).abs(),
        }
    }

    /// Degrees of freedom of a bias over its standard error, from the sums of the pairs' second and fourth powers.
    fn freedom(&self, d2: f64, d4: f64) -> f64 {
        if d4 <= 0.0 {
            return self.pairs;
        }
        // If a few wild pairs make up most of the variance, little is known about it: fewer degrees than pairs, and two
        // if there is only one such pair.
        let known = (3.0 * d2 * d2 / d4 - 1.0).clamp(1.0, self.pairs);
        // The bias depends on the first passes, so it is as wild as they are: take the Student distribution of the same
        // kurtosis.
        let pairs = self.pairs + self.unlike;
        let pass_excess = 2.0 * (pairs * d4 / (d2 * d2) - 3.0);
        let excess = pass_excess.max(0.0) * self.leverage();
        known.min(4.0 + 6.0 / excess)
    }

    /// Sum over passes of u^4 over the squared sum of u^2: one if a single pass decides.
    fn leverage(&self) -> f64 {
        let [r, r2, r3, r4] = [1.0, 2.0, 3.0, 4.0].map(|e| self.mean(e));
        let fourth = r4 - 4.0 * r * r3 + 6.0 * r * r * r2 - 3.0 * r * r * r * r;
        let second = r2 - r * r;
        fourth / (second * second) / self.passes
    }

    /// The bias of a value. `noisy_scale`: [`Self::mean_noisy_scale`] of many values.
    pub fn estimate(&self, sums: &Sums, noisy_scale: f64) -> BiasEstimate {
        let [x, _, _, d2, _, d4, d] = *sums;
        let mean = x / self.passes;
        if self.are_equal() || self.pairs == 0.0 {
            return BiasEstimate {
                mean,
                bias: 0.0,
                standard_error: f64::INFINITY,
                fits: [Fit::UNKNOWN; BIAS_EXPONENTS.len()],
                p_value: 1.0,
            };
        }
        let noise = self.noise(sums, noisy_scale);
        let mut fits = BIAS_EXPONENTS.map(|exponent| self.fit(sums, noise, exponent));
        // The first passes count with what the best fit leaves of their differences: a firefly there is no bias.
        let fitted = fits.iter().zip(BIAS_EXPONENTS).zip(self.steps);
        let left = fitted.map(|((fit, p), step)| (d - fit.bias / self.mean(p) * step).abs());
        let left = left.fold(f64::INFINITY, f64::min);
        let (all_d2, all_d4) = (d2 + left * left, d4 + left * left * left * left);
        let of_all = all_d2 / (2.0 * (self.pairs + self.unlike));
        let deviation = of_all.max(d2 / (2.0 * self.pairs)).sqrt();
        // Rounding is not a bias.
        let rounding = 1e-6 * mean.abs();
        for fit in &mut fits {
            fit.standard_error *= deviation;
            if fit.bias.abs() <= rounding && fit.standard_error <= rounding {
                fit.bias = 0.0;
            }
        }
        let (bias, standard_error) = average(&fits);
        let freedom = self.freedom(all_d2, all_d4);
        BiasEstimate {
            mean,
            bias,
            standard_error,
            fits,
            p_value: p_value(fits[MIDDLE].z(), freedom),
        }
    }
}

/// Mean and standard error over exponents, weighted by likelihood: a fit's log-likelihood exceeds that of no bias by
/// z^2 / 2.
fn average(fits: &[Fit; BIAS_EXPONENTS.len()]) -> (f64, f64) {
    let logs = fits.map(|fit| 0.5 * fit.z() * fit.z());
    let most = logs.iter().copied().fold(0.0, f64::max);
    let weights = logs.map(|log| match log == most {
        true => 1.0,
        false => libm::exp(log - most),
    });
    let total: f64 = weights.iter().sum();
    let over = |value: &dyn Fn(&Fit) -> f64| {
        let values = fits.iter().map(value);
        values.zip(weights).map(|(v, w)| v * w).sum::<f64>() / total
    };
    let bias = over(&|fit| fit.bias);
    let variance = over(&|fit| {
        let off = fit.bias - bias;
        fit.standard_error * fit.standard_error + off * off
    });
    (bias, variance.sqrt())
}

/// Probability that Student's t with this many degrees of freedom is at least as far from zero, by the equally unlikely
/// normal deviate (Wallace 1959).
fn p_value(t: f64, freedom: f64) -> f64 {
    let spread = (freedom * libm::log1p(t * t / freedom)).sqrt();
    let z = (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0) * spread;
    libm::erfc(z * std::f64::consts::FRAC_1_SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values from tables of Student's distribution.
    #[test]
    fn tails_are_those_of_students_distribution() {
        for (t, freedom, p) in [
            (2.306, 8.0, 0.05),
            (5.041, 8.0, 0.001),
            (2.042, 30.0, 0.05),
            (3.646, 30.0, 0.001),
            (1.96, 1e9, 0.05),
        ] {
            let found = p_value(t, freedom);
            assert!((found / p - 1.0).abs() < 0.05, "{found} for {p}");
        }
        // With few degrees, too large rather than too small.
        assert!((0.05..0.07).contains(&p_value(12.706, 1.0)));
        assert_eq!(p_value(0.0, 3.0), 1.0);
        assert_eq!(p_value(f64::INFINITY, 3.0), 0.0);
    }
}
