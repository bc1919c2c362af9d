//! Does the average of passes converge as its theory says? One pixel is rendered repeatedly with different seeds and
//! compared with the theory.
//!
//! With radii scaled by R_i in pass i, a pass has the variance c / R_i and the bias b R_i (Knaus and Zwicker 2011;
//! Jarosz et al. 2011, progressive photon beams). What follows for the average of N passes is computed from the
//! schedule itself: the variance c / N^2 sum 1 / R_i falls as N^-alpha, and the bias b / N sum R_i falls as N^(alpha -
//! 1).

use crate::cpu::pass::render_pass;
use crate::parallel;
use crate::plan::RenderPlan;
use crate::plan::engine::NoPass;
use crate::sampler::mix64;
use crate::world::Scene;
use beamfarm_image::film::Film;
use beamfarm_image::job::JobSettings;
use beamfarm_image::radius::Schedule;

/// Mean and variance of a value over runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments {
    /// The mean.
    pub mean: f64,
    /// Unbiased variance of a single value.
    pub variance: f64,
}

impl Moments {
    fn of(values: impl Iterator<Item = f64> + Clone, count: usize) -> Self {
        let n = count as f64;
        let mean = values.clone().sum::<f64>() / n;
        let squares: f64 = values.map(|v| (v - mean) * (v - mean)).sum();
        let variance = squares / (n - 1.0);
        Self { mean, variance }
    }
}

/// Repeated runs of one pixel under one schedule.
#[derive(Clone, Debug)]
pub struct Runs {
    /// The schedule's trade of variance against bias.
    pub alpha: f64,
    /// Radius scale by pass.
    pub scales: Vec<f64>,
    /// By run: the pixel's value in each pass, the mean of its channels.
    pub values: Vec<Vec<f64>>,
}

impl Runs {
    /// Renders a scene of one pixel (see [`Camera::pixel`](crate::world::camera::Camera::pixel)) `runs` times, with
    /// `passes` passes each. Their photon paths are independent of each other. Seeds follow from the settings' seed,
    /// alpha and the number of the run.
    pub fn render(scene: &Scene, settings: JobSettings, passes: u64, runs: u64) -> Result<Self, NoPass> {
        let run = |number: usize| {
            let plan = Self::plan(scene, settings, number as u64);
            let value = |pass_index| Ok(Self::value(&render_pass(scene, &plan, pass_index)?.film));
            (0..passes).map(value).collect()
        };
        let values: Result<_, NoPass> = parallel::map(runs as usize, run).into_iter().collect();
        Ok(Self::of_values(&settings, values?))
    }

    /// The plan of a run's passes.
    pub fn plan(scene: &Scene, settings: JobSettings, run: u64) -> RenderPlan {
        let key = mix64(settings.seed) ^ settings.alpha.to_bits();
        let seed = mix64(mix64(key) ^ run);
        let mut plan = RenderPlan::new(scene, JobSettings { seed, ..settings });
        plan.is_even = false;
        plan
    }

    /// The value of a pass: the mean of the channels of its first pixel.
    pub fn value(film: &Film) -> f64 {
        let pixel = film.pixels.first().copied().unwrap_or_default();
        pixel.iter().map(|v| f64::from(*v)).sum::<f64>() / 3.0
    }

    /// From runs rendered elsewhere: [`Self::values`], with equally many passes each.
    pub fn of_values(settings: &JobSettings, values: Vec<Vec<f64>>) -> Self {
        let schedule = Schedule::new(settings);
        let passes = values.first().map_or(0, Vec::len) as u64;
        Self {
            alpha: settings.alpha,
            scales: (0..passes).map(|i| schedule.scale(i)).collect(),
            values,
        }
    }

    /// By pass: moments of the pixel in that pass alone.
    pub fn of_passes(&self) -> Vec<Moments> {
        let of = |i| Moments::of(self.values.iter().map(move |run| run[i]), self.values.len());
        (0..self.scales.len()).map(of).collect()
    }

    /// The same runs, with the running average up to each pass as its value.
    pub fn averaged(&self) -> Self {
        let average = |run: &Vec<f64>| {
            let mut sum = 0.0;
            let add = |(i, value): (usize, &f64)| {
                sum += value;
                sum / (i + 1) as f64
            };
            run.iter().enumerate().map(add).collect()
        };
        Self {
            values: self.values.iter().map(average).collect(),
            ..self.clone()
        }
    }
}

