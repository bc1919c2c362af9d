//! The radius schedule: the factor on all kernel radii in a pass.
//!
//! The average of passes converges if the variance of consecutive passes grows as (n + 1) / (n + alpha), 0 < alpha < 1
//! (Knaus and Zwicker 2011; Jarosz et al. 2011, progressive photon beams). A beam blurs over one dimension, so its
//! variance goes as one over its radius, and
//!
//! ```text
//! F(1) = 1,   F(n + 1) / F(n) = (n + alpha) / (n + 1),   F(n) = Gamma(n + alpha) / (Gamma(1 + alpha) Gamma(n + 1)).
//! ```

use crate::job::{Budget, JobSettings, ScheduleKind};

/// F(n) for real n >= 1 and alpha in (0, 1). F(1) is one; F falls as n^(alpha - 1).
pub fn radius_scale(n: f64, alpha: f64) -> f64 {
    gamma_ratio(n, alpha) / gamma_ratio(1.0, alpha)
}

/// Gamma(n + alpha) / Gamma(n + 1).
///
/// Uses Stirling's series (Abramowitz and Stegun 6.1.41) at an argument where four terms give all digits of an f64, and
/// the recurrence from there down to n. The difference of the two logarithms, each about n ln n, is never taken: what
/// they share is cancelled on paper.
fn gamma_ratio(n: f64, alpha: f64) -> f64 {
    let mut product = 1.0;
    let mut n = n;
    while n < 32.0 {
        product *= (n + 1.0) / (n + alpha);
        n += 1.0;
    }
    let (x, y, gap) = (n + alpha, n + 1.0, 1.0 - alpha);
    let correction = (x - 0.5) * libm::log1p(-gap / y) + gap + stirling(x) - stirling(y);
    product * libm::pow(y, -gap) * libm::exp(correction)
}

/// ln Gamma(z) - ((z - 1/2) ln z - z + ln(2 pi) / 2) for z >= 32.
fn stirling(z: f64) -> f64 {
    let w = 1.0 / (z * z);
    (1.0 / 12.0 - w * (1.0 / 360.0 - w * (1.0 / 1260.0 - w / 1680.0))) / z
}

/// The radius scales of a job's passes.
#[derive(Clone, Copy, Debug)]
pub struct Schedule {
    alpha: f64,
    /// The pass with index i has n = (i + 1) times this: one, or the number of paths.
    steps_per_pass: f64,
    /// Gamma ratio at the n that base radii are meant for.
    base: f64,
    budget: Option<Budget>,
}

impl Schedule {
    /// The schedule of these settings, which must pass [`JobSettings::check`].
    pub fn new(settings: &JobSettings) -> Self {
        let (steps_per_pass, base_steps) = match settings.schedule {
            ScheduleKind::Pass => (1.0, 1.0),
            ScheduleKind::Beam => (settings.paths_per_pass.into(), settings.reference_paths.into()),
        };
        Self {
            alpha: settings.alpha,
            steps_per_pass,
            base: gamma_ratio(base_steps, settings.alpha),
            budget: settings.budget,
        }
    }

    /// Scale of beam radii in a pass. Shrinking once per pass: R_i = F(i) with i = `pass_index` + 1, which is one for
    /// the first pass. Shrinking once per beam: F(i M) / F(M_ref), with M paths per pass and base radii meant for
    /// M_ref. With a budget of N passes at the scale c: c for i <= N, and c F(i) / F(N) from there on.
    pub fn scale(&self, pass_index: u64) -> f64 {
        if let Some(Budget { passes, scale }) = self.budget {
            let n = (pass_index + 1).max(passes) as f64;
            return scale * (gamma_ratio(n, self.alpha) / gamma_ratio(passes as f64, self.alpha));
        }
        let n = (pass_index as f64 + 1.0) * self.steps_per_pass;
        gamma_ratio(n, self.alpha) / self.base
    }

