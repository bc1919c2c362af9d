//! Which media emit, and their radiance along a ray.

use super::Scene;
use crate::math::{Ray, Rgb};
use crate::sampler::Sampler;
use crate::world::light::{LightKind, VolumeLight};
use crate::world::medium::MediumId;
use crate::world::texture::graph::Viewer;

impl Scene {
    /// By medium: the lights that its emission consists of; for a sum of media, the lights of all of them.
    pub(super) fn find_emitting(&self) -> Vec<Vec<u32>> {
        let mut emitting = vec![Vec::new(); self.media().len()];
        for (number, light) in (0..).zip(self.lights()) {
            if let LightKind::Volume(light) = &light.kind
                && let Some(of_medium) = emitting.get_mut(usize::from(light.medium))
            {
                of_medium.push(number);
            }
        }
        for (sum, parts) in self.meetings.sums() {
            let of_parts: Vec<u32> = parts.flat_map(|part| emitting[usize::from(part)].clone()).collect();
            emitting[usize::from(sum)] = of_parts;
        }
        match emitting.iter().all(Vec::is_empty) {
            true => Vec::new(),
            false => emitting,
        }
    }

    /// The lights that a medium's emission consists of.
    #[inline]
    pub fn emitting(&self, medium: MediumId) -> &[u32] {
        match medium {
            Some(id) if !self.emitting.is_empty() => &self.emitting[usize::from(id)],
            _ => &[],
        }
    }

    /// The volume light, if this light is one.
    #[inline]
    pub(crate) fn volume_light(&self, light: usize) -> Option<&VolumeLight> {
        match &self.lights()[light].kind {
            LightKind::Volume(light) => Some(light),
            _ => None,
        }
    }

    /// Factor of a shadow ray towards a light on the weight of its direction: the transmittance up to the light, or,
    /// for a medium that emits, the radiance that arrives along the ray from all of it. An unbiased estimate; `None` if
    /// nothing arrives. `distance`: of the light, may be infinite. `medium`: where the ray starts. `hides`: objects
    /// that rules make invisible.
    #[inline]
    pub(crate) fn reaching(
        &self,
        light: usize,
        (ray, distance): (Ray, f32),
        medium: MediumId,
        hides: impl Fn(u32) -> bool,
        sampler: &mut Sampler,
    ) -> Option<Rgb> {
        match self.volume_light(light) {
            None => {
                // A medium beyond the ray's closest approach to a soft lamp's centre attenuates none of its photons.
                let through = match self.lights()[light].soft_ball(self.objects()) {
                    Some(ball) => (ball.center - ray.origin).dot(ray.dir).max(0.0),
                    None => distance,
                };
                self.unoccluded(
                    ray,
                    (distance, through),
                    medium,
                    self.unshadowing[light],
                    hides,
                    sampler,
                )
            }
            Some(volume) => {
                let radiance = self.shining_along(light, ray, medium, hides, sampler);
                (radiance != Rgb::ZERO).then(|| volume.in_units(radiance))
            }
        }
    }

    /// Radiance of an emitting medium that arrives at a ray's origin, through surfaces that let shadow rays pass.
    pub(crate) fn shining_along(
        &self,
        light: usize,
        mut ray: Ray,
        mut medium: MediumId,
        hides: impl Fn(u32) -> bool,
        sampler: &mut Sampler,
    ) -> Rgb {
        let Some(volume) = self.volume_light(light) else {
            return Rgb::ZERO;
        };
        let (mut transmittance, mut sum) = (Rgb::ONE, Rgb::ZERO);
        loop {
            let hit = self.meets(&ray, f32::INFINITY, &hides);
            let length = hit.as_ref().map_or(f32::INFINITY, |hit| hit.t);
            if let Some(id) = medium
                && self.emitting(medium).contains(&(light as u32))
            {
                let properties = &self.media()[usize::from(id)];
                sum += transmittance * volume.arriving(properties, &ray, length, sampler);
            }
            let Some(mut hit) = hit else { return sum };
            if !self.may_be_passed[hit.object as usize] {
                return sum;
            }
            hit.at.place.viewer = Viewer::Shadow;
            transmittance *= self.material(&hit).transparency(&hit.at);
            if transmittance == Rgb::ZERO {
                return sum;
            }
            transmittance *= self.transmittance(medium, &ray, hit.t, sampler);
            medium = self.medium_beyond(&hit, ray.dir, medium);
            ray = hit.spawn_ray(ray.dir);
        }
    }
}