/// What the theory says, given its constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Theory {
    /// The limit of the average.
    pub truth: f64,
    /// b: bias of a pass at radius scale one.
    pub bias: f64,
    /// c: variance of a pass at radius scale one.
    pub variance: f64,
}

/// Variance and bias of a pass, and of the average of all passes up to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Variance of the pass.
    pub variance: f64,
    /// Bias of the pass.
    pub bias: f64,
    /// Variance of the average.
    pub average_variance: f64,
    /// Bias of the average.
    pub average_bias: f64,
}

impl Theory {
    /// The constants that fit best, shared by all schedules: they belong to the first pass, whose radii have the scale
    /// one for any alpha. Least squares, with passes weighted by one over their variance. Without a known truth, the
    /// pass means are extrapolated to radius zero.
    pub fn fit(all: &[Runs], truth: Option<f64>) -> Self {
        let (mut count, mut variance) = (0.0, 0.0);
        // Sums of weights times powers of R, and times the mean.
        let (mut w, mut wr, mut wrr, mut wm, mut wrm) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for runs in all {
            for (moments, r) in runs.of_passes().into_iter().zip(&runs.scales) {
                count += 1.0;
                variance += moments.variance * r;
                w += r;
                wr += r * r;
                wrr += r * r * r;
                wm += r * moments.mean;
                wrm += r * r * moments.mean;
            }
        }
        let truth = truth.unwrap_or((wrr * wm - wr * wrm) / (wrr * w - wr * wr));
        Self {
            truth,
            bias: (wrm - truth * wr) / wrr,
            variance: variance / count,
        }
    }

    /// By pass: the expectation under a schedule with these radius scales.
    pub fn predict(&self, scales: &[f64]) -> Vec<Prediction> {
        let (mut sum, mut inverse) = (0.0, 0.0);
        let predict = |(i, r): (usize, &f64)| {
            let n = (i + 1) as f64;
            sum += r;
            inverse += 1.0 / r;
            Prediction {
                variance: self.variance / r,
                bias: self.bias * r,
                average_variance: self.variance * inverse / (n * n),
                average_bias: self.bias * sum / n,
            }
        };
        scales.iter().enumerate().map(predict).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamfarm_image::radius::radius_scale;

    /// Two runs, equally far above and below the theory's curve.
    fn exact(alpha: f64, theory: &Theory) -> Runs {
        let scales: Vec<f64> = (1..=100).map(|n| radius_scale(n.into(), alpha)).collect();
        let run = |sign: f64| {
            let value = |r: &f64| theory.truth + theory.bias * r + sign * (theory.variance / r / 2.0).sqrt();
            scales.iter().map(value).collect()
        };
        Runs {
            alpha,
            values: vec![run(1.0), run(-1.0)],
            scales,
        }
    }

    #[test]
    fn constants_are_found_again() {
        let theory = Theory {
            truth: 2.0,
            bias: -0.3,
            variance: 0.7,
        };
        let all = [0.1, 0.5, 0.9].map(|alpha| exact(alpha, &theory));
        for truth in [None, Some(2.0)] {
            let fit = Theory::fit(&all, truth);
            assert!((fit.truth - 2.0).abs() < 1e-12);
            assert!((fit.bias + 0.3).abs() < 1e-12);
            assert!((fit.variance - 0.7).abs() < 1e-12);
        }
    }

    #[test]
    fn averages_follow_their_powers_far_out() {
        let theory = Theory {
            truth: 0.0,
            bias: 1.0,
            variance: 1.0,
        };
        for alpha in [0.1, 0.5, 0.9] {
            let n = 100_000;
            let scales: Vec<f64> = (1..=n).map(|n| radius_scale(n.into(), alpha)).collect();
            let at = |passes: usize| theory.predict(&scales[..passes])[passes - 1];
            let (near, far) = (at(n as usize / 10), at(n as usize));
            let slope = |a: f64, b: f64| libm::log10(b / a);
            let variance = slope(near.average_variance, far.average_variance);
            let bias = slope(near.average_bias, far.average_bias);
            assert!((variance + alpha).abs() < 0.01, "{variance} for {alpha}");
            // The sum of i^(alpha - 1) starts with a constant that fades slowly.
            let slowest = if alpha < 0.2 { 0.15 } else { 0.01 };
            assert!((bias - alpha + 1.0).abs() < slowest, "{bias} for {alpha}");
        }
    }
}
