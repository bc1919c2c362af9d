//! Chi-square tests of samplers against the densities that they claim (Pearson 1900).
//!
//! The domain is cut into a grid of bins. Half of the grid lines are evenly spaced, half are quantiles of a pilot run of the
//! sampler, so that lobes narrower than any even bin are resolved too; the pilot's samples are not used again, hence the
//! test stays exact. Counts per bin are compared with the integral of the density over it. Samples that the sampler
//! refuses (`None`) are one more bin, whose expected count is what the density lacks of integrating to one.

use crate::quadrature::{Rect, integrate};
use beamfarm_shared::math::{Frame, Vec2, Vec3};
use beamfarm_shared::sampler::{Purpose, Sampler};
use std::f64::consts::PI;

/// Bins whose expected count is below this are pooled.
const MIN_EXPECTED: f64 = 5.0;

/// How a sampler is tested.
#[derive(Clone, Copy, Debug)]
pub struct Chi2 {
    /// Seed of the samples.
    pub seed: u64,
    /// Samples to count.
    pub samples: u32,
    /// Bins along each of the two coordinates.
    pub resolution: usize,
    /// Levels of refinement of the quadrature per bin; raise it for densities with edges.
    pub depth: u32,
}

impl Default for Chi2 {
    fn default() -> Self {
        Self {
            seed: 0,
            samples: 200_000,
            resolution: 20,
            depth: 5,
        }
    }
}

/// What a chi-square test found.
#[derive(Clone, Copy, Debug)]
pub struct Chi2Result {
    /// Sum of (observed - expected)^2 / expected over the bins.
    pub statistic: f64,
    /// Degrees of freedom.
    pub dof: usize,
    /// Probability of a statistic at least this large if the sampler follows its density.
    pub p_value: f64,
    /// Integral of the density over the domain.
    pub integral: f64,
    /// Samples for which the density is zero, negative or not finite.
    pub impossible: u64,
}

impl Chi2 {
    /// Test a sampler of unit directions against `pdf` per solid angle. Bins are even in the cosine to `axis` and the
    /// angle around it: give the direction of the narrowest lobe, if there is one.
    pub fn sphere(
        &self,
        axis: Vec3,
        sample: impl Fn(&mut Sampler) -> Option<Vec3>,
        pdf: impl Fn(Vec3) -> f32,
    ) -> Chi2Result {
        let frame = Frame::from_normal(axis.normalize());
        let [s, t, n] = [frame.s, frame.t, frame.n].map(|v| v.as_dvec3().normalize());
        // The first coordinate is 1 - cos, from the chord's length, which keeps its digits near the axis.
        let to_plane = |d: Vec3| {
            let d = d.as_dvec3();
            let d = d / d.length();
            (
                0.5 * (d - n).length_squared(),
                libm::atan2(d.dot(t), d.dot(s)),
            )
        };
        let from_plane = |x: f64, y: f64| {
            let r = (x * (2.0 - x)).max(0.0).sqrt();
            let (sin, cos) = libm::sincos(y);
            (s * (r * cos) + t * (r * sin) + n * (1.0 - x)).as_vec3()
        };
        let domain = Rect {
            x: (0.0, 2.0),
            y: (-PI, PI),
        };
        self.run(domain, sample, to_plane, |d| f64::from(pdf(d)), from_plane)
    }

    /// Test a sampler of points in `domain` against `pdf` per area.
    pub fn plane(
        &self,
        domain: Rect,
        sample: impl Fn(&mut Sampler) -> Option<Vec2>,
        pdf: impl Fn(Vec2) -> f32,
    ) -> Chi2Result {
        self.run(
            domain,
            sample,
            |p| (f64::from(p.x), f64::from(p.y)),
            |p| f64::from(pdf(p)),
            |x, y| Vec2::new(x as f32, y as f32),
        )
    }

