//! Light that a camera path meets before its first vertex: of surfaces, of environments and of media that emit.

use super::path::Path;
use super::{CameraTracer, PathContext};
use crate::math::Rgb;
use crate::plan::aov::Part;
use crate::warp::power_heuristic;
use crate::world::geometry::SurfaceHit;
use crate::world::light::LightHit;
use crate::world::mask::{Start, VisibilityMask};

impl<V: VisibilityMask> CameraTracer<'_, V> {
    /// Light that the path meets: of the environment if it meets no surface, or of the surface.
    pub(super) fn add_met_light(
        &self,
        path: &Path<V::Hidden>,
        (hit, distance): (Option<&SurfaceHit>, f32),
        radiance: &mut Rgb,
        context: &mut PathContext<'_>,
    ) {
        let scene = self.scene;
        let tint = context.tint();
        let met = hit.and_then(|hit| {
            let light = scene.objects()[hit.object as usize].light? as usize;
            let (dir, hides) = (path.ray.dir, |object| self.mask.hides(path.hidden, object));
            let emitted = match scene.emitted(hit, dir, distance) {
                Rgb::ZERO => Rgb::ZERO,
                emitted => emitted * scene.within_lamp(hit, (dir, distance), path.medium, hides, &mut context.sampler),
            };
            Some((light, emitted))
        });
        let mut add = |light: usize, emitted: Rgb, hit: Option<&SurfaceHit>| {
            let arriving = path.beta * emitted * self.share_of_lobe(path, light, hit);
            context.record.add(Part::Direct, light, arriving);
            *radiance += tint * arriving;
        };
        match hit {
            Some(hit) => {
                if let Some((light, emitted)) = met {
                    add(light, emitted, Some(hit));
                }
            }
            None => {
                scene.each_environment(path.ray.dir, |light, environment, place| {
                    if !self.mask.hides_light(path.hidden, light) {
                        add(light, environment.radiance_at(place), None);
                    }
                });
            }
        }
    }

    /// What a medium emits into the path, within `length` of it.
    pub(super) fn add_emitted_within(
        &self,
        path: &Path<V::Hidden>,
        id: u16,
        length: f32,
        radiance: &mut Rgb,
        context: &mut PathContext<'_>,
    ) {
        let scene = self.scene;
        for &light in scene.emitting(Some(id)) {
            let light = light as usize;
            if let Some(volume) = scene.volume_light(light)
                && !self.mask.hides_light(path.hidden, light)
            {
                let medium = &scene.media()[usize::from(id)];
                let emitted = volume.arriving(medium, &path.ray, length, &mut context.sampler);
                let arriving = path.beta * emitted * self.share_of_lobe(path, light, None);
                context.record.add(Part::Direct, light, arriving);
                *radiance += context.tint() * arriving;
            }
        }
    }

    /// Weight of a light that the path has met, if light was sampled at the lobe that it last followed. `hit`: on an
    /// area light.
    fn share_of_lobe(&self, path: &Path<V::Hidden>, light: usize, hit: Option<&SurfaceHit>) -> f32 {
        let Some(lobe) = &path.drawn else {
            return 1.0;
        };
        let scene = self.scene;
        let shadow = self.mask.from(Start::Shadow(lobe.object));
        if self.mask.links_shadows(light) || self.mask.hides_light(shadow, light) {
            return 0.0;
        }
        let hit = hit.map(|hit| LightHit {
            normal: hit.ng,
            primitive: hit.primitive,
            distance: lobe.distance,
        });
        let dir = path.ray.dir;
        let by_power = self.mask.selector(self.aimed_at(), lobe.object);
        let choice = scene.light_sources.choice_at(lobe.point, None, by_power);
        let samples = choice.samples_of(light);
        if samples == 0.0 {
            return 1.0;
        }
        let pdf = scene.lights()[light].pdf_direct(scene.objects(), lobe.point, dir, hit);
        power_heuristic(lobe.density, pdf * samples)
    }
}
