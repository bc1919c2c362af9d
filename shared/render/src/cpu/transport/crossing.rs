//! A camera path's way through a medium, before its first vertex: the segment that it leaves for beams, and what is
//! scattered into it.

use super::path::Path;
use super::walk::{Drawn, Walk, Wanted};
use super::{CameraTracer, PathContext};
use crate::cpu::beam::estimate::CameraSegment;
use crate::math::{Ray, Rgb};
use crate::world::mask::{Start, VisibilityMask};
use crate::world::medium::{Flight, Medium};

impl<V: VisibilityMask> CameraTracer<'_, V> {
    /// Takes the path through a medium, up to `length`: leaves a segment for beams, adds what is scattered there, and
    /// attenuates the path.
    pub(super) fn cross_medium(
        &self,
        path: &mut Path<V::Hidden>,
        id: u16,
        length: f32,
        context: &mut PathContext<'_>,
    ) -> Rgb {
        let properties = &self.scene.media()[id as usize];
        let ray = path.ray;
        if path.beta == Rgb::ZERO || path.rest == 0.0 || !properties.scatters() {
            path.beta *= properties.transmittance(&ray, length, &mut context.sampler);
            return Rgb::ZERO;
        }
        let beta = path.beta * path.rest;
        let serves_all = self.estimators().is_by_beams(id);
        if serves_all || self.estimators().leave_beams() {
            let segment = CameraSegment {
                way: path.way,
                ..CameraSegment::new(ray, length, beta, id)
            };
            path.beta *= self.leave_segment(segment, context);
        } else {
            // One of two events: the path passes, or is scattered.
            return match properties.sample_flight(&ray, length, beta, &mut context.sampler) {
                Flight::Passed { weight } => {
                    path.beta *= weight;
                    Rgb::ZERO
                }
                Flight::Scattered { distance, weight } => {
                    path.beta = Rgb::ZERO;
                    self.scattered_at(&ray, id, distance, (beta, weight), context)
                }
            };
        }
        if !serves_all {
            return self.scattered_in_medium(&ray, id, length, beta, context);
        }
        match properties {
            Medium::Homogeneous(medium) => {
                let range = length.min(medium.reach());
                self.single_scattering(&ray, range, (id, medium), beta, context)
            }
            Medium::Heterogeneous(_) => Rgb::ZERO,
        }
    }

    /// Light that a medium without beams scatters into the ray within `length`.
    fn scattered_in_medium(&self, ray: &Ray, id: u16, length: f32, beta: Rgb, context: &mut PathContext<'_>) -> Rgb {
        let medium = &self.scene.media()[id as usize];
        let Flight::Scattered { distance, weight } = medium.sample_flight(ray, length, beta, &mut context.sampler)
        else {
            return Rgb::ZERO;
        };
        self.scattered_at(ray, id, distance, (beta, weight), context)
    }

    /// Light scattered into the ray at a distance that was drawn with this weight.
    fn scattered_at(
        &self,
        ray: &Ray,
        id: u16,
        distance: f32,
        (beta, weight): (Rgb, Rgb),
        context: &mut PathContext<'_>,
    ) -> Rgb {
        let (direct, indirect) = (true, true);
        let mut walk = Walk {
            ray: *ray,
            medium: Some(id),
            hidden: self.mask.from(Start::Gather),
            beta: beta * weight,
            track: weight,
            drawn: None::<Drawn>,
            behind: None,
            wanted: Wanted { direct, indirect },
            depth: 0,
        };
        let before = context.record.enter_volume();
        let mut radiance = self.scatter_in_medium(&mut walk, id, distance, context);
        if walk.survives(self.plan.patience, &mut context.sampler) {
            radiance += self.walk(walk, context);
        }
        context.record.leave_volume(before);
        radiance
    }
}