    fn run<T: Copy>(
        &self,
        domain: Rect,
        sample: impl Fn(&mut Sampler) -> Option<T>,
        to_plane: impl Fn(T) -> (f64, f64),
        pdf: impl Fn(T) -> f64,
        from_plane: impl Fn(f64, f64) -> T,
    ) -> Chi2Result {
        let mut pilot = Sampler::new(self.seed, 0, Purpose::Test, 0);
        let (px, py): (Vec<f64>, Vec<f64>) = (0..5_000)
            .filter_map(|_| sample(&mut pilot).map(&to_plane))
            .unzip();
        let xs = edges(domain.x, self.resolution, px);
        let ys = edges(domain.y, self.resolution, py);

        let columns = xs.len() - 1;
        let mut observed = vec![0u64; columns * (ys.len() - 1) + 1];
        let refused = observed.len() - 1;
        let mut impossible = 0;
        let mut rng = Sampler::new(self.seed, 1, Purpose::Test, 0);
        for _ in 0..self.samples {
            let Some(value) = sample(&mut rng) else {
                observed[refused] += 1;
                continue;
            };
            let density = pdf(value);
            if !(density > 0.0 && density.is_finite()) {
                impossible += 1;
            }
            let (x, y) = to_plane(value);
            observed[bin(&ys, y) * columns + bin(&xs, x)] += 1;
        }

        let count = f64::from(self.samples);
        let f = |x: f64, y: f64| pdf(from_plane(x, y));
        // A hundredth of a bin's standard error.
        let tolerance = |p: f64| 0.01 * (p.max(1.0 / count) / count).sqrt();
        let mut expected = Vec::with_capacity(observed.len());
        for y in ys.windows(2) {
            for x in xs.windows(2) {
                let rect = Rect {
                    x: (x[0], x[1]),
                    y: (y[0], y[1]),
                };
                expected.push(integrate(&f, rect, self.depth, tolerance) * count);
            }
        }
        let integral = expected.iter().sum::<f64>() / count;
        // What is missing is refused; a thousandth may be the quadrature's error.
        let missing = 1.0 - integral;
        expected.push(if observed[refused] == 0 && missing < 1e-3 {
            0.0
        } else {
            missing.max(0.0) * count
        });

        let (statistic, dof, p_value) = chi2(&observed, &expected);
        Chi2Result {
            statistic,
            dof,
            p_value,
            integral,
            impossible,
        }
    }
}

/// Half evenly spaced grid lines, half quantiles of the pilot's values.
fn edges(range: (f64, f64), resolution: usize, mut pilot: Vec<f64>) -> Vec<f64> {
    let even = resolution.div_ceil(2);
    let mut edges: Vec<f64> = (0..=even)
        .map(|i| range.0 + (range.1 - range.0) * i as f64 / even as f64)
        .collect();
    pilot.sort_by(f64::total_cmp);
    let quantiles = resolution - even;
    if !pilot.is_empty() {
        edges.extend((1..=quantiles).map(|i| pilot[i * pilot.len() / (quantiles + 1)]));
    }
    edges.retain(|x| (range.0..=range.1).contains(x));
    edges.sort_by(f64::total_cmp);
    edges.dedup();
    edges
}

/// The interval of `edges` that holds `x`; values outside belong to the first or the last.
fn bin(edges: &[f64], x: f64) -> usize {
    edges.partition_point(|e| *e <= x).clamp(1, edges.len() - 1) - 1
}

