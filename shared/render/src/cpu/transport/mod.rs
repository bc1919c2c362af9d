//! Camera paths, and which estimator counts which light path.
//!
//! Let L be a light, D a surface that scatters widely, S one that paths *follow* (specular, or a lobe of low
//! roughness), M a scattering in a medium and E the camera; boundaries of media are left out. Media are of two kinds
//! ([`crate::plan::estimators`]). In some, beams bring all light (Mb). In the others, which are dense or small, camera
//! paths are scattered themselves (Mp). A camera path goes on through S and straight through media of the first kind,
//! until it meets a *vertex* x, which is D or Mp. From there it goes on, by BSDF or phase function, to further
//! vertices:
//!
//! | light path                      | counted by                                                                  |
//! | ------------------------------- | --------------------------------------------------------------------------- |
//! | L S* E                          | the camera path meets the light, of media that emit along each segment; where the last S is rough, balanced with light sampling there |
//! | L S+ S S* E, L a point or parallel, S+ specular, the S after it rough | photons at that S                     |
//! | L Mb S* E, homogeneous medium   | a point sampled on each of the camera path's segments (`medium`)            |
//! | other … Mb S* E                 | photon beams along the camera path's segments (`beam::estimate`)            |
//! | L x …                           | direct light at x: light sampling and what the path meets next, balanced    |
//! | L S+ x …                        | photons at a surface x, beams along the segment before x in a medium; of an even sky: what the path meets behind S; of lights that are met now and then: at a surface both, balanced |
//! | … Mb S* x …                     | the same photons and beams                                                  |
//! | … (D or Mp) S* x …              | the path goes on from x to that vertex                                      |
//!
//! Photons know how they came to where they arrive ([`Arrival`](crate::cpu::photon_map::Arrival)), and are stored only
//! where they count. Without media of the first kind, and where a light is all around, they end at their first D or Mp.
//! Without S, no photon is needed at all. Gloss sends several rays from the first vertex where its light matters.
//!
//! In a scene that has media of the first kind, or whose lights all bring caustics, photons go on from vertex to vertex
//! and bring more light at hardly any cost. There a camera path *ends* at a surface y that has no narrow lobe, if it
//! has flown far enough to y (`Weights::least_flight`): direct light and all photons at y are all of its light. What
//! comes to a vertex by way of S is in its photons, wherever it came from. Light that a surface y sends to the first
//! vertex x is also found by photons at x. It is balanced with the path that ends at y by the MIS weights of
//! [`crate::plan::weights`], which sum to one. Caustics of lights that paths meet often enough are shared in the same
//! way: see there.
//!
//! Where rules restrict what photons see, every camera path ends at its second vertex.
//!
//! At a smooth dielectric the path goes both ways before its first vertex, as far as they matter. Light that a branch
//! meets always counts. The rest (everything but `L S* E`) costs more, and weak branches look for it only with some
//! probability.
//!
//! A surface with a narrow lobe and others (a coat over a diffuse base) is S for light that takes that lobe, and D
//! for all other light. Photons that meet it are stored for the other lobes, those of point and parallel lights for all
//! lobes, and bounce off by any lobe.

mod direct;
mod medium;
mod shading;
mod straight;
mod vertex;
mod walk;

use crate::cpu::beam::estimate::{CameraSegment, CameraSegments, Turn, Way};
use crate::cpu::photon_map::{SurfacePhoton, SurfacePhotonMap};
use crate::math::{Ray, Rgb, Vec3};
use crate::plan::RenderPlan;
use crate::plan::aov::{Part, Recorder};
use crate::plan::estimators::Estimators;
use crate::plan::weights::Weights;
use crate::roulette;
use crate::sampler::{Sampler, VERTEX};
use crate::warp::power_heuristic;
use crate::world::Scene;
use crate::world::bsdf::{BsdfFlags, BsdfSample, Material, TransportMode};
use crate::world::geometry::SurfaceHit;
use crate::world::light::LightHit;
use crate::world::mask::{Start, VisibilityMask};
use crate::world::medium::{Flight, Medium, MediumId};
use crate::world::spectrum::{Wave, WaveNumber, WaveSet};
use crate::world::texture::graph::Viewer;
use direct::Seen;
use vertex::{OneLobe, Vertex};
use walk::{Drawn, Walk, Wanted};

