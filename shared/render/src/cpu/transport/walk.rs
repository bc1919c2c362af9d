//! What a camera path finds beyond the first surface that is not followed, or beyond its first scattering in a medium
//! without beams: a path tracer with light sampling, in which photons and beams bring caustics.

use super::direct::Seen;
use super::vertex::{OneLobe, Vertex};
use super::{CameraTracer, PathContext};
use crate::cpu::beam::estimate::{CameraSegment, CameraSegments};
use crate::cpu::photon_map::{Arrival, SurfacePhoton};
use crate::math::{Ray, Rgb, Vec3};
use crate::plan::aov::Part;
use crate::plan::estimators::{Caustics, PathEnds};
use crate::plan::weights::{FoundBy, path_weight};
use crate::roulette;
use crate::sampler::{Sampler, VERTEX};
use crate::warp::power_heuristic;
use crate::world::bsdf::{Material, TransportMode};
use crate::world::geometry::SurfaceHit;
use crate::world::light::{DirectSample, Environment, ImagePoint, LightChoice, LightHit, LightPoint, LocalChoice};
use crate::world::mask::{Start, VisibilityMask};
use crate::world::medium::{Flight, MediumId};

/// Which light is wanted along a ray from a surface.
#[derive(Clone, Copy)]
pub(super) struct Wanted {
    /// Straight from lights.
    pub direct: bool,
    /// From surfaces and media.
    pub indirect: bool,
}

/// A path on its way.
pub(super) struct Walk<'v, H> {
    pub ray: Ray,
    pub medium: MediumId,
    /// What the ray does not see.
    pub hidden: H,
    /// Throughput from the film.
    pub beta: Rgb,
    /// Throughput from where the walk began, by reflectances alone: the compression of radiance by refraction comes and
    /// goes.
    pub track: Rgb,
    /// Where the direction was drawn. `None` behind specular surfaces and followed lobes, through which photons bring
    /// light.
    pub drawn: Option<Drawn<'v>>,
    /// Directions drawn at the last vertex before the specular surfaces and followed lobes that the path came by since,
    /// per projected solid angle and over what photons are worth there. `None`: the vertex was in a medium.
    pub behind: Option<f32>,
    /// For the first ray of the walk.
    pub wanted: Wanted,
    /// Scatterings since the walk began.
    pub depth: u32,
}

/// How a path has met a light.
#[derive(Clone, Copy)]
enum Met<'a> {
    /// As a surface light.
    Surface(&'a SurfaceHit),
    /// As an environment, with the direction's place in it.
    Around(&'a Environment, &'a ImagePoint),
    /// As an emissive medium.
    Within,
}

/// A point where lights were sampled as well.
pub(super) struct Drawn<'v> {
    pub point: Vec3,
    /// How those lights were chosen.
    pub lights: LocalChoice<'v>,
    /// Density of the direction per solid angle, times the number of directions drawn.
    pub density: f32,
    /// See [`Walk::behind`].
    pub projected: Option<f32>,
    /// From that point to the start of the path's ray.
    pub distance: f32,
    /// The first surface of the camera path, whose rules apply.
    pub at: Option<&'v Vertex<'v>>,
}

