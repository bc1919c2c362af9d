//! Camera paths, and which estimator counts which light path.
//!
//! A camera path goes straight through boundaries of media (and, as all rays do, by chance through surfaces that are not
//! opaque; shadow rays through all of them, weakened) and follows specular surfaces; it ends at the first surface x
//! that is not specular, at a light, or outside. With L a light, S specular, D a surface that is not specular, M a
//! scattering in a medium, E the camera, and boundaries of media left out:
//!
//! | light path                    | counted by                                                                 |
//! | ----------------------------- | -------------------------------------------------------------------------- |
//! | L S* E                        | the camera path meets the light                                            |
//! | L M S* E, homogeneous medium  | a point sampled on each of the camera path's segments (`medium`)           |
//! | other … M S* E                | photon beams along the camera path's segments (`beam::estimate`)           |
//! | L x S* E                      | direct light at x: light sampling and BSDF sampling, balanced              |
//! | … S x S* E, … M x S* E        | surface photons at x that arrived from S or M                              |
//! | L D x S* E                    | gather ray from x: direct light at D; and surface photons at x, balanced   |
//! | … (S, M or D) D x S* E        | gather ray from x: surface photons at D; and those at x, balanced          |
//!
//! The last vertex before x decides, so every path is counted once, or twice with weights that sum to one: those of
//! `surface::gather_share`. Gloss sends several gather rays where its light matters. Without S or M in the scene, photons are looked up at x only where it is gloss, and elsewhere gather
//! rays count all. So they do where D has a relief. The BSDF sample of the direct light and the gather ray are one ray.
//!
//! At a smooth dielectric the path goes both ways, as far as they matter. Light that a branch meets always counts; the rest
//! (everything but `L S* E`) costs more, and is looked for along weak branches with a probability only.
//!
//! A surface with a delta lobe beside others (a smooth coat over a diffuse base) is S for light that takes the delta lobe and
//! D for all other light. Where a camera path meets one, the delta lobe is followed to lights it may meet; the rest is found
//! by chance along it or by the other lobes alone. Photons that meet it are stored for the other lobes and bounce off by any; a gather ray's D has its other
//! lobes alone, as what its delta lobe sends to x is in x's photons.

mod direct;
pub mod evaluations;
mod medium;
mod straight;
mod surface;

use crate::beam::estimate::{CameraSegment, CameraSegments, Turn, Way};
use crate::beam::trace::{MAX_SURVIVAL, ROULETTE_DEPTH};
use crate::bsdf::{BsdfSample, TransportMode};
use crate::geometry::SurfaceHit;
use crate::math::{Frame, Ray, Rgb};
use crate::medium::{Medium, MediumId};
use crate::parts::{Part, Recorder};
use crate::plan::{RenderPlan, Scene};
use crate::rules::{Sight, Start};
use crate::sampler::Sampler;
use crate::surface::SurfacePhotonMap;
use surface::Vertex;
pub(crate) use surface::{DEEPER_ODDS, UNSEEN, power_heuristic};

/// What camera paths of a pass read.
pub struct CameraTracer<'a, V> {
    /// The scene.
    pub scene: &'a Scene,
    /// The plan.
    pub plan: &'a RenderPlan,
    /// The pass's surface photons, when the plan has any.
    pub photons: Option<&'a SurfacePhotonMap>,
    /// Expected photons in a kernel, see `first_odds` in `beam::trace`.
    pub first_odds: f32,
    /// Factor on the odds of photons on gloss against gather rays: see `gloss_odds` in `beam::trace`.
    pub gloss_odds: f32,
    /// What rays see.
    pub sight: V,
}

/// Share of a pixel's light below which a branch does not split any more, but goes one way by chance.
const MIN_SHARE: f32 = 1e-3;
/// Splits of a camera path, all its branches together.
const MAX_SPLITS: u32 = 8;
/// Share from which on branches surely look for everything. Looking more often costs more than the noise that it takes away.
const FULL_SHARE: f32 = 0.3;

/// A camera path on its way, or a branch of one.
#[derive(Clone, Copy)]
struct Path<H> {
    ray: Ray,
    /// What the ray does not see.
    hidden: H,
    /// Throughput from the film.
    beta: Rgb,
    medium: MediumId,
    way: Way,
    depth: u32,
    /// How likely chance would have led the path through all the branches that it took.
    share: f32,
    /// Factor on all but the light that the path meets: one over the probability that it is looked for; zero when it is
    /// not.
    rest: f32,
}