/// What a pass's camera paths read.
pub struct CameraTracer<'a, V> {
    /// The scene.
    pub scene: &'a Scene,
    /// The plan.
    pub plan: &'a RenderPlan,
    /// The pass's surface photons, if the plan has any.
    pub photons: Option<&'a SurfacePhotonMap>,
    /// What the pass's MIS weights depend on.
    pub weights: Weights,
    /// The pass's wavelengths, if some surface disperses light.
    pub waves: Option<WaveSet>,
    /// What rays see.
    pub mask: V,
}

/// Share of a pixel's light below which a branch no longer splits, but goes one way by chance.
const MIN_SHARE: f32 = 1e-3;
/// Share from which on branches always look for everything. Looking more often costs more than the noise that it
/// removes.
const FULL_SHARE: f32 = 0.3;

/// A camera path on its way, or a branch of one.
#[derive(Clone, Copy)]
struct Path<H> {
    ray: Ray,
    /// What the ray does not see.
    hidden: H,
    /// Throughput from the film.
    beta: Rgb,
    /// Throughput without the compression by refraction, and as if the path were no branch.
    track: Rgb,
    /// The path's wavelength, once it has met a dispersive surface.
    wave: Option<Wave>,
    medium: MediumId,
    way: Way,
    depth: u32,
    /// Whether it has followed a lobe that is not a delta.
    is_blurred: bool,
    /// The probability of all the branches that it took, had they been chosen by chance.
    share: f32,
    /// Factor on all light except what the path meets: one over the probability of looking for it, or zero if it is not
    /// looked for.
    rest: f32,
    /// The followed lobe that the direction was drawn from, if lights were sampled there as well.
    drawn: Option<Lobe>,
}

/// Where a lobe that is not a delta was followed.
#[derive(Clone, Copy)]
struct Lobe {
    point: Vec3,
    density: f32,
    distance: f32,
    object: u32,
}

/// What a pixel's paths draw from, and what they leave besides radiance.
pub struct PathContext<'a> {
    /// Random numbers.
    pub sampler: Sampler,
    /// The pixel, counted within the tile.
    pub pixel: u16,
    /// Segments along which beams are gathered.
    pub segments: &'a mut CameraSegments,
    /// The wavelength of the path that is followed, if it has one. No throughput contains its weight: radiance gets it
    /// when it is found.
    wave: Option<Wave>,
    /// Layers to record into.
    pub record: Recorder<'a>,
    /// Number of rays traced.
    pub rays: u64,
}

impl<'a> PathContext<'a> {
    /// The context of a pixel, counted within the tile.
    pub fn new(sampler: Sampler, pixel: u16, segments: &'a mut CameraSegments, record: Recorder<'a>) -> Self {
        Self {
            sampler,
            pixel,
            segments,
            wave: None,
            record,
            rays: 0,
        }
    }

    /// Go on with light of this wavelength, or of none.
    fn set_wave(&mut self, wave: Option<Wave>) {
        self.wave = wave;
        self.record.set_tint(self.tint());
    }

    /// Weight of the light that is found now.
    #[inline]
    fn tint(&self) -> Rgb {
        self.wave.map_or(Rgb::ONE, |wave| wave.weight)
    }
}

/// Branches of a camera path that are yet to be followed.
struct Branches<H> {
    waiting: Vec<Path<H>>,
    splits: u32,
}

