//! Chi-square tests of samplers against their stated densities (Pearson 1900).
//!
//! A k-d tree divides the domain into bins: first evenly, then at the medians of a pilot run of the sampler. The
//! pilot's samples are not used again, so the test stays exact. Counts per bin are compared with the integral of the
//! density over it. Samples that the sampler refuses (`None`) form one more bin, whose expected count is what the
//! density lacks of integrating to one.

use crate::quadrature::{Rect, integrate};
use crate::render::is_long;
use beamfarm_render::math::{Frame, Vec2, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use glam::DVec3;
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
    /// The number of bins is about this squared.
    pub resolution: usize,
    /// Levels at which the quadrature in a bin stops refining; densities with many edges are faster with fewer.
    pub depth: u32,
}

impl Default for Chi2 {
    /// Half as many samples where tests must be short: this detects a density that is off by 4 % (root mean square)
    /// instead of 3 %.
    fn default() -> Self {
        Self {
            seed: 0,
            samples: if is_long() { 200_000 } else { 100_000 },
            resolution: 20,
            depth: 12,
        }
    }
}

/// Result of a chi-square test.
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
    /// Share of samples for which the density is zero, negative or not finite. Rounding causes some at edges.
    pub impossible: f64,
}

impl Chi2 {
    /// Tests a sampler of unit directions against `pdf` per solid angle.
    ///
    /// Bins are rectangles in the angle to `axis`, on a scale that turns from linear to logarithmic near the median
    /// sample, and in the angle around it. A lobe around the axis may therefore be arbitrarily narrow; one elsewhere
    /// should not be narrower than a few degrees. Test several narrow lobes one by one, refusing the samples of the
    /// others.
    pub fn sphere(
        &self,
        axis: Vec3,
        sample: impl Fn(&mut Sampler) -> Option<Vec3>,
        pdf: impl Fn(Vec3) -> f32,
    ) -> Chi2Result {
        let frame = Frame::from_normal(axis.normalize());
        let [s, t, n] = [frame.s, frame.t, frame.n].map(|v| v.as_dvec3().normalize());
        // 1 - cos from the chord's length, which stays precise near the axis.
        let height = |d: DVec3| 0.5 * (d - n).length_squared();
        let scale = {
            let mut rng = Sampler::new(self.seed, 2, Purpose::Test, 0);
            let draws = (0..20_000).filter_map(|_| sample(&mut rng)).take(1000);
            let mut heights: Vec<f64> = draws.map(|d| height(d.as_dvec3())).collect();
            heights.sort_by(f64::total_cmp);
            heights.get(heights.len() / 2).map_or(1.0, |h| h.max(1e-12))
        };
        let whole = libm::log1p(2.0 / scale);
        let to_plane = |d: Vec3| {
            let d = d.as_dvec3().normalize();
            let x = libm::log1p(height(d) / scale) / whole;
            (x, libm::atan2(d.dot(t), d.dot(s)))
        };
        let from_plane = |x: f64, y: f64| {
            let h = scale * libm::expm1(x * whole);
            let r = (h * (2.0 - h)).max(0.0).sqrt();
            let (sin, cos) = libm::sincos(y);
            let d = s * (r * cos) + t * (r * sin) + n * (1.0 - h);
            (d.as_vec3(), whole * (scale + h))
        };
        let domain = Rect {
            x: (0.0, 1.0),
            y: (-PI, PI),
        };
        self.run(domain, sample, to_plane, |d| f64::from(pdf(d)), from_plane)
    }

    /// Tests a sampler of points in `domain` against `pdf` per area.
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
            |x, y| (Vec2::new(x as f32, y as f32), 1.0),
        )
    }

    fn run<T: Copy>(
        &self,
        domain: Rect,
        sample: impl Fn(&mut Sampler) -> Option<T>,
        to_plane: impl Fn(T) -> (f64, f64),
        pdf: impl Fn(T) -> f64,
        from_plane: impl Fn(f64, f64) -> (T, f64),
    ) -> Chi2Result {
        let mut rng = Sampler::new(self.seed, 0, Purpose::Test, 0);
        let wanted = PILOT_PER_BIN * self.resolution * self.resolution;
        // Samplers that often refuse need more runs.
        let mut pilot: Vec<[f64; 2]> = (0..20 * wanted)
            .filter_map(|_| sample(&mut rng).map(&to_plane))
            .map(|(x, y)| [x, y])
            .take(wanted)
            .collect();
        let mut leaves = Vec::new();
        let tree = Node::build(domain, &mut pilot, 0, &mut leaves);

        let mut observed = vec![0u64; leaves.len() + 1];
        let refused = leaves.len();
        let mut impossible = 0u32;
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
            observed[tree.leaf([x, y])] += 1;
        }

        let count = f64::from(self.samples);
        let f = |x: f64, y: f64| {
            let (value, jacobian) = from_plane(x, y);
            pdf(value) * jacobian
        };
        // A small fraction of a bin's standard error.
        let tolerance = |p: f64| 0.05 * (p.max(1.0 / count) / count).sqrt();
        let mut expected: Vec<f64> = leaves
            .iter()
            .map(|leaf| integrate(&f, *leaf, self.depth, tolerance) * count)
            .collect();
        let integral = expected.iter().sum::<f64>() / count;
        // The missing part is refused; up to a thousandth may be the quadrature's error.
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
            impossible: f64::from(impossible) / count,
        }
    }
}

