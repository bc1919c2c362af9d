//! Direct light at a surface point: which light, and what is in its way.

use super::vertex::Vertex;
use super::{CameraTracer, PathContext};
use crate::math::{Rgb, Vec2, Vec3, mean};
use crate::plan::aov::Part;
use crate::sampler::Sampler;
use crate::world::Selectors;
use crate::world::bsdf::BsdfFlags;
use crate::world::light::{DirectSample, LightChoice, LocalChoice};
use crate::world::mask::{Start, VisibilityMask};

/// How a surface point looks for light.
#[derive(Clone, Copy)]
pub(super) enum Seen<H> {
    /// At the first surface that is not specular: by shadow rays.
    First,
    /// Further along the path: nothing is hidden.
    Later,
    /// As [`Self::Later`], where the path ends.
    Last,
    /// As photons would bring it to a surface from which they do not see this.
    ByGatherRay(H),
}

/// Most lights among which one is chosen by what it would bring.
const CANDIDATES: usize = 8;

/// Share of these choices that ignore what a light would bring: the brightest may be behind a wall.
const BLIND: f32 = 0.2;

/// Light from one direction, not yet tested for occlusion.
struct Unshadowed {
    light: usize,
    wi: Vec3,
    distance: f32,
    radiance: Rgb,
    /// Mean of its channels.
    value: f32,
}

impl Unshadowed {
    /// This sample divided by a probability.
    fn over(self, p: f32) -> Self {
        Self {
            radiance: self.radiance / p,
            value: self.value / p,
            ..self
        }
    }
}