impl<V: VisibilityMask> CameraTracer<'_, V> {
    /// Everything found along the path: radiance at the film, without the weight of the wavelength that the path has at
    /// its beginning.
    pub(super) fn walk<'v>(&'v self, walk: Walk<'v, V::Hidden>, context: &mut PathContext<'_>) -> Rgb {
        let before = context.wave;
        let radiance = self.walk_on(walk, context);
        if context.wave != before {
            context.set_wave(before);
        }
        radiance
    }

    fn walk_on<'v>(&'v self, mut walk: Walk<'v, V::Hidden>, context: &mut PathContext<'_>) -> Rgb {
        let scene = self.scene;
        // The weight of a wavelength that the path gets on its way.
        let mut tint = Rgb::ONE;
        let mut radiance = Rgb::ZERO;
        // Distance since the path last turned.
        let mut straight = 0.0;
        while walk.beta.max_element() > 0.0 {
            context.rays += 1;
            context.sampler.align(VERTEX);
            let hit = scene.first_hit(&walk.ray, |object| self.mask.hides(walk.hidden, object));
            if let Some(id) = walk.medium {
                let length = hit.as_ref().map_or(f32::INFINITY, |h| h.t);
                if !scene.emitting(walk.medium).is_empty() {
                    radiance += tint * self.emitted_within(&walk, id, length, context);
                }
                let scatters = !self.estimators().is_by_beams(id) && scene.media()[usize::from(id)].scatters();
                if !scatters {
                    walk.beta *= scene.transmittance(walk.medium, &walk.ray, length, &mut context.sampler);
                } else if let Some(distance) = self.fly(&mut walk, id, length, context) {
                    if !walk.wanted.indirect {
                        return radiance;
                    }
                    radiance += tint * self.scatter_in_medium(&mut walk, id, distance, context);
                    if !walk.survives(self.plan.patience, &mut context.sampler) {
                        return radiance;
                    }
                    straight = 0.0;
                    continue;
                }
            }
            let Some(mut hit) = hit else {
                scene.each_environment(walk.ray.dir, |light, environment, place| {
                    let share = self.share(&walk, light, Met::Around(environment, place));
                    if share > 0.0 {
                        let emitted = environment.radiance_at(place) * share;
                        radiance += tint * self.found(&walk, light, emitted, context);
                    }
                });
                return radiance;
            };
            if let Some(drawn) = &mut walk.drawn {
                drawn.distance += hit.t;
            }
            straight += hit.t;
            if let Some(light) = scene.objects()[hit.object as usize].light
                && !match &walk.drawn {
                    Some(_) => scene.only_sampled_by_paths(light as usize),
                    None => scene.only_sampled(light as usize),
                }
            {
                let emitted = scene.emitted(&hit, walk.ray.dir, straight);
                if emitted != Rgb::ZERO {
                    let hides = |object| self.mask.hides(walk.hidden, object);
                    let (dir, medium) = (walk.ray.dir, walk.medium);
                    let emitted =
                        emitted * scene.within_lamp(&hit, (dir, straight), medium, hides, &mut context.sampler);
                    let share = self.share(&walk, light as usize, Met::Surface(&hit));
                    radiance += tint * self.found(&walk, light as usize, emitted * share, context);
                }
            }
            let Some(material) = scene.material(&hit).met(&hit.at, || context.sampler.next_1d()) else {
                walk.medium = scene.medium_beyond(&hit, walk.ray.dir, walk.medium);
                walk.ray = hit.spawn_ray(walk.ray.dir);
                continue;
            };
            straight = 0.0;
            if !walk.wanted.indirect {
                return radiance;
            }
            if let Some(wave) = self.wave_at(material, context) {
                tint = wave.weight;
                context.set_wave(Some(wave));
            }
            let Some(more) = self.meet_surface(&mut walk, material, &mut hit, context) else {
                return radiance;
            };
            radiance += tint * more;
        }
        radiance
    }

    /// What a medium emits into the path, within `length` of it.
    fn emitted_within(&self, walk: &Walk<V::Hidden>, id: u16, length: f32, context: &mut PathContext<'_>) -> Rgb {
        let scene = self.scene;
        let mut radiance = Rgb::ZERO;
        for &light in scene.emitting(Some(id)) {
            let light = light as usize;
            let share = self.share(walk, light, Met::Within);
            if share > 0.0
                && let Some(volume) = scene.volume_light(light)
            {
                let medium = &scene.media()[usize::from(id)];
                let emitted = volume.arriving(medium, &walk.ray, length, &mut context.sampler);
                radiance += self.found(walk, light, emitted * share, context);
            }
        }
        radiance
    }

    /// Records and returns the light of a light that the path has met.
    fn found(&self, walk: &Walk<V::Hidden>, light: usize, emitted: Rgb, context: &mut PathContext<'_>) -> Rgb {
        let part = match walk.depth {
            0 => Part::Direct,
            _ => Part::Surface,
        };
        let radiance = walk.beta * emitted;
        context.record.add(part, light, radiance);
        radiance
    }

    /// Weight of light met by chance, against sampling it where the direction was drawn.
    fn share(&self, walk: &Walk<V::Hidden>, light: usize, met: Met<'_>) -> f32 {
        let Some(drawn) = &walk.drawn else {
            return self.share_of_caustic(walk, light, met);
        };
        let wi = walk.ray.dir;
        let is_hidden = match drawn.at {
            Some(x) => !walk.wanted.direct || self.mask.links_shadows(light) || self.is_unlit(x, wi, light),
            None => self.mask.hides_light(self.mask.from(Start::Gather), light),
        };
        if is_hidden {
            return 0.0;
        }
        let samples = drawn.lights.samples_of(light);
        if samples == 0.0 {
            return 1.0;
        }
        let scene = self.scene;
        let pdf = match met {
            Met::Surface(hit) => {
                let hit = Some(LightHit {
                    normal: hit.ng,
                    primitive: hit.primitive,
                    distance: drawn.distance,
                });
                scene.lights()[light].pdf_direct(scene.objects(), drawn.point, wi, hit)
            }
            Met::Around(environment, place) => environment.pdf_at(place),
            Met::Within => scene.lights()[light].pdf_direct(scene.objects(), drawn.point, wi, None),
        };
        power_heuristic(drawn.density, pdf * samples)
    }

    /// Weight of light met by way of specular surfaces, against photons.
    fn share_of_caustic(&self, walk: &Walk<V::Hidden>, light: usize, met: Met<'_>) -> f32 {
        if self.mask.hides_light(self.mask.from(Start::Gather), light) {
            // The light's photons would leave nothing either.
            return 0.0;
        }
        if self.estimators().caustics_of(light) == Caustics::Paths {
            return 1.0;
        }
        match (self.weights.in_caustic[light], walk.behind) {
            (0.0, _) | (_, None) => 0.0,
            (in_caustic, Some(projected)) => {
                let (objects, bounds) = (self.scene.objects(), self.scene.bounds());
                let dir = -walk.ray.dir;
                let on = match met {
                    Met::Surface(hit) => LightPoint {
                        normal: hit.ng,
                        primitive: hit.primitive,
                    },
                    Met::Around(..) | Met::Within => LightPoint {
                        normal: dir,
                        primitive: 0,
                    },
                };
                let density = self.scene.lights()[light].emitted_density(objects, bounds, dir, on);
                path_weight(in_caustic * density, projected)
            }
        }
    }

    /// Fly through a medium without beams. Returns the distance of a scattering, if any.
    fn fly(&self, walk: &mut Walk<V::Hidden>, id: u16, length: f32, context: &mut PathContext<'_>) -> Option<f32> {
        let medium = &self.scene.media()[usize::from(id)];
        if self.estimators().leave_beams() && walk.wanted.indirect && !self.scene.is_enclosed(id) {
            let segment = CameraSegment {
                part: context.record.part_or(Part::Surface),
                ..CameraSegment::new(walk.ray, length, walk.beta, id)
            };
            self.leave_segment(segment, context);
        }
        match medium.sample_flight(&walk.ray, length, walk.beta, &mut context.sampler) {
            Flight::Passed { weight } => {
                walk.pass(weight);
                None
            }
            Flight::Scattered { distance, weight } => {
                walk.pass(weight);
                Some(distance)
            }
        }
    }

    /// Leave a segment along which beams are gathered, as long as the path's way in the medium. Returns the
    /// transmittance over all of it.
    pub(super) fn leave_segment(&self, segment: CameraSegment, context: &mut PathContext<'_>) -> Rgb {
        let medium = &self.scene.media()[usize::from(segment.medium)];
        let CameraSegments { segments, steps } = &mut *context.segments;
        let (ray, sampler) = (&segment.ray, &mut context.sampler);
        let (seen, transmittance) = medium.segment(ray, segment.length, sampler, steps);
        if let Some(seen) = seen {
            segments.push(CameraSegment {
                length: seen.range[1],
                pixel: context.pixel,
                wave: context.wave.map(|wave| wave.number),
                steps: seen.steps,
                ..segment
            });
        }
        transmittance
    }

    /// Scatter a path in a medium: adds direct light there, and draws a direction to go on in.
    pub(super) fn scatter_in_medium<'v>(
        &'v self,
        walk: &mut Walk<'v, V::Hidden>,
        id: u16,
        distance: f32,
        context: &mut PathContext<'_>,
    ) -> Rgb {
        let (point, dir) = (walk.ray.at(distance), walk.ray.dir);
        let phase = self.scene.media()[usize::from(id)].phase();
        let at = Ray { origin: point, dir };
        let mut radiance = Rgb::ZERO;
        let PathContext {
            sampler, record, rays, ..
        } = &mut *context;
        let by_power = self.mask.emitters(self.aimed_at());
        let lights = self.scene.light_sources.choice_at(point, None, by_power);
        if !self.scene.is_enclosed(id) {
            lights.each(sampler, |choice, sampler| {
                *rays += 1;
                let lit = walk.beta * self.lit_in_medium(&at, id, choice, sampler);
                record.add(Part::Surface, choice.light, lit);
                radiance += lit;
            });
        }
        let new = phase.sample(dir, context.sampler.next_2d());
        walk.drawn = Some(Drawn {
            point,
            lights,
            density: phase.eval_directions(dir, new),
            projected: None,
            distance: 0.0,
            at: None,
        });
        walk.hidden = self.mask.from(Start::Gather);
        walk.ray = Ray {
            origin: point,
            dir: new,
        };
        walk.depth += 1;
        radiance
    }

    /// Direct light of a chosen light that a medium scatters at the ray's origin against its direction, balanced
    /// against drawing the direction there.
    fn lit_in_medium(&self, at: &Ray, id: u16, choice: LightChoice, sampler: &mut Sampler) -> Rgb {
        let scene = self.scene;
        let phase = scene.media()[usize::from(id)].phase();
        let light = &scene.lights()[choice.light];
        let (u, u_primitive) = light.draw_direct(scene.objects(), sampler);
        let Some(direct) = light.sample_direct(scene.objects(), at.origin, u, u_primitive) else {
            return Rgb::ZERO;
        };
        let value = phase.eval_directions(at.dir, direct.wi);
        let share = match direct.unmet || scene.only_sampled_by_paths(choice.light) {
            true => 1.0,
            false => power_heuristic(direct.pdf * choice.pmf, value),
        };
        let ray = Ray {
            origin: at.origin,
            dir: direct.wi,
        };
        let hidden = self.mask.from(Start::Gather);
        if self.mask.hides_light(hidden, choice.light) {
            return Rgb::ZERO;
        }
        let hides = |object| self.mask.hides(hidden, object);
        match scene.reaching(choice.light, (ray, direct.distance), Some(id), hides, sampler) {
            Some(tr) => direct.weight * tr * (value * share / choice.pmf),
            None => Rgb::ZERO,
        }
    }

    /// Direct light and caustics at a surface, radiance at the film, and a direction to go on in. `None`: the path ends
    /// before.
    fn meet_surface<'v>(
        &'v self,
        walk: &mut Walk<'v, V::Hidden>,
        material: &Material,
        hit: &mut SurfaceHit,
        context: &mut PathContext<'_>,
    ) -> Option<Rgb> {
        let scene = self.scene;
        let at = scene.interaction(material, hit, walk.ray.dir, context.wave);
        let hit = &*hit;
        let mut y = Vertex::new(at, hit, walk.medium);
        if y.bsdf.is_black() {
            return None;
        }
        let mut radiance = Rgb::ZERO;
        let [draws_lobe, draws_direction] = y.bsdf.draws();
        let u_lobe = context.sampler.next_1d_if(draws_lobe);
        let lobe = match material.is_specular() || material.follows(&y.bsdf) {
            true => OneLobe::followed(u_lobe),
            false => y.one_lobe(u_lobe),
        };
        y.is_followed = lobe.is_followed;
        walk.pass(Rgb::splat(lobe.weight));
        let mut lights = None;
        if !lobe.is_followed {
            let drawn = walk.drawn.as_ref();
            let flown = drawn.map_or(0.0, |drawn| drawn.distance);
            if self.estimators().ends_paths(&y.bsdf) && flown >= self.weights.least_flight {
                let from = drawn.and_then(|drawn| Some((drawn.at?, drawn.density)));
                let is_found = self.estimators().ends() != PathEnds::Second
                    || from.is_some_and(|(x, _)| self.is_glossy(x) || self.mask.is_gathered(hit.object));
                let beta = walk.beta;
                walk.beta = Rgb::ZERO;
                return is_found.then(|| self.brought_by_photons(from, &y, beta, context));
            }
            let lights = lights.insert(self.light_choice(&y, Seen::Later));
            radiance = self.lit_later(&y, lights, walk.beta, context);
        } else if self.estimators().photons_go_on() {
            // Photons bring what comes by way of it.
            return None;
        }
        let mode = TransportMode::Radiance;
        let u = context.sampler.next_2d_if(draws_direction);
        let Some(sample) = y.bsdf.sample(y.local_wo, lobe.u, u, mode) else {
            walk.beta = Rgb::ZERO;
            return Some(radiance);
        };
        let wi = y.frame.to_world(sample.wi).normalize();
        if (!sample.delta || y.bump_shadowing.is_some()) && sample.wi.z * hit.ng.dot(wi) <= 0.0 {
            walk.beta = Rgb::ZERO;
            return Some(radiance);
        }
        walk.pass(y.weight(&sample));
        if sample.transmitted {
            let eta = material.eta_of_crossing(hit.ng.dot(walk.ray.dir) > 0.0, context.wave);
            walk.track /= eta * eta;
            walk.medium = scene.medium_beyond(hit, wi, walk.medium);
        }
        walk.drawn = match lights {
            None => {
                walk.behind = walk.drawn.take().map_or(walk.behind, |drawn| drawn.projected);
                None
            }
            Some(lights) => Some(Drawn {
                point: hit.point,
                lights,
                density: sample.pdf,
                projected: Some(sample.pdf / hit.ng.dot(wi).abs()),
                distance: 0.0,
                at: None,
            }),
        };
        walk.hidden = self.mask.from(Start::Gather);
        walk.ray = hit.spawn_ray(wi);
        walk.depth += 1;
        if !walk.survives(self.plan.patience, &mut context.sampler) {
            walk.beta = Rgb::ZERO;
        }
        Some(radiance)
    }

    /// Direct light, balanced against the direction that is also drawn at y, and photons.
    fn lit_later(&self, y: &Vertex, lights: &LocalChoice, beta: Rgb, context: &mut PathContext<'_>) -> Rgb {
        let balanced = |choice: LightChoice, direct: &DirectSample, wi: Vec3| match direct.unmet
            || self.scene.only_sampled_by_paths(choice.light)
        {
            true => 1.0,
            false => power_heuristic(direct.pdf * choice.pmf, y.pdf(y.local_wo, wi)),
        };
        let lit = self.lit_by_samples(y, (Seen::Later, lights), (beta, Part::Surface), context, balanced);
        // The path itself finds what surfaces send here.
        let weight = |photon: &SurfacePhoton, wi: Vec3| match photon.arrival {
            Arrival::Surface => 0.0,
            Arrival::Direct | Arrival::Caustic | Arrival::Scattered if photon.found_by == FoundBy::Photons => 1.0,
            Arrival::Direct | Arrival::Caustic | Arrival::Scattered => {
                let density = y.pdf(y.local_wo, wi) / y.hit.ng.dot(photon.wi).abs();
                photon.found_by.photon_weight(1.0, density)
            }
        };
        lit + self.photon_radiance(y, weight, beta, context)
    }
}

impl<H> Walk<'_, H> {
    pub(super) fn pass(&mut self, weight: Rgb) {
        self.beta *= weight;
        self.track *= weight;
    }

    /// Russian roulette: the path goes on with a probability in proportion to its throughput.
    pub(super) fn survives(&mut self, patience: f32, sampler: &mut Sampler) -> bool {
        let q = roulette::FACTOR * patience * self.track.max_element();
        let survived = roulette::survives(q, self.depth, sampler);
        if let Some(q) = survived {
            self.beta /= q;
            self.track /= q;
        }
        survived.is_some()
    }
}
