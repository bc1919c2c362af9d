//! Traces paths: what they meet, where they scatter, and the lights sampled there.

use super::path::{DrawnAt, Path};
use super::vertex::{Vertex, VertexRules};
use crate::math::{Ray, Rgb, Vec3};
use crate::plan::aov::{Part, Recorder};
use crate::sampler::{Sampler, VERTEX};
use crate::warp::power_heuristic;
use crate::world::bsdf::{Bsdf, BsdfFlags, Material, TransportMode};
use crate::world::geometry::SurfaceHit;
use crate::world::light::{LightChoice, LightHit, LightSelector, LocalChoice};
use crate::world::medium::{Flight, MediumId};
use crate::world::phase::Phase;
use crate::world::rules::{HiddenSet, ObjectSets, Rules};
use crate::world::spectrum::Wave;
use crate::world::texture::graph::Viewer;
use crate::world::{Scene, SurfaceInteraction};

pub(super) struct PathTracer<'a> {
    pub(super) scene: &'a Scene,
    pub(super) selector: &'a LightSelector,
    pub(super) max_depth: u32,
}

impl PathTracer<'_> {
    fn rules(&self) -> Option<&Rules> {
        self.scene.description().rules.as_ref()
    }

    fn hides(&self, hidden: HiddenSet, object: u32) -> bool {
        self.rules().is_some_and(|rules| rules.hides(hidden, object))
    }

    /// Whether a glossy ray that does not see these objects does not show a light.
    fn is_unlit(&self, hidden: HiddenSet, light: usize) -> bool {
        let object = self.scene.lights()[light].kind.object();
        object.is_some_and(|object| self.hides(hidden, object)) || self.hides_light(hidden, light)
    }

    fn links_shadows(&self, light: usize) -> bool {
        self.rules().is_some_and(|rules| rules.links_shadows(light))
    }

    fn hides_light(&self, hidden: HiddenSet, light: usize) -> bool {
        self.rules().is_some_and(|rules| rules.hides_light(hidden, light))
    }

    pub(super) fn radiance(&self, ray: Ray, record: Recorder, sampler: &mut Sampler) -> Rgb {
        let scene = self.scene;
        let mut path = Path {
            medium: scene.medium_of_camera(ray.origin),
            ray,
            hidden: self.rules().map_or(HiddenSet::default(), |rules| rules.camera),
            is_seen: true,
            part: Part::Direct,
            beta: Rgb::ONE,
            wave: None,
            compression: 1.0,
            depth: 0,
            drawn_at: None,
            radiance: Rgb::ZERO,
            record,
        };
        // Distance since the path last turned.
        let mut straight = 0.0;
        while path.beta.max_element() > 0.0 {
            sampler.align(VERTEX);
            let hit = scene.first_hit(&path.ray, |object| self.hides(path.hidden, object));
            let length = hit.as_ref().map_or(f32::INFINITY, |h| h.t);
            if let Some(id) = path.medium {
                let medium = &scene.media()[id as usize];
                self.add_emitted_within(&mut path, id, length, sampler);
                match medium.sample_way(&path.ray, length, path.beta, sampler) {
                    Flight::Passed { weight } => path.beta *= weight,
                    Flight::Scattered { distance, weight } => {
                        path.beta *= weight;
                        if !self.scatter_in_medium(&mut path, distance, medium.phase(), sampler) {
                            break;
                        }
                        straight = 0.0;
                        continue;
                    }
                }
            }
            let Some(mut hit) = hit else {
                self.add_environment(&mut path);
                break;
            };
            straight += hit.t;
            self.add_emitted(&mut path, &hit, straight, sampler);
            if path.depth == 0 {
                hit.at.place.viewer = Viewer::Camera;
            }
            let Some(material) = scene.material(&hit).met(&hit.at, || sampler.next_1d()) else {
                path.medium = scene.medium_beyond(&hit, path.ray.dir, path.medium);
                path.ray = hit.spawn_ray(path.ray.dir);
                if let Some(vertex) = &mut path.drawn_at {
                    vertex.distance += hit.t;
                }
                continue;
            };
            straight = 0.0;
            if !self.scatter_at_surface(&mut path, material, &mut hit, sampler) {
                break;
            }
        }
        path.radiance
    }

    /// Environment light for a path that leaves the scene.
    fn add_environment(&self, path: &mut Path) {
        for &light in &self.scene.environments {
            if self.hides_light(path.hidden, light) {
                continue;
            }
            let radiance = self.scene.environment(light, path.ray.dir);
            let weight = self.balance(path, light, None);
            path.add(light, path.beta * radiance * weight);
        }
    }

    /// What a medium emits into the path within `length`, sampled at one point of the part of the ray inside the
    /// light's ball.
    fn add_emitted_within(&self, path: &mut Path, id: u16, length: f32, sampler: &mut Sampler) {
        let medium = &self.scene.media()[usize::from(id)];
        for &light in self.scene.emitting(Some(id)) {
            let light = light as usize;
            let Some(volume) = self.scene.volume_light(light) else {
                continue;
            };
            let is_sampled = path.drawn_at.as_ref().is_some_and(|vertex| {
                vertex.is_ruled || vertex.is_seen && self.links_shadows(light) || self.hides_light(vertex.unlit, light)
            });
            if is_sampled || self.hides_light(path.hidden, light) {
                continue;
            }
            let (center, radius) = volume.ball();
            let offset = center - path.ray.origin;
            let middle = offset.dot(path.ray.dir);
            let half = (radius * radius - (offset - path.ray.dir * middle).length_squared())
                .max(0.0)
                .sqrt();
            let (start, end) = ((middle - half).max(0.0), (middle + half).min(length));
            if end > start {
                let t = start + (end - start) * sampler.next_1d();
                let emitted = volume.emission().at(path.ray.at(t)) * medium.transmittance(&path.ray, t, sampler);
                path.add(light, path.beta * emitted * (end - start));
            }
        }
    }

    /// Light of a surface that the path has met, after going straight for a distance.
    fn add_emitted(&self, path: &mut Path, hit: &SurfaceHit, straight: f32, sampler: &mut Sampler) {
        let Some(light) = self.scene.objects()[hit.object as usize].light else {
            return;
        };
        let emitted = self.scene.emitted(hit, path.ray.dir, straight);
        if emitted == Rgb::ZERO {
            return;
        }
        let hides = |object| self.hides(path.hidden, object);
        let emitted = emitted
            * self
                .scene
                .within_lamp(hit, (path.ray.dir, straight), path.medium, hides, sampler);
        let at = LightHit {
            normal: hit.ng,
            primitive: hit.primitive,
            distance: path.drawn_at.as_ref().map_or(0.0, |v| v.distance) + hit.t,
        };
        let weight = self.balance(path, light as usize, Some(at));
        path.add(light as usize, path.beta * emitted * weight);
    }

    /// Weight of light met by chance, against sampling it at the vertex where the direction was drawn.
    fn balance(&self, path: &Path, light: usize, hit: Option<LightHit>) -> f32 {
        let Some(vertex) = &path.drawn_at else {
            return 1.0;
        };
        if vertex.is_ruled || vertex.is_seen && self.links_shadows(light) || self.hides_light(vertex.unlit, light) {
            return 0.0;
        }
        let scene = self.scene;
        let objects = scene.objects();
        let pdf = scene.lights()[light].pdf_direct(objects, vertex.point, path.ray.dir, hit);
        let samples = self.lights_at(vertex.point, vertex.facing).samples_of(light);
        power_heuristic(vertex.pdf, pdf * samples)
    }

    /// `facing`: the normal of a surface that is lit from this side only.
    fn lights_at(&self, point: Vec3, facing: Option<Vec3>) -> LocalChoice<'_> {
        self.scene.light_sources.choice_at(point, facing, self.selector)
    }

    /// Scatter in a medium. Returns false if the path ends here.
    fn scatter_in_medium(&self, path: &mut Path, distance: f32, phase: Phase, sampler: &mut Sampler) -> bool {
        if path.depth >= self.max_depth || path.beta.max_element() <= 0.0 {
            return false;
        }
        let (point, dir) = (path.ray.at(distance), path.ray.dir);
        let vertex = Vertex::Medium { point, dir, phase };
        let nothing = HiddenSet::default();
        path.part = match path.is_seen {
            true => Part::Volume,
            false => path.part.further(),
        };
        self.add_direct(path, &vertex, None, sampler);
        (path.hidden, path.is_seen) = (nothing, false);
        let dir = phase.sample(dir, sampler.next_2d());
        path.drawn_at = Some(DrawnAt {
            is_ruled: false,
            unlit: nothing,
            is_seen: false,
            point,
            pdf: phase.eval_directions(path.ray.dir, dir),
            distance: 0.0,
            facing: None,
        });
        path.ray = Ray { origin: point, dir };
        path.survives(sampler)
    }

    /// Scatter at a surface. Returns false if the path ends here.
    fn scatter_at_surface(
        &self,
        path: &mut Path,
        material: &Material,
        hit: &mut SurfaceHit,
        sampler: &mut Sampler,
    ) -> bool {
        let scene = self.scene;
        if path.depth >= self.max_depth {
            return false;
        }
        let wo = -path.ray.dir;
        if path.wave.is_none() && material.has(BsdfFlags::DISPERSES) {
            path.wave = Some(Wave::at(sampler.next_1d()));
        }
        let SurfaceInteraction {
            mut bsdf,
            bump_shadowing,
            frame,
            local_wo,
            ..
        } = scene.interaction(material, hit, path.ray.dir, path.wave);
        let hit = &*hit;
        if bsdf.is_black() {
            return false;
        }
        let rules = self.rules().filter(|_| path.is_seen);
        let mut sets = rules.map(|rules| rules.of_object[hit.object as usize]);
        if let Some(sets) = &mut sets
            && bsdf.is_matt()
        {
            sets.is_glossy = false;
        }
        if let Some(sets) = &mut sets
            && sets.is_glossy
            && let Some(lobes) = bsdf.gloss_and_base()
        {
            // The two lobes obey different rules: choose one at random.
            sets.is_glossy = sampler.next_1d() < 0.5;
            bsdf = lobes[usize::from(!sets.is_glossy)];
            path.beta *= 2.0;
        }
        // What is seen by a narrow lobe is kept apart from what is seen by a wide one.
        let mut is_followed = material.follows(&bsdf);
        if path.is_seen
            && !is_followed
            && let Some((p, [narrow, wide])) = bsdf.narrow_and_wide(local_wo)
        {
            is_followed = sampler.next_1d() < p;
            (bsdf, path.beta) = match is_followed {
                true => (narrow, path.beta / p),
                false => (wide, path.beta / (1.0 - p)),
            };
        }
        if !path.is_seen {
            path.part = path.part.further();
        }
        let rules = sets.map(|sets| VertexRules { sets, is_followed });
        let side = hit.ng.dot(wo).signum();
        let facing = matches!(bsdf, Bsdf::Diffuse { .. }).then_some(hit.ng * side);
        if !material.is_specular() {
            let vertex = Vertex::Surface {
                hit,
                facing,
                bsdf: &bsdf,
                bump_shadowing,
                frame,
                local_wo,
            };
            self.add_direct(path, &vertex, rules.as_ref(), sampler);
        }
        let [draws_lobe, draws_direction] = bsdf.draws();
        let (u_lobe, u) = (sampler.next_1d_if(draws_lobe), sampler.next_2d_if(draws_direction));
        let Some(sample) = bsdf.sample(local_wo, u_lobe, u, TransportMode::Radiance) else {
            return false;
        };
        let wi = frame.to_world(sample.wi).normalize();
        // Interpolated and bumped normals must let no light through closed surfaces. Smooth surfaces that are only
        // interpolated keep what they send to the other side, as they do for photons.
        if (!sample.delta || bump_shadowing.is_some()) && sample.wi.z * hit.ng.dot(wi) <= 0.0 {
            return false;
        }
        path.beta *= bsdf.weight_bumped(bump_shadowing.as_ref(), local_wo, &sample, TransportMode::Radiance);
        if sample.transmitted {
            path.medium = scene.medium_beyond(hit, wi, path.medium);
            let eta = material.eta_of_crossing(hit.ng.dot(path.ray.dir) > 0.0, path.wave);
            path.compression *= eta * eta;
        }
        let follows = |sets: &ObjectSets| sample.delta || is_followed || sets.is_glossy;
        path.hidden = match sets.filter(follows) {
            Some(sets) => sets.seen(sample.transmitted),
            None => HiddenSet::default(),
        };
        path.is_seen &= sample.delta || is_followed;
        path.drawn_at = (!sample.delta).then_some(DrawnAt {
            is_ruled: rules.is_some_and(|rules| rules.decides_direct_light()),
            unlit: rules.map_or(HiddenSet::default(), |rules| rules.sets.shadow),
            is_seen: sets.is_some(),
            point: hit.point,
            pdf: sample.pdf,
            distance: 0.0,
            facing,
        });
        path.ray = hit.spawn_ray(wi);
        path.survives(sampler)
    }

    /// Light that a vertex gets straight from lights and scatters into the path, balanced against drawing its
    /// direction. `rules`: the vertex's rules, if it has any.
    fn add_direct(&self, path: &mut Path, vertex: &Vertex, rules: Option<&VertexRules>, sampler: &mut Sampler) {
        let lights = self.lights_at(vertex.point(), vertex.facing());
        lights.each(sampler, |choice, sampler| {
            if let Some(radiance) = self.direct(vertex, path.medium, choice, rules, sampler) {
                path.add(choice.light, path.beta * radiance);
            }
        });
    }

    /// Light from a chosen light. `medium`: the one that the path came to the vertex through.
    fn direct(
        &self,
        vertex: &Vertex,
        medium: MediumId,
        choice: LightChoice,
        rules: Option<&VertexRules>,
        sampler: &mut Sampler,
    ) -> Option<Rgb> {
        let scene = self.scene;
        let light = &scene.lights()[choice.light];
        let (u, u_primitive) = light.draw_direct(scene.objects(), sampler);
        let hidden = rules.map_or(HiddenSet::default(), |rules| rules.sets.shadow);
        if self.hides_light(hidden, choice.light) {
            return None;
        }
        let direct = light.sample_direct(scene.objects(), vertex.point(), u, u_primitive)?;
        let scattering = vertex.towards(direct.wi);
        let radiance = scattering.value * direct.weight;
        if radiance == Rgb::ZERO {
            return None;
        }
        let own = self.rules().filter(|_| rules.is_some());
        let own = own.map_or(HiddenSet::default(), |r| r.shadow_of_light[choice.light]);
        let is_ruled = own != HiddenSet::default() || rules.is_some_and(VertexRules::decides_direct_light);
        let is_volume = scene.volume_light(choice.light).is_some();
        if is_volume && !is_ruled {
            // Left to the volumes that paths go through.
            return None;
        }
        let weight = if direct.unmet || is_ruled {
            1.0
        } else {
            power_heuristic(direct.pdf * choice.pmf, scattering.pdf)
        };
        let mut hidden = hidden;
        let ((ray, distance), medium) = match vertex {
            Vertex::Surface {
                hit, frame, local_wo, ..
            } => {
                let crosses = hit.ng.dot(direct.wi) * hit.ng.dot(frame.to_world(*local_wo)) < 0.0;
                if let Some(rules) = rules {
                    let seen = rules.sets.seen(crosses);
                    if rules.is_gloss() && self.is_unlit(seen, choice.light) {
                        return None;
                    }
                    if rules.is_followed {
                        hidden = seen;
                    }
                }
                let beyond = || scene.medium_beyond(hit, direct.wi, medium);
                let medium = if crosses { beyond() } else { medium };
                (hit.ray_to(direct.wi, direct.distance), medium)
            }
            Vertex::Medium { point, .. } => {
                let ray = Ray {
                    origin: *point,
                    dir: direct.wi,
                };
                ((ray, direct.distance), medium)
            }
        };
        let reaching = scene.reaching(
            choice.light,
            (ray, distance),
            medium,
            |object| self.hides(hidden, object) || self.hides(own, object),
            sampler,
        )?;
        Some(radiance * reaching * (weight / choice.pmf))
    }
}
