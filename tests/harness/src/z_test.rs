//! Means of samples, their standard errors, and tests of them.

/// Mean and variance of a stream of values (Welford 1962).
#[derive(Clone, Copy, Debug, Default)]
pub struct MeanEstimate {
    count: u64,
    mean: f64,
    squares: f64,
}

impl MeanEstimate {
    /// An empty estimate.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a value.
    pub fn add(&mut self, x: f64) {
        self.count += 1;
        let delta = x - self.mean;
        self.mean += delta / self.count as f64;
        self.squares += delta * (x - self.mean);
    }

    /// How many values there are.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Mean of the values; 0 when there are none.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Unbiased variance of one value; NaN for fewer than two values.
    pub fn variance(&self) -> f64 {
        if self.count < 2 {
            return f64::NAN;
        }
        self.squares / (self.count - 1) as f64
    }

    /// Standard error of the mean; NaN for fewer than two values.
    pub fn std_error(&self) -> f64 {
        (self.variance() / self.count as f64).sqrt()
    }

    /// Two-sided p-value of the mean being `expected`. Where all values are equal, a relative rounding error of 1e-6 is
    /// tolerated.
    pub fn p_value(&self, expected: f64) -> f64 {
        self.p_value_within(expected, 0.0)
    }

    /// Two-sided p-value of the mean differing from `expected` by no more than this share of it.
    pub fn p_value_within(&self, expected: f64, share: f64) -> f64 {
        let off = beyond(self.mean - expected, share * expected);
        p_value(off, self.std_error(), expected)
    }

    /// Two-sided p-value of two independent estimates having the same mean.
    pub fn p_value_same(&self, other: &Self) -> f64 {
        self.p_value_same_within(other, 0.0)
    }

    /// Two-sided p-value of two independent means differing by no more than this share of the other's.
    pub fn p_value_same_within(&self, other: &Self, share: f64) -> f64 {
        let error = self.std_error().hypot(other.std_error());
        let off = beyond(self.mean - other.mean, share * other.mean);
        p_value(off, error, other.mean)
    }
}

impl FromIterator<f64> for MeanEstimate {
    fn from_iter<T: IntoIterator<Item = f64>>(values: T) -> Self {
        let mut estimate = Self::new();
        values.into_iter().for_each(|x| estimate.add(x));
        estimate
    }
}

/// Probability that a standard normal variable is at least as far from zero as `z`.
pub fn two_sided(z: f64) -> f64 {
    libm::erfc(z.abs() * std::f64::consts::FRAC_1_SQRT_2)
}

/// The part of a difference beyond the allowance. NaN stays NaN.
fn beyond(difference: f64, allowed: f64) -> f64 {
    let off = difference.abs() - allowed.abs();
    if off < 0.0 { 0.0 } else { off }
}

/// No standard error covers the rounding errors of single-precision values: they are allowed for as an independent
/// error of 1e-7 of the mean.
fn p_value(difference: f64, std_error: f64, scale: f64) -> f64 {
    let error = std_error.hypot(1e-7 * scale.abs());
    if error == 0.0 {
        return if difference == 0.0 { 1.0 } else { 0.0 };
    }
    two_sided(difference / error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_variance_of_known_values() {
        let estimate: MeanEstimate = [2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0].into_iter().collect();
        assert_eq!(estimate.mean(), 5.0);
        assert!((estimate.variance() - 32.0 / 7.0).abs() < 1e-12);
    }

    #[test]
    fn a_share_is_taken_off_the_difference() {
        let estimate: MeanEstimate = [9.0, 10.0, 11.0, 12.0].into_iter().collect();
        let same = |off: f64, share| estimate.p_value_within(10.5 - off, share);
        assert_eq!(same(0.1, 0.0), estimate.p_value(10.4));
        assert_eq!(same(0.1, 0.01), 1.0);
        assert!((same(1.5, 0.1) - two_sided(0.6 / estimate.std_error())).abs() < 1e-6);
        assert!(estimate.p_value_within(f64::NAN, 0.1).is_nan());
    }

    #[test]
    fn p_values_of_known_quantiles() {
        assert!((two_sided(1.959_963_984_540_054) - 0.05).abs() < 1e-12);
        assert!((two_sided(-3.290_526_731_491_926) - 0.001).abs() < 1e-12);
        let constant: MeanEstimate = [1.0, 1.0, 1.0].into_iter().collect();
        assert_eq!(constant.p_value(1.0), 1.0);
        assert!(constant.p_value(1.001) < 1e-9);
        assert!(constant.p_value(f64::NAN).is_nan());
    }
}
