//! Kernels at edges, corners and creases.
//!
//! A kernel that reaches over the edge of a surface or out of a medium would leave there a part of its photon's flux. So
//! displacements are drawn from the kernel until one lies on what is there, as a look-up from there would see it; their number has
//! a mean of one over the share of the kernel that does, and the photon's power is multiplied by it: all of its flux stays, and
//! no integral is needed (Booth 2007, unbiased Monte Carlo estimation of the reciprocal of an integral).

use crate::geometry::SurfaceHit;
use crate::math::{Frame, PI, Ray, Vec3, sin_cos};
use crate::plan::Scene;
use crate::sampler::Sampler;
use crate::surface::{MAX_PLANE_DISTANCE, MIN_NORMAL_COSINE};

/// A kernel of which so many displacements in a row lie beside what is there is as good as beside it altogether, and made
/// narrower.
const MOST_TRIALS: u32 = 64;
/// The same of a beam, whose radius stays.
const MOST_BEAM_TRIALS: u32 = 16;
/// Beams that graze a surface are displaced along it as if they did not.
const LEAST_COSINE: f32 = 0.25;
/// Halvings of a kernel's radius.
const MOST_HALVINGS: u32 = 8;

/// What rays of a photon see.
pub(super) struct Probe<'a, F> {
    pub scene: &'a Scene,
    /// Objects that are not there.
    pub hides: F,
}

impl<F: Fn(u32) -> bool> Probe<'_, F> {
    /// The radius of a surface photon's kernel, at most `radius`, and the factor on its power. `side`: a direction on the side
    /// of the surface that it came from.
    pub(super) fn surface(
        &self,
        hit: &SurfaceHit,
        side: Vec3,
        radius: f32,
        sampler: &mut Sampler,
    ) -> (f32, f32) {
        let n = hit.ng * hit.ng.dot(side).signum();
        let frame = Frame::from_normal(n);
        let mut radius = radius;
        for _ in 0..MOST_HALVINGS {
            for trial in 1..=MOST_TRIALS {
                let u = sampler.next_2d();
                // Epanechnikov's kernel on a disc.
                let r = radius * (1.0 - (1.0 - u.x).sqrt()).sqrt();
                let (sin, cos) = sin_cos(2.0 * PI * u.y);
                let offset = frame.s * (r * cos) + frame.t * (r * sin);
                if self.is_on_surface(hit.spawn_ray(n).origin, n, offset, radius) {
                    return (radius, trial as f32);
                }
            }
            radius *= 0.5;
        }
        (radius, 1.0)
    }

    /// Factor on the power of a beam for its kernel where it starts, of which a part may lie outside of the medium. `normal`: of
    /// the surface that it starts on.
    pub(super) fn beam(
        &self,
        ray: &Ray,
        normal: Option<Vec3>,
        radius: f32,
        sampler: &mut Sampler,
    ) -> f32 {
        let frame = Frame::from_normal(ray.dir);
        for trial in 1..=MOST_BEAM_TRIALS {
            // Epanechnikov's kernel on a line, in a direction across the beam: the median of three uniform numbers.
            let (u, v) = (sampler.next_2d(), sampler.next_2d());
            let median = u.x.max(u.y).min(u.x.min(u.y).max(v.x));
            let r = radius * (2.0 * median - 1.0);
            let (sin, cos) = sin_cos(PI * v.y);
            let across = frame.s * (r * cos) + frame.t * (r * sin);
            let (from, offset) = match normal {
                None => (ray.origin, across),
                Some(n) => {
                    // Over where the displaced beam would start.
                    let n = n * n.dot(ray.dir).signum();
                    let along = across.dot(n) / n.dot(ray.dir).max(LEAST_COSINE);
                    let offset = across - ray.dir * along;
                    let height = MAX_PLANE_DISTANCE * radius;
                    (ray.origin + n * height, offset - n * offset.dot(n))
                }
            };
            if self.is_clear(from, offset) {
                return trial as f32;
            }
        }
        1.0
    }

    /// Whether a point at an offset along a surface's tangent plane is over a surface like it, and nothing between.
    fn is_on_surface(&self, from: Vec3, n: Vec3, offset: Vec3, radius: f32) -> bool {
        let height = MAX_PLANE_DISTANCE * radius;
        let start = from + n * height;
        let down = Ray {
            origin: start + offset,
            dir: -n,
        };
        let objects = self.scene.objects();
        let hit = (self.scene.geometry).intersect(objects, &down, 2.0 * height, &self.hides);
        hit.is_some_and(|hit| hit.ng.dot(n).abs() >= MIN_NORMAL_COSINE)
            && self.is_clear(start, offset)
    }

    fn is_clear(&self, from: Vec3, offset: Vec3) -> bool {
        let length = offset.length();
        let ray = Ray {
            origin: from,
            dir: offset / length,
        };
        let objects = self.scene.objects();
        length <= 0.0 || !(self.scene.geometry).occluded(objects, &ray, length, &self.hides)
    }
}