/// Branches of a camera path that have yet to be followed.
struct Branches<H> {
    waiting: Vec<Path<H>>,
    splits: u32,
}

impl<V: Sight> CameraTracer<'_, V> {
    /// Follow a camera path from a ray. Pushes its segments in scattering media and returns everything else that
    /// arrives along it: radiance at the film.
    pub fn trace(
        &self,
        ray: Ray,
        pixel: u16,
        sampler: &mut Sampler,
        out: &mut CameraSegments,
        record: &mut Recorder<'_>,
    ) -> Rgb {
        let mut branches = Branches {
            waiting: Vec::new(),
            splits: 0,
        };
        let mut path = Path {
            ray,
            hidden: self.sight.from(Start::Camera),
            beta: Rgb::ONE,
            medium: self.scene.camera_medium,
            way: Way::default(),
            depth: 0,
            share: 1.0,
            rest: 1.0,
        };
        let mut radiance = Rgb::ZERO;
        loop {
            radiance += self.follow(path, &mut branches, pixel, sampler, out, record);
            match branches.waiting.pop() {
                Some(next) => path = next,
                None => return radiance,
            }
        }
    }

    /// Follow one branch to its end.
    fn follow(
        &self,
        mut path: Path<V::Hidden>,
        branches: &mut Branches<V::Hidden>,
        pixel: u16,
        sampler: &mut Sampler,
        out: &mut CameraSegments,
        record: &mut Recorder<'_>,
    ) -> Rgb {
        let scene = self.scene;
        let mut radiance = Rgb::ZERO;
        loop {
            let hit =
                scene
                    .geometry
                    .intersect(scene.objects(), &path.ray, f32::INFINITY, |object| {
                        self.sight.hides(path.hidden, object)
                    });
            if let Some(id) = path.medium {
                let length = hit.as_ref().map_or(f32::INFINITY, |h| h.t);
                radiance += self.cross_medium(&mut path, id, length, pixel, sampler, out, record);
            }
            let Some(mut hit) = hit else {
                let sees = |light: usize| !self.sight.hides_light(path.hidden, light);
                if record.is_on() {
                    for &light in scene.environments.iter().filter(|&&light| sees(light)) {
                        let environment = scene.environment(light, path.ray.dir);
                        record.add(Part::Direct, light, path.beta * environment);
                    }
                }
                return radiance + path.beta * scene.environment_radiance(path.ray.dir, sees);
            };
            let emitted = path.beta * scene.emitted(&hit, path.ray.dir);
            radiance += emitted;
            if let Some(light) = scene.objects()[hit.object as usize].light {
                record.add(Part::Direct, light as usize, emitted);
            }
            let material = scene.material(&hit);
            if material.is_passed(hit.uv, || sampler.next_1d()) {
                path.medium = scene.medium_beyond(&hit, path.ray.dir, path.medium);
                path.ray = hit.spawn_ray(path.ray.dir);
                path.way = path.way.then(Turn::Passed);
                continue;
            }
            let wo = -path.ray.dir;
            let tilt = scene.tilt(&mut hit, wo);
            let frame = Frame::from_normal(hit.ns);
            let mut vertex = Vertex {
                bsdf: material.bsdf(hit.uv),
                tilt,
                frame,
                wo,
                local_wo: frame.to_local(wo),
                hit: &hit,
                medium: path.medium,
                is_gloss: false,
            };
            record.first_surface(|| {
                let camera = &scene.description().camera;
                let depth = (hit.point - camera.position).dot(camera.frame.n);
                (depth, hit.ns, vertex.bsdf.albedo())
            });
            let mode = TransportMode::Radiance;
            let sample = if material.is_specular() {
                match vertex.bsdf.branches(vertex.local_wo, mode) {
                    Some(ways) => self.split(&mut path, &vertex, ways, branches, sampler),
                    None => {
                        let u_lobe = sampler.next_1d();
                        let u = sampler.next_2d();
                        vertex.bsdf.sample(vertex.local_wo, u_lobe, u, mode)
                    }
                }
            } else {
                // A delta lobe beside others gives way to them by chance, but not where it meets a light.
                let p = vertex.bsdf.delta_probability(vertex.local_wo);
                let mut delta = None;
                if p > 0.0 {
                    let along = sampler.next_1d() < p;
                    let u = sampler.next_2d();
                    delta = vertex.bsdf.sample(vertex.local_wo, 0.0, u, mode);
                    if let Some(delta) = &mut delta {
                        delta.weight *= p;
                    }
                    let rest = path.rest;
                    path.rest = if along { rest / p } else { 0.0 };
                    if !along {
                        vertex.bsdf = vertex.bsdf.without_delta();
                        let beta = path.beta * (rest / (1.0 - p));
                        radiance += beta * self.scattered(&vertex, sampler, beta, record);
                    }
                    path.share *= p;
                } else if path.rest > 0.0 {
                    let beta = path.beta * path.rest;
                    radiance += beta * self.scattered(&vertex, sampler, beta, record);
                }
                delta
            };
            let Some(sample) = sample else {
                return radiance;
            };
            if !path.turn(&vertex, &sample, scene, self.sight, sampler) {
                return radiance;
            }
        }
    }

    /// The part of a path within a medium, up to `length`: leaves a segment for beams, adds what is sampled there, and
    /// attenuates the path.
    #[allow(clippy::too_many_arguments)]
    fn cross_medium(
        &self,
        path: &mut Path<V::Hidden>,
        id: u16,
        length: f32,
        pixel: u16,
        sampler: &mut Sampler,
        out: &mut CameraSegments,
        record: &mut Recorder<'_>,
    ) -> Rgb {
        let properties = &self.scene.media()[id as usize];
        let ray = path.ray;
        if path.rest == 0.0 || !properties.scatters() {
            path.beta *= properties.transmittance(&ray, length, sampler);
            return Rgb::ZERO;
        }
        let (stretch, transmittance) = properties.stretch(&ray, length, sampler, &mut out.steps);
        let beta = path.beta * path.rest;
        path.beta *= transmittance;
        let Some(stretch) = stretch else {
            return Rgb::ZERO;
        };
        out.segments.push(CameraSegment {
            ray,
            length: stretch.range[1],
            beta,
            medium: id,
            pixel,
            way: path.way,
            steps: stretch.steps,
        });
        match properties {
            Medium::Homogeneous(medium) => {
                let range = stretch.range[1];
                self.single_scattering(&ray, range, (id, medium), beta, sampler, record)
            }
            Medium::Heterogeneous(_) => Rgb::ZERO,
        }
    }

    /// Go both of two ways: on along the likelier one, which is returned, while the other waits. Or one of them, by
    /// chance, where the other would not be worth the while.
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
        if path.share * weak.pdf < MIN_SHARE || branches.splits == MAX_SPLITS {
            let is_weak = weak.pdf > 0.0 && sampler.next_1d() < weak.pdf;
            return Some(if is_weak { weak } else { strong });
        }
        branches.splits += 1;
        let mut other = *path;
        for (path, way) in [(&mut other, &mut weak), (path, &mut strong)] {
            path.share *= way.pdf;
            way.weight *= way.pdf;
            // The rest is looked for as often as the branch has a share, with the inverse as its weight.
            let (had, has) = (1.0 / path.rest, (path.share / FULL_SHARE).min(1.0));
            if path.rest > 0.0 && has < had {
                path.rest = if sampler.next_1d() < has / had {
                    1.0 / has
                } else {
                    0.0
                };
            }
        }
        if other.turn(vertex, &weak, self.scene, self.sight, sampler) {
            branches.waiting.push(other);
        }
        Some(strong)
    }
}