/// Pearson's statistic, its degrees of freedom and its p-value for counts against expected counts of the same total. Bins
/// that expect fewer than five are pooled.
///
/// # Panics
/// If the slices differ in length.
pub fn chi2(observed: &[u64], expected: &[f64]) -> (f64, usize, f64) {
    assert_eq!(observed.len(), expected.len());
    let mut order: Vec<usize> = (0..expected.len()).collect();
    order.sort_by(|a, b| expected[*a].total_cmp(&expected[*b]));
    let mut bins: Vec<(f64, f64)> = Vec::new();
    let mut pool = (0.0, 0.0);
    for i in order {
        pool.0 += observed[i] as f64;
        pool.1 += expected[i];
        if pool.1 >= MIN_EXPECTED {
            bins.push(std::mem::take(&mut pool));
        }
    }
    // Bins come in ascending order: what is left over is there only when nothing reached the minimum.
    if pool.1 > 0.0 || pool.0 > 0.0 {
        bins.push(pool);
    }
    let statistic = bins.iter().map(|(o, e)| (o - e) * (o - e) / e).sum::<f64>();
    let dof = bins.len().saturating_sub(1);
    let p_value = if !statistic.is_finite() {
        0.0
    } else if dof == 0 || statistic == 0.0 {
        1.0
    } else {
        statrs::function::gamma::gamma_ur(0.5 * dof as f64, 0.5 * statistic)
    };
    (statistic, dof, p_value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamfarm_shared::warp;

    #[test]
    fn p_value_of_a_known_statistic() {
        let (statistic, dof, p) = chi2(&[110, 90], &[100.0, 100.0]);
        assert_eq!((statistic, dof), (2.0, 1));
        // With one degree of freedom it is a z-test at sqrt(2).
        assert!((p - crate::z_test::two_sided(2.0f64.sqrt())).abs() < 1e-12);
    }

    #[test]
    fn pooling_keeps_the_totals() {
        let (statistic, dof, p) = chi2(&[1, 2, 3, 94], &[2.0, 2.0, 2.0, 94.0]);
        assert_eq!((statistic, dof, p), (0.0, 1, 1.0));
        assert_eq!(chi2(&[1, 9], &[0.0, 10.0]).1, 0);
    }

    #[test]
    fn right_density_passes_and_wrong_ones_fail() {
        let test = Chi2::default();
        let sample = |s: &mut Sampler| Some(warp::cosine_hemisphere(s.next_2d()));
        let axis = Vec3::new(0.3, -0.4, 0.5);
        let right = test.sphere(axis, sample, |d| warp::cosine_hemisphere_pdf(d.z));
        assert!(right.p_value > 0.01 && right.impossible == 0, "{right:?}");
        assert!((right.integral - 1.0).abs() < 1e-3);
        let uniform = test.sphere(
            axis,
            sample,
            |d| if d.z > 0.0 { 0.5 / PI as f32 } else { 0.0 },
        );
        assert!(uniform.p_value < 1e-9);
        let tilted = test.sphere(axis, sample, |d| {
            warp::cosine_hemisphere_pdf(d.z) * (1.0 + 0.05 * d.x)
        });
        assert!(tilted.p_value < 1e-3, "{tilted:?}");
    }

    #[test]
    fn refused_samples_count() {
        let test = Chi2::default();
        let sample = |s: &mut Sampler| {
            let d = warp::uniform_sphere(s.next_2d());
            (d.z > 0.5).then_some(d)
        };
        let pdf = |d: Vec3| {
            if d.z > 0.5 {
                warp::uniform_sphere_pdf()
            } else {
                0.0
            }
        };
        assert!(test.sphere(Vec3::Z, sample, pdf).p_value > 0.01);
        let too_low = |d: Vec3| 0.9 * pdf(d);
        assert!(test.sphere(Vec3::Z, sample, too_low).p_value < 1e-6);
    }

    #[test]
    fn positions_in_the_plane() {
        let test = Chi2 {
            depth: 8,
            ..Chi2::default()
        };
        let domain = Rect {
            x: (-1.0, 1.0),
            y: (-1.0, 1.0),
        };
        let sample = |s: &mut Sampler| Some(warp::concentric_disk(s.next_2d()));
        let pdf = |p: Vec2| {
            if p.length_squared() <= 1.0 {
                warp::concentric_disk_pdf()
            } else {
                0.0
            }
        };
        let result = test.plane(domain, sample, pdf);
        assert!(result.p_value > 0.01, "{result:?}");
    }
}
