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

mod branches;
mod crossing;
mod direct;
mod medium;
mod met;
mod path;
mod shading;
mod straight;
mod vertex;
mod walk;

use crate::cpu::beam::estimate::{CameraSegments, Turn, Way};
use crate::cpu::photon_map::{SurfacePhoton, SurfacePhotonMap};
use crate::math::{Ray, Rgb, Vec3};
use crate::plan::RenderPlan;
use crate::plan::aov::Recorder;
use crate::plan::estimators::Estimators;
use crate::plan::weights::Weights;
use crate::roulette;
use crate::sampler::{Sampler, VERTEX};
use crate::world::Scene;
use crate::world::bsdf::{BsdfFlags, Material, TransportMode};
use crate::world::mask::{Start, VisibilityMask};
use crate::world::spectrum::{Wave, WaveNumber, WaveSet};
use crate::world::texture::graph::Viewer;
use branches::Branches;
use direct::Seen;
use path::Path;
use vertex::{OneLobe, Vertex};

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
}
