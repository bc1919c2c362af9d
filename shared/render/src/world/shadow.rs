//! Shadow rays, which see through boundaries of media and, weakened, through surfaces that are not opaque.

use super::Scene;
use crate::math::{Ray, Rgb};
use crate::sampler::Sampler;
use crate::world::medium::MediumId;
use crate::world::texture::graph::Viewer;

/// Shadow rays look for surfaces up to a little short of the light, which may hide itself; media go on all the way.
const SHORT_OF_LIGHT: f32 = 1.0 - 1e-4;

impl Scene {
    /// Transmittance of a shadow ray, an unbiased estimate in heterogeneous media; `None` where a surface other than
    /// `light` blocks it. `distance`: of the light, which may be infinite. `medium`: where the ray starts. `hides`:
    /// objects that rules pass through.
    pub fn unoccluded(
        &self,
        ray: Ray,
        distance: f32,
        medium: MediumId,
        light: Option<u32>,
        hides: impl Fn(u32) -> bool,
        sampler: &mut Sampler,
    ) -> Option<Rgb> {
        let (mut reach, mut left) = (distance * SHORT_OF_LIGHT, distance);
        let may_be_passed = |object: u32| self.may_be_passed[object as usize];
        let is_passed = |object: u32| may_be_passed(object) || light == Some(object) || hides(object);
        let objects = self.objects();
        if self.geometry.occluded(objects, &ray, reach, &is_passed) {
            return None;
        }
        if !self.shadow_rays_walk {
            return Some(self.transmittance(medium, &ray, left, sampler));
        }
        let (mut ray, mut medium, mut transmittance) = (ray, medium, Rgb::ONE);
        let is_looked_at = |object: u32| may_be_passed(object) && !hides(object);
        while let Some(mut hit) = self.meets(&ray, reach, &|object| !is_looked_at(object)) {
            hit.at.place.viewer = Viewer::Shadow;
            transmittance *= self.material(&hit).transparency(&hit.at);
            if transmittance == Rgb::ZERO {
                return None;
            }
            transmittance *= self.transmittance(medium, &ray, hit.t, sampler);
            medium = self.medium_beyond(&hit, ray.dir, medium);
            ray = hit.spawn_ray(ray.dir);
            reach -= hit.t;
            left -= hit.t;
        }
        Some(transmittance * self.transmittance(medium, &ray, left, sampler))
    }
}