impl<V: VisibilityMask> CameraTracer<'_, V> {
    /// Follow a camera path from a ray. Pushes its segments in scattering media, and returns everything else that
    /// arrives along it: radiance at the film.
    pub fn trace(&self, ray: Ray, context: &mut PathContext<'_>) -> Rgb {
        let mut branches = Branches {
            waiting: Vec::new(),
            splits: 0,
        };
        let mut path = Path {
            ray,
            hidden: self.mask.from(Start::Camera),
            beta: Rgb::ONE,
            track: Rgb::ONE,
            wave: None,
            medium: self.scene.medium_of_camera(ray.origin),
            way: Way::default(),
            depth: 0,
            is_blurred: false,
            share: 1.0,
            rest: 1.0,
            drawn: None,
        };
        let mut radiance = Rgb::ZERO;
        loop {
            let mut found = Rgb::ZERO;
            self.follow(path, &mut branches, context, &mut found);
            radiance += found;
            match branches.waiting.pop() {
                Some(next) => path = next,
                None => return radiance,
            }
        }
    }

    fn estimators(&self) -> &Estimators {
        &self.plan.estimators
    }

    /// Weight of the light that a path of a wavelength finds.
    pub fn tint_of(&self, wave: Option<WaveNumber>) -> Rgb {
        match (wave, &self.waves) {
            (Some(wave), Some(waves)) => waves.factor(wave, None),
            _ => Rgb::ONE,
        }
    }

    /// A wavelength for a path that has none yet, where it meets a dispersive surface.
    #[inline]
    fn wave_at(&self, material: &Material, context: &mut PathContext<'_>) -> Option<Wave> {
        let waves = self.waves.as_ref()?;
        (context.wave.is_none() && material.has(BsdfFlags::DISPERSES)).then(|| waves.choose(context.sampler.next_1d()))
    }

    /// Follow one branch to its end, and add the light that it finds.
    fn follow(
        &self,
        mut path: Path<V::Hidden>,
        branches: &mut Branches<V::Hidden>,
        context: &mut PathContext<'_>,
        radiance: &mut Rgb,
    ) {
        let scene = self.scene;
        context.set_wave(path.wave);
        // Distance since the path last turned.
        let mut straight = 0.0;
        loop {
            context.rays += 1;
            context.sampler.align(VERTEX);
            let hit = scene.first_hit(&path.ray, |object| self.mask.hides(path.hidden, object));
            if let Some(id) = path.medium {
                let length = hit.as_ref().map_or(f32::INFINITY, |h| h.t);
                if !scene.emitting(path.medium).is_empty() {
                    self.add_emitted_within(&path, id, length, radiance, context);
                }
                *radiance += context.tint() * self.cross_medium(&mut path, id, length, context);
            }
            if let (Some(drawn), Some(hit)) = (&mut path.drawn, &hit) {
                drawn.distance += hit.t;
            }
            straight += hit.as_ref().map_or(0.0, |hit| hit.t);
            self.add_met_light(&path, (hit.as_ref(), straight), radiance, context);
            let Some(mut hit) = hit else {
                context.record.meets_nothing(path.beta);
                return;
            };
            if let Way::Straight(_) = path.way {
                hit.at.place.viewer = Viewer::Camera;
            }
            let Some(material) = scene.material(&hit).met(&hit.at, || context.sampler.next_1d()) else {
                path.medium = scene.medium_beyond(&hit, path.ray.dir, path.medium);
                path.ray = hit.spawn_ray(path.ray.dir);
                path.way = path.way.then(Turn::Passed);
                continue;
            };
            straight = 0.0;
            // A lobe for which lights were sampled sees the lights beyond it before roulette may end the path: at a
            // dark surface roulette mostly does, and half of the surface's light is there.
            if path.drawn.is_some() && !path.survives(roulette::FACTOR * path.track.max_element(), &mut context.sampler)
            {
                return;
            }
            if let Some(wave) = self.wave_at(material, context) {
                path.wave = Some(wave);
                context.set_wave(path.wave);
            }
            let at = scene.interaction(material, &mut hit, path.ray.dir, path.wave);
            let mut vertex = Vertex::new(at, &hit, path.medium);
            context.record.first_surface(hit.object, || {
                let camera = &scene.description().camera;
                (camera.depth(hit.point), hit.ns, vertex.bsdf.albedo())
            });
            let mode = TransportMode::Radiance;
            let sample = if material.is_specular() {
                match vertex.bsdf.branches(vertex.local_wo, mode) {
                    Some(ways) => self.split(&mut path, &vertex, ways, branches, &mut context.sampler),
                    None => {
                        let u_lobe = context.sampler.next_1d();
                        let u = context.sampler.next_2d();
                        vertex.bsdf.sample(vertex.local_wo, u_lobe, u, mode)
                    }
                }
            } else if !material.has(BsdfFlags::THIN) && vertex.bsdf.delta_probability(vertex.local_wo) > 0.0 {
                self.delta_or_rest(&mut path, &mut vertex, radiance, context)
            } else {
                let lobe = match material.follows(&vertex.bsdf) {
                    true => OneLobe::followed(context.sampler.next_1d()),
                    false => vertex.one_lobe(context.sampler.next_1d()),
                };
                path.beta *= lobe.weight;
                path.track *= lobe.weight;
                let beta = path.beta * path.rest;
                if !lobe.is_followed {
                    if beta != Rgb::ZERO {
                        *radiance += context.tint() * self.scattered(&vertex, beta, context);
                    }
                    return;
                }
                vertex.is_followed = true;
                if beta != Rgb::ZERO {
                    let lights = self.light_choice(&vertex, Seen::First);
                    *radiance += context.tint() * self.lit_directly(&vertex, &lights, 1.0, beta, context);
                    if self.estimators().unmet_caustics && !material.has(BsdfFlags::THIN) {
                        let counts = |_: &SurfacePhoton, _: Vec3| 1.0;
                        *radiance += context.tint() * self.photon_radiance(&vertex, counts, beta, context);
                    }
                }
                let u = context.sampler.next_2d();
                let sample = vertex.bsdf.sample(vertex.local_wo, lobe.u, u, mode);
                sample.filter(|s| s.wi.z * hit.ng.dot(vertex.frame.to_world(s.wi)) > 0.0)
            };
            let Some(sample) = sample else {
                return;
            };
            if !path.turn(&vertex, &sample, scene, self.mask, &mut context.sampler) {
                return;
            }
        }
    }

    /// Light that the path meets: of the environment if it meets no surface, or of the surface.
    fn add_met_light(
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
    fn add_emitted_within(
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

    /// At a surface with a delta lobe and others, chance decides whether the path goes on along the delta lobe, or
    /// whether only the other lobes count. Either way the delta lobe's sample is returned, for the light that it meets.
    fn delta_or_rest(
        &self,
        path: &mut Path<V::Hidden>,
        vertex: &mut Vertex<'_>,
        radiance: &mut Rgb,
        context: &mut PathContext<'_>,
    ) -> Option<BsdfSample> {
        let p = vertex.bsdf.delta_probability(vertex.local_wo);
        let along = context.sampler.next_1d() < p;
        let u = context.sampler.next_2d();
        let mut delta = vertex.bsdf.sample(vertex.local_wo, 0.0, u, TransportMode::Radiance);
        if let Some(delta) = &mut delta {
            delta.weight *= p;
        }
        let rest = path.rest;
        path.rest = if along { rest / p } else { 0.0 };
        if !along {
            vertex.bsdf = vertex.bsdf.without_delta();
            let beta = path.beta * (rest / (1.0 - p));
            if beta != Rgb::ZERO {
                *radiance += context.tint() * self.scattered(vertex, beta, context);
            }
        }
        path.share *= p;
        path.track /= p;
        delta
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

    /// Takes the path through a medium, up to `length`: leaves a segment for beams, adds what is scattered there, and
    /// attenuates the path.
    fn cross_medium(&self, path: &mut Path<V::Hidden>, id: u16, length: f32, context: &mut PathContext<'_>) -> Rgb {
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

    /// Go both of two ways: the likelier one is returned, and the other waits. If the less likely way is not
    /// worthwhile, choose one of them by chance.
    fn split(
        &self,
        path: &mut Path<V::Hidden>,
        vertex: &Vertex,
        ways: [BsdfSample; 2],
        branches: &mut Branches<V::Hidden>,
        sampler: &mut Sampler,
    ) -> Option<BsdfSample> {
        let [mut strong, mut weak] = ways;
        if weak.pdf > strong.pdf {
            (strong, weak) = (weak, strong);
        }
        if path.share * weak.pdf < MIN_SHARE || branches.splits == self.plan.splits {
            let is_weak = weak.pdf > 0.0 && sampler.next_1d() < weak.pdf;
            return Some(if is_weak { weak } else { strong });
        }
        branches.splits += 1;
        let mut other = *path;
        for (path, way) in [(&mut other, &mut weak), (path, &mut strong)] {
            path.share *= way.pdf;
            path.track /= way.pdf;
            way.weight *= way.pdf;
            // Look for the rest with a probability in proportion to the branch's share, weighted by the inverse.
            let (had, has) = (1.0 / path.rest, (path.share / FULL_SHARE).min(1.0));
            if path.rest > 0.0 && has < had {
                path.rest = if sampler.next_1d() < has / had { 1.0 / has } else { 0.0 };
            }
        }
        if other.turn(vertex, &weak, self.scene, self.mask, sampler) {
            branches.waiting.push(other);
        }
        Some(strong)
    }
}

impl<H> Path<H> {
    /// Russian roulette: the path goes on with the probability `q`.
    fn survives(&mut self, q: f32, sampler: &mut Sampler) -> bool {
        let survived = roulette::survives(q, self.depth, sampler);
        if let Some(q) = survived {
            self.beta /= q;
            self.track /= q;
        }
        survived.is_some()
    }

    /// Leave a surface in a sampled direction. Returns false if the path ends.
    fn turn(
        &mut self,
        vertex: &Vertex,
        sample: &BsdfSample,
        scene: &Scene,
        mask: impl VisibilityMask<Hidden = H>,
        sampler: &mut Sampler,
    ) -> bool {
        let hit: &SurfaceHit = vertex.hit;
        let wi = vertex.frame.to_world(sample.wi).normalize();
        if vertex.bump_shadowing.is_some() && sample.wi.z * hit.ng.dot(wi) <= 0.0 {
            return false;
        }
        if sample.transmitted {
            self.medium = scene.medium_beyond(hit, wi, self.medium);
        }
        self.beta *= vertex.weight(sample);
        self.track *= sample.weight;
        if sample.transmitted {
            // The compression of radiance by refraction comes and goes along the path.
            let eta = vertex
                .material
                .eta_of_crossing(hit.ng.dot(self.ray.dir) > 0.0, self.wave);
            self.track /= eta * eta;
        }
        self.depth += 1;
        self.is_blurred |= !sample.delta;
        if sample.delta {
            let q = match self.is_blurred {
                true => roulette::FACTOR * self.track.max_element(),
                // A sharp path has no noise but that of roulette, which comes late and depends on the reflectance
                // alone.
                false if self.depth > roulette::DEPTH_OF_DELTAS => sample.weight.max_element(),
                false => 1.0,
            };
            if !self.survives(q, sampler) {
                return false;
            }
        }
        self.drawn = (!sample.delta).then_some(Lobe {
            point: hit.point,
            density: sample.pdf,
            distance: 0.0,
            object: hit.object,
        });
        self.ray = hit.spawn_ray(wi);
        self.hidden = mask.from(match sample.transmitted {
            true => Start::Refracted(hit.object),
            false => Start::Reflected(hit.object),
        });
        self.way = self.way.then(match sample.transmitted {
            true => Turn::Refracted,
            false => Turn::Reflected,
        });
        self.beta.max_element() > 0.0
    }
}
