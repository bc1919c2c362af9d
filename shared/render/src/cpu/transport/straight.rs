//! Rays that go straight through boundaries of media.

use super::CameraTracer;
use crate::math::{Ray, Rgb};
use crate::sampler::Sampler;
use crate::world::geometry::SurfaceHit;
use crate::world::mask::VisibilityMask;
use crate::world::medium::MediumId;

/// Where a ray ends that goes straight through boundaries of media.
pub(super) struct Arrived {
    pub hit: Option<SurfaceHit>,
    pub transmittance: Rgb,
    pub medium: MediumId,
    pub distance: f32,
}

impl<V: VisibilityMask> CameraTracer<'_, V> {
    /// Follow a ray to the next surface, through boundaries of media and objects that rules hide from it.
    pub(super) fn go_straight(&self, ray: Ray, medium: MediumId, hidden: V::Hidden, sampler: &mut Sampler) -> Arrived {
        let scene = self.scene;
        let mut ray = ray;
        let mut arrived = Arrived {
            hit: None,
            transmittance: Rgb::ONE,
            medium,
            distance: 0.0,
        };
        loop {
            let hit = scene.first_hit(&ray, |object| self.mask.hides(hidden, object));
            let length = hit.as_ref().map_or(f32::INFINITY, |h| h.t);
            arrived.transmittance *= scene.transmittance(arrived.medium, &ray, length, sampler);
            arrived.distance += length;
            match hit {
                Some(hit) if scene.material(&hit).met(&hit.at, || sampler.next_1d()).is_none() => {
                    arrived.medium = scene.medium_beyond(&hit, ray.dir, arrived.medium);
                    ray = hit.spawn_ray(ray.dir);
                }
                hit => {
                    arrived.hit = hit;
                    return arrived;
                }
            }
        }
    }
}