    /// Scale of the radii of surface photons in a pass: they blur over two dimensions, so their area takes the scale.
    pub fn surface_scale(&self, pass_index: u64) -> f64 {
        self.scale(pass_index).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{EngineKind, Techniques};

    const ALPHAS: [f64; 4] = [0.1, 0.5, 2.0 / 3.0, 0.9];

    fn settings(schedule: ScheduleKind, alpha: f64, paths_per_pass: u32) -> JobSettings {
        JobSettings {
            seed: 0,
            alpha,
            schedule,
            budget: None,
            paths_per_pass,
            reference_paths: 1,
            techniques: Techniques::default(),
            engine: EngineKind::default(),
        }
    }

    fn relative_error(value: f64, expected: f64) -> f64 {
        ((value - expected) / expected).abs()
    }

    /// F(n) by its recurrence in integers, with a mantissa of 70 bits or more, so that 10^6 steps lose less than 1e-14.
    fn product(n: u64, alpha: f64) -> f64 {
        const ONE: u128 = 1 << 71;
        const UNIT: u32 = 56;
        let gap = (1u128 << UNIT) - (alpha * (1u64 << UNIT) as f64) as u128;
        let (mut mantissa, mut exponent) = (ONE, 0);
        for k in 1..u128::from(n) {
            let divisor = (k + 1) << UNIT;
            mantissa -= (mantissa * gap + divisor / 2) / divisor;
            while mantissa < ONE / 2 {
                mantissa *= 2;
                exponent -= 1;
            }
        }
        mantissa as f64 / ONE as f64 * libm::ldexp(1.0, exponent)
    }

    #[test]
    fn scale_is_the_product() {
        for alpha in ALPHAS {
            for n in [1, 2, 3, 10, 31, 32, 33, 1000, 1_000_000] {
                let error = relative_error(radius_scale(n as f64, alpha), product(n, alpha));
                assert!(error < 1e-13, "F({n}), alpha = {alpha}: relative error {error:e}");
            }
        }
    }

    /// n^(alpha - 1) / Gamma(1 + alpha) (1 + (alpha - 1) alpha / 2n + ...), DLMF 5.11.13. Constants from tables.
    #[test]
    fn scale_is_its_asymptote_far_out() {
        let gammas = [
            0.951_350_769_866_873_1,
            std::f64::consts::PI.sqrt() / 2.0,
            0.902_745_292_950_933_6,
            0.961_765_831_907_387_4,
        ];
        let powers = [1.584_893_192_461_113_5e-11, 1e-6, 1e-4, 0.063_095_734_448_019_32];
        for ((alpha, gamma), power) in ALPHAS.into_iter().zip(gammas).zip(powers) {
            let expected = power / gamma * (1.0 + (alpha - 1.0) * alpha / 2e12);
            let error = relative_error(radius_scale(1e12, alpha), expected);
            assert!(error < 1e-13, "alpha = {alpha}: relative error {error:e}");
        }
    }

    #[test]
    fn variance_grows_as_the_theory_asks() {
        let small = 1..5000u64;
        let large = (0..400).map(|k| 5000 + k * k * k * 1000);
        for n in small.chain(large) {
            for alpha in ALPHAS {
                let schedule = Schedule::new(&settings(ScheduleKind::Pass, alpha, 1));
                // Pass i = n has the index n - 1.
                let ratio = schedule.scale(n - 1) / schedule.scale(n);
                let expected = (n as f64 + 1.0) / (n as f64 + alpha);
                assert!(relative_error(ratio, expected) < 1e-13, "n = {n}, alpha = {alpha}");
            }
        }
    }

    #[test]
    fn scale_of_real_arguments_keeps_the_recurrence() {
        for n in [1.0, 1.25, 31.5, 100.75] {
            let ratio = radius_scale(n + 1.0, 0.4) / radius_scale(n, 0.4);
            assert!(relative_error(ratio, (n + 0.4) / (n + 1.0)) < 1e-13);
        }
    }

    #[test]
    fn first_pass_has_scale_one() {
        for alpha in ALPHAS {
            for paths in [1, 15, 100_000] {
                assert_eq!(Schedule::new(&settings(ScheduleKind::Pass, alpha, paths)).scale(0), 1.0);
                let mut per_beam = settings(ScheduleKind::Beam, alpha, paths);
                per_beam.reference_paths = paths;
                assert_eq!(Schedule::new(&per_beam).scale(0), 1.0);
            }
        }
    }

    #[test]
    fn schedules_by_beam_lie_on_one_curve() {
        let schedule = |kind, paths| Schedule::new(&settings(kind, 0.5, paths));
        // After 300 k beams: pass 300 k with M = 1, pass 20 k with M = 15, pass 3 k with M = 100.
        for k in 1..2000u64 {
            let by_beam = |paths: u32| schedule(ScheduleKind::Beam, paths).scale(300 * k / u64::from(paths) - 1);
            assert_eq!(by_beam(1), by_beam(15));
            assert_eq!(by_beam(1), by_beam(100));
        }
        let by_pass = |paths: u32| schedule(ScheduleKind::Pass, paths).scale(300 / u64::from(paths) - 1);
        assert!(by_pass(15) > 2.0 * by_pass(1));
    }

    #[test]
    fn scale_falls_strictly_and_stays_positive() {
        let schedule = Schedule::new(&settings(ScheduleKind::Beam, 0.001, u32::MAX));
        let scales: Vec<f64> = (0..53).map(|k| schedule.scale((1 << k) - 1)).collect();
        assert!(scales.windows(2).all(|pair| pair[1] < pair[0] && pair[1] > 0.0));
    }

    #[test]
    fn a_budget_is_constant_and_shrinks_beyond() {
        let mut settings = settings(ScheduleKind::Beam, 0.6, 10);
        settings.budget = Some(Budget { passes: 40, scale: 0.3 });
        let schedule = Schedule::new(&settings);
        assert!((0..40).all(|pass_index| schedule.scale(pass_index) == 0.3));
        // The last pass of the budget has F(40).
        for n in [41.0, 42.0, 1e3, 1e6] {
            let expected = 0.3 * radius_scale(n, 0.6) / radius_scale(40.0, 0.6);
            assert!(relative_error(schedule.scale(n as u64 - 1), expected) < 1e-13);
        }
    }

    #[test]
    fn surface_scale_is_the_root() {
        let schedule = Schedule::new(&settings(ScheduleKind::Pass, 0.5, 1));
        assert!(relative_error(schedule.surface_scale(7) * schedule.surface_scale(7), schedule.scale(7)) < 1e-15);
    }
}
