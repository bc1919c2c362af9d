//! Light sent on by the first surface that is not followed: direct light, gather rays, and photons.

use super::direct::Seen;
use super::vertex::Vertex;
use super::walk::{Drawn, Walk, Wanted};
use super::{CameraTracer, PathContext};
use crate::cpu::photon_map::{Arrival, SurfacePhoton};
use crate::math::{Rgb, Vec2, Vec3};
use crate::plan::aov::Part;
use crate::plan::estimators::PathEnds;
use crate::plan::weights::{DEEPER, FoundBy, path_weight};
use crate::sampler::Sampler;
use crate::warp::power_heuristic;
use crate::world::bsdf::{BsdfFlags, TransportMode};
use crate::world::light::{DirectSample, LightChoice, LightHit, LocalChoice};
use crate::world::mask::{Start, VisibilityMask};

impl<V: VisibilityMask> CameraTracer<'_, V> {
    /// Radiance at the film that leaves x towards the camera path, without x's own emission. `beta`: throughput from
    /// the film to x.
    pub(super) fn scattered(&self, x: &Vertex, beta: Rgb, context: &mut PathContext<'_>) -> Rgb {
        if !self.mask.is_glossy(x.hit.object) || x.bsdf.is_matt() {
            return self.scattered_by(x, beta, context);
        }
        let is_gloss = true;
        let Some([gloss, base]) = x.bsdf.gloss_and_base() else {
            return self.scattered_by(&Vertex { is_gloss, ..*x }, beta, context);
        };
        // The two lobes obey different rules.
        let bsdf = gloss;
        let gloss = Vertex { bsdf, is_gloss, ..*x };
        let base = Vertex { bsdf: base, ..*x };
        self.scattered_by(&gloss, beta, context) + self.scattered_by(&base, beta, context)
    }

    /// As [`Self::scattered`], if the same rules hold for all of x.
    fn scattered_by(&self, x: &Vertex, beta: Rgb, context: &mut PathContext<'_>) -> Rgb {
        if x.bsdf.is_black() {
            return Rgb::ZERO;
        }
        // Where fog hides most of it, what a gather ray brings is not worth a ray each time.
        let q = (beta.max_element() / SURE_THROUGHPUT).min(1.0);
        let side = match q == 1.0 && x.bsdf.has(BsdfFlags::GLOSSY) {
            true => self.plan.gloss_rays_side,
            false => 1,
        };
        let rays = (side * side) as f32;
        let lights = self.light_choice(x, Seen::First);
        if self.ends_at(x) && self.scene.aimed_at.is_none() {
            // No light and no surface is left to be met.
            let of_light = (Seen::First, &lights);
            let lit = self.lit_by_samples(x, of_light, (beta, Part::Direct), context, |_, _, _| 1.0);
            return lit + self.photon_radiance(x, |_, _| 1.0, beta, context);
        }
        let mut radiance = self.lit_directly(x, &lights, rays, beta, context);
        if side > 1 {
            let share = 1.0 / rays;
            let mut strata = Strata::new(side, &mut context.sampler);
            while let Some(uniforms) = strata.next(&mut context.sampler) {
                radiance += self.gather_ray((x, &lights), uniforms, rays, beta * share, context);
            }
        } else if q == 1.0 || context.sampler.next_1d() < q {
            let [draws_lobe, draws_direction] = x.bsdf.draws();
            let sampler = &mut context.sampler;
            let uniforms = (sampler.next_1d_if(draws_lobe), sampler.next_2d_if(draws_direction));
            radiance += self.gather_ray((x, &lights), uniforms, 1.0, beta / q, context);
        }
        let is_glossy = self.is_glossy(x);
        let gathers = is_glossy || self.mask.gathers(x.hit.object);
        let ends = self.ends_at(x);
        let scale = self.photon_scale(x);
        let weight = |photon: &SurfacePhoton, wi: Vec3| {
            if V::RULED && (photon.found_by == FoundBy::PathsByRule || is_glossy && photon.arrival == Arrival::Surface)
            {
                return 0.0;
            }
            if photon.found_by == FoundBy::Photons || !gathers || ends {
                return 1.0;
            }
            let cos = x.hit.ng.dot(photon.wi).abs();
            let density = rays * x.pdf(x.local_wo, wi) / cos;
            photon.found_by.photon_weight(scale, density)
        };
        radiance + self.photon_radiance(x, weight, beta, context)
    }

    /// Whether photons at x bring everything that surfaces and media send there.
    fn ends_at(&self, x: &Vertex) -> bool {
        self.estimators().ends() == PathEnds::First && !V::RULED && !x.bsdf.has(BsdfFlags::GLOSSY)
    }

    /// Factor on the expected number of photons at x.
    fn photon_scale(&self, x: &Vertex) -> f32 {
        match x.bsdf.has(BsdfFlags::GLOSSY) {
            true => self.weights.on_gloss,
            false => 1.0,
        }
    }

    /// Light of sampled lights at x, radiance at the film. `rays`: how many directions are drawn there as well, which
    /// may meet the same light.
    pub(super) fn lit_directly(
        &self,
        x: &Vertex,
        lights: &LocalChoice,
        rays: f32,
        beta: Rgb,
        context: &mut PathContext<'_>,
    ) -> Rgb {
        let balanced = |choice: LightChoice, direct: &DirectSample, wi: Vec3| {
            let light = choice.light;
            let hidden = self.mask.from(x.shadow_start(direct.wi));
            // By a followed lobe, the path also sees emission of what it passes.
            if direct.unmet
                || self.scene.only_sampled_by_paths(light) && !x.is_followed
                || self.mask.links_shadows(light)
                || self.mask.hides_shape_of(self.scene, hidden, light)
            {
                return 1.0;
            }
            power_heuristic(direct.pdf * choice.pmf, rays * x.pdf(x.local_wo, wi))
        };
        self.lit_by_samples(x, (Seen::First, lights), (beta, Part::Direct), context, balanced)
    }

    /// Whether gather rays from x count as reflected or refracted.
    #[inline]
    pub(super) fn is_glossy(&self, x: &Vertex) -> bool {
        V::RULED && x.is_gloss
    }

    /// Whether rules keep a light's direct light, from `wi`, off x.
    pub(super) fn is_unlit(&self, x: &Vertex, wi: Vec3, light: usize) -> bool {
        let shadow = self.mask.from(Start::Shadow(x.hit.object));
        self.mask.hides_light(shadow, light)
            || (self.is_glossy(x) || x.is_followed) && {
                let seen = self.mask.from(x.gloss_towards(wi));
                self.mask.hides_light(seen, light) || self.mask.hides_shape_of(self.scene, seen, light)
            }
    }

    /// The ray sampled by the BSDF at x, and all light found by the path that goes on along it (see [`super::walk`]).
    /// It is one of `rays`.
    fn gather_ray(
        &self,
        (x, lights): (&Vertex, &LocalChoice),
        (u_lobe, u): (f32, Vec2),
        rays: f32,
        beta: Rgb,
        context: &mut PathContext<'_>,
    ) -> Rgb {
        let sample = x.bsdf.sample(x.local_wo, u_lobe, u, TransportMode::Radiance);
        let Some(sample) = sample else {
            return Rgb::ZERO;
        };
        let wi = x.frame.to_world(sample.wi).normalize();
        if sample.wi.z * x.hit.ng.dot(wi) <= 0.0 {
            return Rgb::ZERO;
        }
        let throughput = x.weight(&sample);
        let object = x.hit.object;
        let walk = |start, wanted| Walk {
            ray: x.hit.spawn_ray(wi),
            medium: x.medium_towards(self.scene, wi),
            hidden: self.mask.from(start),
            beta: beta * throughput,
            track: throughput,
            drawn: Some(Drawn {
                point: x.hit.point,
                lights: lights.clone(),
                density: rays * sample.pdf,
                projected: Some(rays * sample.pdf / (x.hit.ng.dot(wi).abs() * self.photon_scale(x))),
                distance: 0.0,
                at: Some(x),
            }),
            behind: None,
            wanted,
            depth: 0,
        };
        let (is_glossy, gathers) = (self.is_glossy(x), self.mask.gathers(object));
        if self.mask.one_ray(object) && !is_glossy {
            let wanted = Wanted {
                direct: true,
                indirect: gathers && !self.ends_at(x),
            };
            return self.walk(walk(Start::Shadow(object), wanted), context);
        }
        // Direct light and what surfaces send are hidden by different objects.
        let (direct, indirect) = (true, false);
        let wanted = Wanted { direct, indirect };
        let radiance = self.walk(walk(Start::Shadow(object), wanted), context);
        if !is_glossy && !gathers {
            return radiance;
        }
        let start = match is_glossy {
            true => x.gloss_towards(wi),
            false => Start::Gather,
        };
        let (direct, indirect) = (false, true);
        let wanted = Wanted { direct, indirect };
        radiance + self.walk(walk(start, wanted), context)
    }

    /// Light that y sends along a path that ends there, brought by direct light and photons. `from`: the first vertex,
    /// if the path comes straight from it, and how many rays it sent per solid angle.
    pub(super) fn brought_by_photons(
        &self,
        from: Option<(&Vertex, f32)>,
        y: &Vertex,
        beta: Rgb,
        context: &mut PathContext<'_>,
    ) -> Rgb {
        let scene = self.scene;
        // Photons get from y to x if nothing at y depends on the side from which it is seen.
        let found_too = from.filter(|(x, _)| {
            !self.is_glossy(x) && y.bump_shadowing.is_none() && y.local_wo.z * y.hit.ng.dot(y.wo) > 0.0
        });
        let cos_out = y.hit.ng.dot(y.wo).abs();
        let share = |arriving: f32, wi: Vec3| match found_too {
            Some((x, density)) => {
                let density = density / x.hit.ng.dot(y.wo).abs();
                let photons = arriving * y.pdf(wi, y.local_wo) / cos_out;
                path_weight(photons * self.photon_scale(x), density)
            }
            None => 1.0,
        };
        let weight = |choice: LightChoice, direct: &DirectSample, wi: Vec3| {
            let at = LightHit {
                normal: direct.normal,
                primitive: direct.primitive,
                distance: direct.distance,
            };
            let density = scene.lights()[choice.light].photon_density(
                scene.objects(),
                scene.bounds(),
                y.hit.point,
                direct.wi,
                at,
            );
            let cos_in = direct.wi.dot(y.hit.ng).abs();
            share(self.weights.in_kernel * density * cos_in, wi)
        };
        let by = from.map(|(x, _)| self.mask.from(Start::Photon(x.hit.object)));
        let seen = by.map_or(Seen::Last, Seen::ByGatherRay);
        let lights = self.light_choice(y, seen);
        let lit = self.lit_by_samples(y, (seen, &lights), (beta, Part::Surface), context, weight);
        let weight = |photon: &SurfacePhoton, wi: Vec3| {
            if by.is_some_and(|by| self.mask.hides_kind(by, photon.light_kind)) {
                return 0.0;
            }
            share(DEEPER, wi)
        };
        lit + self.photon_radiance(y, weight, beta, context)
    }

    /// Density estimate over the surface photons around a point, radiance at the film. `weight`: of a photon, given its
    /// local direction.
    pub(super) fn photon_radiance(
        &self,
        x: &Vertex,
        weight: impl Fn(&SurfacePhoton, Vec3) -> f32,
        beta: Rgb,
        context: &mut PathContext<'_>,
    ) -> Rgb {
        let mut radiance = Rgb::ZERO;
        let Some(photons) = self.photons else {
            return radiance;
        };
        if x.is_even() {
            // The same for all directions on the side of wo, at any azimuth.
            let f = beta * x.value(x.local_wo);
            if f == Rgb::ZERO {
                return radiance;
            }
            photons.gather(x.hit.point, x.hit.ng, |photon, kernel| {
                let cos = x.hit.ng.dot(photon.wi);
                if cos * x.local_wo.z <= 0.0 || !photon.lobes.sees(x.is_followed) {
                    return;
                }
                let weight = weight(photon, Vec3::new(0.0, 0.0, cos));
                if weight == 0.0 || photon.is_hidden_from(self.scene, x.hit.point) {
                    return;
                }
                let reflected = f * self.found_power(photon, context) * (kernel * weight);
                radiance += reflected;
                context.record.add_of_group(Part::Surface, photon.group, reflected);
            });
            return radiance;
        }
        photons.gather(x.hit.point, x.hit.ng, |photon, kernel| {
            let wi = x.frame.to_local(photon.wi);
            let cos_g = x.hit.ng.dot(photon.wi);
            if wi.z * cos_g <= 0.0 || !photon.lobes.sees(x.is_followed) {
                return;
            }
            let weight = weight(photon, wi);
            if weight == 0.0 || photon.is_hidden_from(self.scene, x.hit.point) {
                return;
            }
            let f = beta * x.value(wi);
            // Flux is counted on the geometric surface; the BSDF's cosine is with the shading normal.
            let cosines = if x.hit.ns == x.hit.ng {
                1.0
            } else {
                (wi.z / cos_g).min(MAX_COSINE_RATIO)
            };
            let reflected = f * self.found_power(photon, context) * (kernel * cosines * weight);
            radiance += reflected;
            context.record.add_of_group(Part::Surface, photon.group, reflected);
        });
        radiance
    }
}