/// Pilot samples per bin.
const PILOT_PER_BIN: usize = 20;
/// Levels of the tree that are split in the middle: 16 even cells.
const EVEN_LEVELS: u32 = 4;
/// Maximum number of levels of the tree.
const MAX_LEVELS: u32 = 40;

enum Node {
    Leaf(usize),
    Split {
        axis: usize,
        at: f64,
        children: Box<[Node; 2]>,
    },
}

impl Node {
    /// The tree over `rect` and the pilot's samples in it; the rectangles of its leaves are appended to `leaves`.
    fn build(rect: Rect, pilot: &mut [[f64; 2]], level: u32, leaves: &mut Vec<Rect>) -> Self {
        let axis = level as usize % 2;
        let range = if axis == 0 { rect.x } else { rect.y };
        let at = if level < EVEN_LEVELS {
            0.5 * (range.0 + range.1)
        } else {
            let middle = pilot.len() / 2;
            pilot.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
            pilot.get(middle).map_or(range.0, |p| p[axis])
        };
        let full = level >= EVEN_LEVELS && pilot.len() <= 2 * PILOT_PER_BIN;
        if full || level == MAX_LEVELS || !(range.0 < at && at < range.1) {
            leaves.push(rect);
            return Self::Leaf(leaves.len() - 1);
        }
        let (mut low, mut high) = (rect, rect);
        if axis == 0 {
            low.x.1 = at;
            high.x.0 = at;
        } else {
            low.y.1 = at;
            high.y.0 = at;
        }
        pilot.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
        let (below, above) = pilot.split_at_mut(pilot.partition_point(|p| p[axis] < at));
        let low = Self::build(low, below, level + 1, leaves);
        let high = Self::build(high, above, level + 1, leaves);
        Self::Split {
            axis,
            at,
            children: Box::new([low, high]),
        }
    }

    /// The leaf that holds `p`; points outside the domain belong to a leaf at its edge.
    fn leaf(&self, p: [f64; 2]) -> usize {
        match self {
            Self::Leaf(index) => *index,
            Self::Split { axis, at, children } => children[usize::from(p[*axis] >= *at)].leaf(p),
        }
    }
}

/// Pearson's statistic, its degrees of freedom and its p-value for counts against expected counts of the same total.
/// Bins that expect fewer than five are pooled.
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
    // Bins come in ascending order: something is left over only when nothing reached the minimum.
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
    use beamfarm_render::warp;

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
        let test = Chi2 {
            samples: 200_000,
            ..Chi2::default()
        };
        let sample = |s: &mut Sampler| Some(warp::cosine_hemisphere(s.next_2d()));
        let axis = Vec3::new(0.3, -0.4, 0.5);
        let right = test.sphere(axis, sample, |d| warp::cosine_hemisphere_pdf(d.z));
        assert!(right.p_value > 0.01 && right.impossible == 0.0, "{right:?}");
        assert!((right.integral - 1.0).abs() < 1e-3);
        let uniform = test.sphere(axis, sample, |d| if d.z > 0.0 { 0.5 / PI as f32 } else { 0.0 });
        assert!(uniform.p_value < 1e-9);
        let tilted = test.sphere(axis, sample, |d| warp::cosine_hemisphere_pdf(d.z) * (1.0 + 0.05 * d.x));
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
            if d.z > 0.5 { warp::uniform_sphere_pdf() } else { 0.0 }
        };
        assert!(test.sphere(Vec3::Z, sample, pdf).p_value > 0.01);
        let too_low = |d: Vec3| 0.9 * pdf(d);
        assert!(test.sphere(Vec3::Z, sample, too_low).p_value < 1e-6);
    }

    #[test]
    fn narrow_lobes_around_the_axis_are_resolved() {
        let test = Chi2::default();
        let axis = Vec3::new(0.48, 0.6, -0.64);
        let cos_max = 1.0 - 1e-5;
        let sample = |s: &mut Sampler| {
            let cone = warp::uniform_cone(s.next_2d(), cos_max);
            (s.next_1d() < 0.9).then(|| Frame::from_normal(axis).to_world(cone))
        };
        let density = |d: Vec3, weight: f32| {
            let inside = (d - axis).length_squared() < 2.0 * (1.0 - cos_max);
            f32::from(inside) * weight * warp::uniform_cone_pdf(cos_max)
        };
        let result = test.sphere(axis, sample, |d| density(d, 0.9));
        assert!(result.p_value > 0.01, "{result:?}");
        assert!((result.integral - 0.9).abs() < 1e-3, "{result:?}");
        let result = test.sphere(axis, sample, |d| density(d, 0.92));
        assert!(result.p_value < 1e-3, "{result:?}");
    }

    #[test]
    fn positions_in_the_plane() {
        let test = Chi2::default();
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
