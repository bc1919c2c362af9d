//! A medium whose density varies from place to place.

use super::Flight;
use super::bricks::{Bricks, Range};
use super::majorant::{MajorantGrid, Span, Spans};
use super::transmittance::{Estimator, Events, Step, StepFunctions};
use crate::math::{Ray, Rgb, Vec3, exp_rgb_neg};
use crate::phase::Phase;
use crate::sampler::Sampler;
use glam::{Affine3A, DAffine3};
use std::sync::Arc;

/// A density with its bounds: what media of one file share.
#[derive(Debug)]
pub struct Density {
    /// The samples.
    pub bricks: Bricks,
    /// Bounds.
    pub majorants: MajorantGrid,
}

impl Density {
    /// Find the bounds of a density.
    pub fn new(bricks: Bricks) -> Self {
        Self {
            majorants: MajorantGrid::new(&bricks),
            bricks,
        }
    }
}

/// A heterogeneous medium: coefficients of one colour times a density.
#[derive(Clone, Debug)]
pub struct Heterogeneous {
    /// Absorption at density 1, RGB, per scene unit.
    pub sigma_a: Rgb,
    /// Scattering at density 1, RGB, per scene unit.
    pub sigma_s: Rgb,
    /// Phase function.
    pub phase: Phase,
    /// How transmittance is estimated.
    pub estimator: Estimator,
    density: Arc<Density>,
    /// Render space to sample space.
    to_samples: Affine3A,
}

/// A ray through the density, in sample space. Distances are those of render space.
pub struct Track<'a> {
    density: &'a Density,
    origin: Vec3,
    dir: Vec3,
    /// Where the ray is in the medium's box.
    pub range: [f32; 2],
}

impl Track<'_> {
    /// Density at a distance.
    #[inline(always)]
    pub fn density(&self, distance: f32) -> f32 {
        self.density
            .bricks
            .density(self.origin + self.dir * distance)
    }

    /// Stretches with bounds of the density.
    pub fn spans(&self) -> Spans<'_> {
        self.density
            .majorants
            .spans(self.origin, self.dir, self.range)
    }

    /// The same with the ray's own mean density in each.
    pub fn exact_spans(&self) -> impl Iterator<Item = Span> + Clone {
        self.spans().map(|mut span| {
            let Range {
                minorant, majorant, ..
            } = span.density;
            if minorant < majorant {
                let mean = self.integral([span.start, span.end]) / (span.end - span.start);
                span.density.mean = if mean.is_finite() {
                    mean.clamp(minorant, majorant)
                } else {
                    minorant
                };
            } else {
                span.density.mean = majorant;
            }
            span
        })
    }

    /// Density integrated over a range of distances within the medium's box. Along a ray the trilinear density is a cubic
    /// between two planes of samples, and Gauss's rule with two points integrates cubics exactly.
    fn integral(&self, range: [f32; 2]) -> f32 {
        const POINT: f32 = 0.288_675_13;
        let mut sum = 0.0;
        let mut points = [[0.0; LANES]; 3];
        let mut weights = [0.0; LANES];
        let mut used = 0;
        let mut planes = Planes::new(self.origin, self.dir, range);
        while let Some([start, end]) = planes.next() {
            let (middle, length) = (0.5 * (start + end), end - start);
            for offset in [-POINT, POINT] {
                let at = self.origin + self.dir * (middle + length * offset);
                for axis in 0..3 {
                    points[axis][used] = at[axis];
                }
                weights[used] = 0.5 * length;
                used += 1;
            }
            if used == LANES {
                sum += self.weighted(&points, &weights);
                weights = [0.0; LANES];
                used = 0;
            }
        }
        if used > 0 {
            sum += self.weighted(&points, &weights);
        }
        sum
    }

    fn weighted(&self, points: &[[f32; LANES]; 3], weights: &[f32; LANES]) -> f32 {
        let densities = self.density.bricks.densities(points);
        (0..LANES).map(|l| densities[l] * weights[l]).sum()
    }
}

/// Points that are looked up at once.
const LANES: usize = 8;

/// The stretches of a ray of sample space between planes of samples.
struct Planes {
    next: Vec3,
    step: Vec3,
    at: f32,
    end: f32,
}

impl Planes {
    fn new(origin: Vec3, dir: Vec3, [start, end]: [f32; 2]) -> Self {
        let from = origin + dir * start;
        let (mut next, mut step) = (Vec3::INFINITY, Vec3::INFINITY);
        for axis in 0..3 {
            let d = dir[axis];
            if d != 0.0 {
                let plane = if d > 0.0 {
                    from[axis].floor() + 1.0
                } else {
                    from[axis].ceil() - 1.0
                };
                next[axis] = (plane - origin[axis]) / d;
                step[axis] = 1.0 / d.abs();
            }
        }
        Self {
            next,
            step,
            at: start,
            end,
        }
    }