impl<V: VisibilityMask> CameraTracer<'_, V> {
    /// A photon's flux for the path that finds it.
    #[inline]
    fn found_power(&self, photon: &SurfacePhoton, context: &PathContext<'_>) -> Rgb {
        match (photon.wave, &self.waves) {
            (Some(wave), Some(waves)) => photon.power * waves.factor(wave, context.wave.map(|wave| wave.number)),
            _ => photon.power,
        }
    }
}

/// From this throughput on, a gather ray is always sent.
const SURE_THROUGHPUT: f32 = 0.5;

/// Random numbers for several directions: one in each cell of a grid, and each in its own part of the range that
/// chooses the lobe.
struct Strata {
    side: u32,
    /// The next cell.
    cell: u32,
    /// Part of the lobes' range that the first cell gets. The others get the parts after it, cyclically. Any cell may
    /// get any part.
    first: u32,
}

impl Strata {
    fn new(side: u32, sampler: &mut Sampler) -> Self {
        let cells = side * side;
        Self {
            side,
            cell: 0,
            first: ((sampler.next_1d() * cells as f32) as u32).min(cells - 1),
        }
    }

    fn next(&mut self, sampler: &mut Sampler) -> Option<(f32, Vec2)> {
        let cells = self.side * self.side;
        if self.cell == cells {
            return None;
        }
        let (row, column) = (self.cell / self.side, self.cell % self.side);
        let part = (self.first + self.cell) % cells;
        self.cell += 1;
        let u = (Vec2::new(column as f32, row as f32) + sampler.next_2d()) / self.side as f32;
        let u_lobe = (part as f32 + sampler.next_1d()) / cells as f32;
        Some((u_lobe.min(ONE_MINUS), u.min(Vec2::splat(ONE_MINUS))))
    }
}

