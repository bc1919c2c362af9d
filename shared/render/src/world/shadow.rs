//! Shadow rays, which pass through boundaries of media and, attenuated, through surfaces that are not opaque.

use super::Scene;
use crate::math::{Ray, Rgb, Vec3};
use crate::sampler::Sampler;
use crate::world::geometry::SurfaceHit;
use crate::world::light::SoftLine;
use crate::world::medium::MediumId;
use crate::world::texture::graph::Viewer;

/// Shadow rays stop testing surfaces slightly short of the light, which may shadow itself; media count all the way.
const SHORT_OF_LIGHT: f32 = 1.0 - 1e-4;

impl Scene {
    /// Share of a lamp's light that a ray receives which has met the lamp: all of it, or with soft falloff the light
    /// from its centre. The ray has come straight over `distance`. `medium`: where it is.
    pub fn within_lamp(
        &self,
        hit: &SurfaceHit,
        (dir, distance): (Vec3, f32),
        medium: MediumId,
        hides: impl Fn(u32) -> bool,
        sampler: &mut Sampler,
    ) -> Rgb {
        let light = self.objects()[hit.object as usize].light;
        match light.and_then(|light| self.lights()[light as usize].soft_ball(self.objects())) {
            None => Rgb::ONE,
            Some(ball) => {
                let cos = -hit.ng.dot(dir);
                let way = (ball.depth(cos, distance), ball.radius * cos);
                let way = self.unoccluded(hit.spawn_ray(dir), way, medium, Some(hit.object), hides, sampler);
                way.unwrap_or(Rgb::ZERO)
            }
        }
    }

    /// Where a photon of a lamp with soft falloff starts on its line, and the transmittance up to there; `None`:
    /// blocked.
    pub(crate) fn start_softly(
        &self,
        light: usize,
        line: &SoftLine,
        hides: impl Fn(u32) -> bool,
        sampler: &mut Sampler,
    ) -> Option<(Vec3, Rgb)> {
        let own = self.lights()[light].kind.object();
        let is_passed = |object: u32| self.may_be_passed[object as usize] || own == Some(object) || hides(object);
        let back = Ray {
            dir: -line.from_foot.dir,
            ..line.from_foot
        };
        let behind = self.meets(&back, line.half_chord, &is_passed);
        let dark = line.dark(behind.map_or(line.half_chord, |hit| hit.t));
        let medium = self.medium_of_light(light, line.from_foot.origin);
        let way = self.unoccluded(line.from_foot, (dark, dark), medium, own, hides, sampler)?;
        Some((line.from_foot.at(dark), way))
    }

    /// Transmittance of a shadow ray, an unbiased estimate in heterogeneous media; `None` if a surface other than
    /// `light` blocks it. `reach`, `through`: distances within which surfaces and media count, may be infinite.
    /// `medium`: where the ray starts. `hides`: objects that rules make invisible.
    pub fn unoccluded(
        &self,
        ray: Ray,
        (reach, through): (f32, f32),
        medium: MediumId,
        light: Option<u32>,
        hides: impl Fn(u32) -> bool,
        sampler: &mut Sampler,
    ) -> Option<Rgb> {
        let (mut reach, mut left) = (reach * SHORT_OF_LIGHT, through);
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
            transmittance *= self.transmittance(medium, &ray, hit.t.min(left), sampler);
            medium = self.medium_beyond(&hit, ray.dir, medium);
            ray = hit.spawn_ray(ray.dir);
            reach -= hit.t;
            left = (left - hit.t).max(0.0);
        }
        Some(transmittance * self.transmittance(medium, &ray, left, sampler))
    }
}