impl<H> Path<H> {
    /// Leave a surface in a sampled direction. False: nothing goes on.
    fn turn(
        &mut self,
        vertex: &Vertex,
        sample: &BsdfSample,
        scene: &Scene,
        sight: impl Sight<Hidden = H>,
        sampler: &mut Sampler,
    ) -> bool {
        let hit: &SurfaceHit = vertex.hit;
        let wi = vertex.frame.to_world(sample.wi).normalize();
        if let Some(tilt) = vertex.tilt {
            if sample.wi.z * hit.ng.dot(wi) <= 0.0 {
                return false;
            }
            self.beta *= tilt.shadowing(wi);
        }
        if sample.transmitted {
            self.medium = scene.medium_beyond(hit, wi, self.medium);
        }
        self.beta *= sample.weight;
        self.depth += 1;
        // The compression of radiance by refraction comes and goes along the path, so roulette looks at the
        // reflectance alone, by way of the largest channel, and only late.
        if self.depth > ROULETTE_DEPTH {
            let q = sample.weight.max_element().min(MAX_SURVIVAL);
            if sampler.next_1d() >= q {
                return false;
            }
            self.beta /= q;
        }
        self.ray = hit.spawn_ray(wi);
        self.hidden = sight.from(match sample.transmitted {
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