/// The largest number below one.
const ONE_MINUS: f32 = 1.0 - f32::EPSILON / 2.0;

/// Bound on the ratio of shading to geometric cosine, so that one photon at a grazing angle does not outshine the rest.
const MAX_COSINE_RATIO: f32 = 10.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::Purpose;

    /// Every cell gets a direction, every part of the lobes' range gets one, and all pairs are equally likely: 4000
    /// draws, each count within five standard deviations.
    #[test]
    fn strata_are_all_there_and_meet_evenly() {
        let mut sampler = Sampler::new(1, 0, Purpose::Test, 1);
        let mut pairs = [[0u32; 4]; 4];
        for _ in 0..4000 {
            let mut strata = Strata::new(2, &mut sampler);
            let (mut cells, mut parts) = (0u32, 0u32);
            while let Some((u_lobe, u)) = strata.next(&mut sampler) {
                let cell = (u.y * 2.0) as usize * 2 + (u.x * 2.0) as usize;
                let part = (u_lobe * 4.0) as usize;
                cells |= 1 << cell;
                parts |= 1 << part;
                pairs[cell][part] += 1;
            }
            assert_eq!((cells, parts), (15, 15));
        }
        for count in pairs.into_iter().flatten() {
            let deviation = libm::sqrt(4000.0 * 0.25 * 0.75);
            assert!((f64::from(count) - 1000.0).abs() < 5.0 * deviation, "{pairs:?}");
        }
    }
}
