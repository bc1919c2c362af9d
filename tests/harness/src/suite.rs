//! Many statistical tests with one significance for all of them together.

use crate::chi2::Chi2Result;
use crate::render::Blocks;
use crate::z_test::MeanEstimate;

/// Share of samples of zero density that is accepted as rounding.
const MAX_IMPOSSIBLE: f64 = 1e-4;

/// Significance of each of this many tests, such that all of them pass with probability `1 - significance` if
/// everything is right (Šidák 1967): 1 - (1 - significance)^(1 / tests), without cancellation.
pub fn sidak(significance: f64, tests: usize) -> f64 {
    -libm::expm1(libm::log1p(-significance) / tests.max(1) as f64)
}

/// Collects p-values and judges them together. The bound on each p-value is corrected after Šidák, so that all tests
/// pass with probability `1 - significance` if everything is right.
#[derive(Debug)]
pub struct Suite {
    significance: f64,
    p_values: Vec<(String, f64)>,
    failures: Vec<String>,
}

impl Suite {
    /// An empty suite. `significance` in (0, 1): the probability of a false alarm, 0.01 for most.
    pub fn new(significance: f64) -> Self {
        Self {
            significance,
            p_values: Vec::new(),
            failures: Vec::new(),
        }
    }

    /// Adds a p-value. One that is not in [0, 1] (NaN, for example) fails the suite.
    pub fn p_value(&mut self, name: impl Into<String>, p: f64) {
        let name = name.into();
        if (0.0..=1.0).contains(&p) {
            self.p_values.push((name, p));
        } else {
            self.failures.push(format!("{name}: p-value {p}"));
        }
    }

    /// Adds a chi-square test. Besides its p-value, more than a few samples of zero density, or a density that
    /// integrates to more than one, fail the suite.
    pub fn chi2(&mut self, name: impl Into<String>, result: &Chi2Result) {
        let name = name.into();
        if result.impossible > MAX_IMPOSSIBLE {
            self.failures.push(format!(
                "{name}: the density is zero, negative or not finite for {:e} of the samples",
                result.impossible
            ));
        }
        if result.integral.is_nan() || result.integral > 1.0 + 1e-3 {
            self.failures
                .push(format!("{name}: the density integrates to {}", result.integral));
        }
        self.p_value(
            format!("{name} (chi2 = {:.1}, {} dof)", result.statistic, result.dof),
            result.p_value,
        );
    }

    /// Adds a z-test of a mean against its known value.
    pub fn mean(&mut self, name: impl Into<String>, estimate: &MeanEstimate, expected: f64) {
        self.mean_within(name, estimate, expected, 0.0);
    }

    /// The same, for a mean that may be off by a share of its value.
    pub fn mean_within(&mut self, name: impl Into<String>, estimate: &MeanEstimate, expected: f64, share: f64) {
        self.p_value(
            format!(
                "{} (mean {:e} +- {:e}, expected {expected:e})",
                name.into(),
                estimate.mean(),
                estimate.std_error()
            ),
            estimate.p_value_within(expected, share),
        );
    }

    /// Adds a z-test of two estimates of the same mean.
    pub fn same_mean(&mut self, name: impl Into<String>, a: &MeanEstimate, b: &MeanEstimate) {
        self.same_mean_within(name, a, b, 0.0);
    }

    /// The same, for means that may differ by a share of the second.
    pub fn same_mean_within(&mut self, name: impl Into<String>, a: &MeanEstimate, b: &MeanEstimate, share: f64) {
        self.p_value(
            format!(
                "{} (means {:e} +- {:e} and {:e} +- {:e})",
                name.into(),
                a.mean(),
                a.std_error(),
                b.mean(),
                b.std_error()
            ),
            a.p_value_same_within(b, share),
        );
    }

    /// Adds z-tests of two pictures of the same scene: every channel of every block and of the whole. Means may differ
    /// by a share of the second's.
    ///
    /// # Panics
    /// If the pictures have different numbers of blocks, or are black.
    #[track_caller]
    pub fn same_blocks(&mut self, name: &str, a: &Blocks, b: &Blocks, share: f64) {
        assert_eq!(a.blocks.len(), b.blocks.len(), "{name}");
        assert!(b.whole.iter().any(|mean| mean.mean() != 0.0), "{name}: black");
        let blocks = a.blocks.iter().zip(&b.blocks).enumerate();
        let blocks = blocks.map(|(i, both)| (format!("block {i}"), both));
        for (part, (a, b)) in blocks.chain([("all".to_owned(), (&a.whole, &b.whole))]) {
            for c in 0..3 {
                let name = format!("{name}, {part}, channel {c}");
                self.same_mean_within(name, &a[c], &b[c], share);
            }
        }
    }

    /// The tests that failed, one per line; empty when all passed.
    pub fn failures(&self) -> Vec<String> {
        let bound = sidak(self.significance, self.p_values.len());
        let mut failures = self.failures.clone();
        for (name, p) in &self.p_values {
            if *p < bound {
                failures.push(format!("{name}: p = {p:e} < {bound:e}"));
            }
        }
        failures
    }

    /// Panics with the list of failed tests, if any failed or if nothing was tested.
    #[track_caller]
    pub fn finish(self) {
        assert!(!self.p_values.is_empty(), "nothing was tested");
        let failures = self.failures();
        assert!(
            failures.is_empty(),
            "{} of {} tests failed at significance {}:\n{}",
            failures.len(),
            self.p_values.len(),
            self.significance,
            failures.join("\n")
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bound_is_sidak_corrected() {
        let mut suite = Suite::new(0.01);
        for i in 0..100 {
            // The bound is 1.005e-4 for 100 tests.
            suite.p_value(format!("{i}"), if i == 7 { 1.004e-4 } else { 1.006e-4 });
        }
        assert_eq!(suite.failures().len(), 1);
    }

    #[test]
    fn nan_fails() {
        let mut suite = Suite::new(0.01);
        suite.p_value("nan", f64::NAN);
        assert_eq!(suite.failures().len(), 1);
    }
}
