//! Unscattered light that a homogeneous medium turns towards the camera: one point on each segment.

use super::{CameraTracer, PathContext};
use crate::math::{PI, Ray, Rgb};
use crate::plan::aov::Part;
use crate::sampler::Sampler;
use crate::world::light::{FogSegment, LightHit, LightKind, SegmentSample};
use crate::world::mask::{Start, VisibilityMask};
use crate::world::medium::Homogeneous;

/// Below this, a light's brightness in the phase function's peak does not matter.
const FAINT: f32 = 0.02;

impl<V: VisibilityMask> CameraTracer<'_, V> {
    /// Light straight from a light that a segment from the ray's origin scatters once; `beta` is the throughput before
    /// that. An unbiased estimate whose value stays bounded next to lights of any size.
    pub fn single_scattering(
        &self,
        ray: &Ray,
        length: f32,
        (id, medium): (u16, &Homogeneous),
        beta: Rgb,
        context: &mut PathContext<'_>,
    ) -> Rgb {
        let scene = self.scene;
        let segment = FogSegment {
            ray: *ray,
            length,
            sigma_t: medium.scattering_sigma_t(),
            phase: medium.phase,
            g: medium.phase.mean_cosine(),
        };
        let (u_light, u) = (context.sampler.next_1d(), context.sampler.next_1d());
        let by_power = self.mask.emitters(&scene.selectors);
        let skips = |light| self.mask.unlit(id, light);
        // For a ball, the points follow the light of one of its points, as if that were all of the light: its cone, and
        // the squared distance to it.
        let start = |light: usize| match &scene.lights()[light].kind {
            LightKind::Spot(spot) if spot.radius > 0.0 && !spot.soft => {
                Some(spot.start(context.sampler.next_2d(), context.sampler.next_1d()))
            }
            LightKind::Spot(_)
            | LightKind::Point { .. }
            | LightKind::Projector(_)
            | LightKind::Goniometric(_)
            | LightKind::Laser(_)
            | LightKind::Directional(_)
            | LightKind::Area { .. }
            | LightKind::Environment(_)
            | LightKind::Volume(_) => None,
        };
        let sample = (scene.light_sources).sample(&segment, by_power, u_light, u, skips, start);
        let Some(sample) = sample else {
            return Rgb::ZERO;
        };
        let point = Ray {
            origin: ray.at(sample.t),
            dir: ray.dir,
        };
        let arriving = self.towards_light(&point, &sample, id, medium, &mut context.sampler);
        let radiance = beta * medium.sigma_s * medium.transmittance(sample.t) * arriving / sample.pdf;
        context.record.add(Part::Volume, sample.light, radiance);
        radiance
    }

    /// Light of the chosen light that is scattered at the ray's origin against its direction, per scattering
    /// coefficient. The direction comes from the light, or from the phase function where the light's density may be too
    /// small.
    fn towards_light(
        &self,
        at: &Ray,
        sample: &SegmentSample,
        id: u16,
        medium: &Homogeneous,
        sampler: &mut Sampler,
    ) -> Rgb {
        let scene = self.scene;
        let light = &scene.lights()[sample.light];
        let phase = medium.phase;
        // The visibility of the light's photons.
        let hidden = self.mask.from(Start::Light(sample.light));
        let is_around = light.is_around(scene.objects(), at.origin);
        let never_met =
            || is_around || scene.only_sampled(sample.light) || self.mask.hides_shape_of(scene, hidden, sample.light);
        let by_phase = match &light.kind {
            LightKind::Environment(_) => 0.5,
            LightKind::Area { .. } | LightKind::Volume(_) if !never_met() => {
                let solid_angle = PI * sample.radius2 / sample.distance2;
                let x = solid_angle * phase.peak();
                if x < FAINT { 0.0 } else { 0.5 * x / (1.0 + x) }
            }
            LightKind::Area { .. }
            | LightKind::Volume(_)
            | LightKind::Point { .. }
            | LightKind::Spot(_)
            | LightKind::Projector(_)
            | LightKind::Goniometric(_)
            | LightKind::Laser(_)
            | LightKind::Directional(_) => 0.0,
        };
        if by_phase > 0.0 && sampler.next_1d() < by_phase {
            let dir = phase.sample(at.dir, sampler.next_2d());
            let value = phase.eval_directions(at.dir, dir);
            let ray = Ray { origin: at.origin, dir };
            let mixture = |pdf: f32| (1.0 - by_phase) * pdf + by_phase * value;
            if let LightKind::Volume(_) = &light.kind {
                let hides = |object| self.mask.hides(hidden, object);
                let radiance = scene.shining_along(sample.light, ray, Some(id), hides, sampler);
                let pdf = light.pdf_direct(scene.objects(), at.origin, dir, None);
                return radiance * (value / mixture(pdf));
            }
            let arrived = self.go_straight(ray, Some(id), hidden, sampler);
            let (emitted, hit) = match &arrived.hit {
                None => (scene.environment(sample.light, dir), None),
                Some(hit) => {
                    let object = &scene.objects()[hit.object as usize];
                    if object.light.map(|light| light as usize) != Some(sample.light) {
                        return Rgb::ZERO;
                    }
                    let at = LightHit {
                        normal: hit.ng,
                        primitive: hit.primitive,
                        distance: arrived.distance,
                    };
                    let emitted = scene.emitted(hit, dir, arrived.distance);
                    let hides = |object| self.mask.hides(hidden, object);
                    (
                        emitted * scene.within_lamp(hit, (dir, arrived.distance), arrived.medium, hides, sampler),
                        Some(at),
                    )
                }
            };
            if emitted == Rgb::ZERO {
                return Rgb::ZERO;
            }
            let pdf = light.pdf_direct(scene.objects(), at.origin, dir, hit);
            return emitted * arrived.transmittance * (value / mixture(pdf));
        }
        let direct = match (&light.kind, sample.start) {
            (LightKind::Spot(spot), Some(start)) => spot.sample_from_start(start, at.origin),
            _ => {
                let (u, u_primitive) = light.draw_direct(scene.objects(), sampler);
                light.sample_direct(scene.objects(), at.origin, u, u_primitive)
            }
        };
        let Some(direct) = direct else {
            return Rgb::ZERO;
        };
        let ray = Ray {
            origin: at.origin,
            dir: direct.wi,
        };
        let hides = |object| self.mask.hides(hidden, object);
        let Some(reaching) = scene.reaching(sample.light, (ray, direct.distance), Some(id), hides, sampler) else {
            return Rgb::ZERO;
        };
        let value = phase.eval_directions(at.dir, direct.wi);
        let scattered = direct.weight * reaching * value;
        if by_phase > 0.0 {
            let mixture = (1.0 - by_phase) * direct.pdf + by_phase * value;
            scattered * (direct.pdf / mixture)
        } else {
            scattered
        }
    }
}