impl<V: VisibilityMask> CameraTracer<'_, V> {
    /// Direct light of sampled lights at x, radiance at the film, recorded as this `part`. `weight`: of a light's
    /// sample, given how often the light is chosen and a local direction.
    pub(super) fn lit_by_samples(
        &self,
        x: &Vertex,
        (seen, lights): (Seen<V::Hidden>, &LocalChoice),
        (beta, part): (Rgb, Part),
        context: &mut PathContext<'_>,
        weight: impl Fn(LightChoice, &DirectSample, Vec3) -> f32,
    ) -> Rgb {
        let PathContext {
            sampler, record, rays, ..
        } = context;
        let candidates = match x.bsdf.has(BsdfFlags::GLOSSY) && matches!(seen, Seen::First) {
            true => self.scene.lights().len().min(CANDIDATES),
            false => 1,
        };
        if candidates > 1 {
            *rays += 1;
            let (radiance, light) = self.best_light_sample(x, seen, lights, candidates, sampler, weight);
            record.add(part, light, beta * radiance);
            return beta * radiance;
        }
        let mut sum = Rgb::ZERO;
        lights.each(sampler, |choice, sampler| {
            let u = self.draw_direct(choice.light, sampler);
            if let Some(found) = self.unshadowed(x, seen, choice, u, &weight) {
                *rays += 1;
                let radiance = beta * self.shadowed(x, seen, &found, sampler) / choice.pmf;
                record.add(part, choice.light, radiance);
                sum += radiance;
            }
        });
        sum
    }

    /// Direct light of one light, and that light's index. It is chosen from a few candidates by what each would bring
    /// if unoccluded, the BSDF included (Talbot et al. 2005, resampled importance sampling).
    fn best_light_sample(
        &self,
        x: &Vertex,
        seen: Seen<V::Hidden>,
        lights: &LocalChoice,
        candidates: usize,
        sampler: &mut Sampler,
        weight: impl Fn(LightChoice, &DirectSample, Vec3) -> f32,
    ) -> (Rgb, usize) {
        let all = self.scene.lights().len() == candidates;
        let mut found = [const { None }; CANDIDATES];
        let (mut sum, mut count) = (0.0, 0.0);
        for (light, found) in found.iter_mut().enumerate().take(candidates) {
            let (light, p) = match all {
                true => (light, 1.0),
                false => match lights.sample(sampler.next_1d()) {
                    Some(choice) => (choice.light, choice.pmf * candidates as f32),
                    None => break,
                },
            };
            // The weight of paths that meet the light uses this as well.
            let pmf = lights.samples_of(light);
            if pmf == 0.0 {
                continue;
            }
            let u = self.draw_direct(light, sampler);
            let choice = LightChoice { light, pmf, u: 0.0 };
            *found = (self.unshadowed(x, seen, choice, u, &weight)).map(|found| found.over(p));
            if let Some(found) = found {
                sum += found.value;
                count += 1.0;
            }
        }
        let probability = |found: &Unshadowed| (1.0 - BLIND) * found.value / sum + BLIND / count;
        let mut u = sampler.next_1d();
        let mut chosen = None;
        for found in found.iter().flatten() {
            chosen = Some(found);
            u -= probability(found);
            if u < 0.0 {
                break;
            }
        }
        match chosen {
            Some(found) => {
                let radiance = self.shadowed(x, seen, found, sampler) / probability(found);
                (radiance, found.light)
            }
            None => (Rgb::ZERO, 0),
        }
    }

    /// How likely each light is to be chosen at x.
    pub(super) fn light_choice(&self, x: &Vertex, seen: Seen<V::Hidden>) -> LocalChoice<'_> {
        let by_power = match seen {
            Seen::First => self.mask.selector(self.aimed_at(), x.hit.object),
            Seen::Later => self.mask.emitters(self.aimed_at()),
            Seen::Last | Seen::ByGatherRay(_) => self.mask.emitters(&self.scene.selectors),
        };
        let sources = &self.scene.light_sources;
        sources.choice_at(x.hit.point, x.facing(), by_power)
    }

    /// The lights sampled where a ray goes on that may meet the others by chance.
    pub(super) fn aimed_at(&self) -> &Selectors {
        self.scene.aimed_at()
    }

    fn draw_direct(&self, light: usize, sampler: &mut Sampler) -> (Vec2, f32) {
        self.scene.lights()[light].draw_direct(self.scene.objects(), sampler)
    }

    /// Direct light of a chosen light, ignoring occlusion.
    fn unshadowed(
        &self,
        x: &Vertex,
        seen: Seen<V::Hidden>,
        choice: LightChoice,
        (u, u_primitive): (Vec2, f32),
        weight: impl Fn(LightChoice, &DirectSample, Vec3) -> f32,
    ) -> Option<Unshadowed> {
        let scene = self.scene;
        let light = &scene.lights()[choice.light];
        let direct = light.sample_direct(scene.objects(), x.hit.point, u, u_primitive)?;
        let wi = x.frame.to_local(direct.wi);
        if wi.z * x.hit.ng.dot(direct.wi) <= 0.0 {
            return None;
        }
        let f = x.value(wi);
        if f == Rgb::ZERO {
            return None;
        }
        let object = x.hit.object;
        let is_unlit = match seen {
            Seen::First => self.is_unlit(x, direct.wi, choice.light),
            Seen::Later | Seen::Last => self.mask.hides_light(self.mask.from(Start::Gather), choice.light),
            Seen::ByGatherRay(by) => {
                let hidden = self.mask.from(Start::Light(choice.light));
                self.mask.hides(hidden, object) || self.mask.hides_light(by, choice.light)
            }
        };
        if is_unlit {
            return None;
        }
        let weight = weight(choice, &direct, wi);
        let radiance = f * direct.weight * (wi.z.abs() * weight);
        let value = mean(radiance);
        (value != 0.0).then_some(Unshadowed {
            light: choice.light,
            wi: direct.wi,
            distance: direct.distance,
            radiance,
            value,
        })
    }

    /// What remains of it after occlusion.
    fn shadowed(&self, x: &Vertex, seen: Seen<V::Hidden>, found: &Unshadowed, sampler: &mut Sampler) -> Rgb {
        let scene = self.scene;
        let (start, end) = match seen {
            Seen::First => (x.shadow_start(found.wi), Start::ShadowOf(found.light)),
            Seen::Later | Seen::Last => (Start::Gather, Start::Gather),
            Seen::ByGatherRay(_) => (Start::Light(found.light), Start::Light(found.light)),
        };
        let (hidden, too) = (self.mask.from(start), self.mask.from(end));
        let (ray, distance) = x.hit.ray_to(found.wi, found.distance);
        let medium = x.medium_towards(scene, found.wi);
        let hides = |object| self.mask.hides(hidden, object) || self.mask.hides(too, object);
        match scene.reaching(found.light, (ray, distance), medium, hides, sampler) {
            Some(tr) => found.radiance * tr,
            None => Rgb::ZERO,
        }
    }
}