    #[inline]
    fn next(&mut self) -> Option<[f32; 2]> {
        if self.at >= self.end {
            return None;
        }
        let start = self.at;
        let nearest = self.next.min_element();
        self.at = nearest.clamp(start, self.end);
        let passed = self.next.cmple(Vec3::splat(nearest));
        self.next += Vec3::select(passed, self.step, Vec3::ZERO);
        Some([start, self.at])
    }
}

impl Heterogeneous {
    /// `to_render`: from the density's object space to render space; it has an inverse.
    pub fn new(
        [sigma_a, sigma_s]: [Rgb; 2],
        phase: Phase,
        estimator: Estimator,
        density: Arc<Density>,
        to_render: DAffine3,
    ) -> Self {
        let to_samples = (to_render * density.bricks.to_object()).inverse();
        Self {
            sigma_a,
            sigma_s,
            phase,
            estimator,
            density,
            to_samples: to_samples.as_affine3a(),
        }
    }

    /// Extinction at density 1, RGB, per scene unit.
    #[inline]
    pub fn sigma_t(&self) -> Rgb {
        self.sigma_a + self.sigma_s
    }

    /// The samples.
    pub fn bricks(&self) -> &Bricks {
        &self.density.bricks
    }

    /// Render space to the samples' space.
    pub fn to_samples(&self) -> &Affine3A {
        &self.to_samples
    }

    /// Density at a point of render space.
    pub fn density(&self, point: Vec3) -> f32 {
        self.density
            .bricks
            .density(self.to_samples.transform_point3(point))
    }

    /// The part of a ray within the medium's box, up to `length`, which may be infinite.
    pub fn track(&self, ray: &Ray, length: f32) -> Option<Track<'_>> {
        let origin = self.to_samples.transform_point3(ray.origin);
        let dir = self.to_samples.transform_vector3(ray.dir);
        let range = self.density.majorants.clip(origin, dir, length)?;
        Some(Track {
            density: &self.density,
            origin,
            dir,
            range,
        })
    }

    /// One estimate of the transmittance over `length`.
    pub fn transmittance(&self, ray: &Ray, length: f32, sampler: &mut Sampler) -> Rgb {
        let Some(track) = self.track(ray, length) else {
            return Rgb::ONE;
        };
        if self.estimator == Estimator::ExactKnots {
            // The last knot.
            let depth = |span: Span| span.density.mean * (span.end - span.start);
            let depth: f32 = track.exact_spans().map(depth).sum();
            return exp_rgb_neg(self.sigma_t() * -depth);
        }
        let mut last = Rgb::ONE;
        self.walk_with(&track, sampler, |_, step| last = step.value);
        last
    }

    fn walk_with(&self, track: &Track, sampler: &mut Sampler, step: impl FnMut(f32, Step)) {
        let density = |t| track.density(t);
        let (sigma_t, estimator) = (self.sigma_t(), self.estimator);
        match estimator {
            Estimator::ExactKnots => {
                estimator.walk(track.exact_spans(), density, sigma_t, sampler, step)
            }
            _ => estimator.walk(track.spans(), density, sigma_t, sampler, step),
        }
    }

    /// One estimate of the transmittance at all distances along a track, kept in `steps` under the number returned.
    pub fn walk(&self, track: &Track, sampler: &mut Sampler, steps: &mut StepFunctions) -> u32 {
        let number = steps.begin();
        self.walk_with(track, sampler, |t, step| steps.push(t, step));
        number
    }

    /// Sample where a photon of flux `power` scatters along a track: delta tracking at the rate of the largest channel.
    /// Real or null is decided by all channels together, in proportion to the flux that is left of each, and weighted
    /// by that probability (Kutz et al. 2017, *Spectral and decomposition tracking for rendering heterogeneous
    /// volumes*, history-aware).
    pub fn sample_flight(&self, track: &Track, power: Rgb, sampler: &mut Sampler) -> Flight {
        let sigma_t = self.sigma_t();
        let top = sigma_t.max_element();
        let mut events = Events::new(sampler);
        let mut weight = Rgb::ONE;
        let mut scattered = None;
        for span in track.spans() {
            let rate = span.density.majorant * top;
            let goes_on = events.within([span.start, span.end], rate, sampler, |t, sampler| {
                let rho = track.density(t);
                if rho <= 0.0 {
                    return true;
                }
                let collides = (sigma_t * (rho / rate)).min(Rgb::ONE);
                let flux = power * weight;
                let real = (flux * collides).element_sum() / flux.element_sum();
                if sampler.next_1d() < real {
                    weight *= self.sigma_s * (rho / (rate * real));
                    scattered = Some(t);
                    return false;
                }
                weight *= (Rgb::ONE - collides) / (1.0 - real);
                true
            });
            if !goes_on {
                break;
            }
        }
        match scattered {
            Some(distance) => Flight::Scattered { distance, weight },
            None => Flight::Passed { weight },
        }
    }
}
