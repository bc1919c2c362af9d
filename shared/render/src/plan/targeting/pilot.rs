//! Camera paths that look for places from which they see lights.
//!
//! A place counts where light that photons bring (see `transport`) leaves along the camera path. That is where a medium
//! that beams serve scatters the light, or where it goes on by way of one; and where it meets a specular surface or a
//! followed lobe, with a surface or medium beyond.

use super::{Seen, Viewpoint};
use crate::math::{Frame, Ray, Rgb, Vec2, Vec3, mean};
use crate::parallel;
use crate::plan::estimators::Estimators;
use crate::roulette;
use crate::sampler::{Purpose, Sampler};
use crate::warp::power_heuristic;
use crate::world::bsdf::{Bsdf, BsdfFlags, Material, TransportMode};
use crate::world::geometry::SurfaceHit;
use crate::world::light::{DirectSample, LightHit, LightKind, LightSelector};
use crate::world::mask::{Start, VisibilityMask};
use crate::world::medium::{Flight, Medium, MediumId};
use crate::world::phase::Phase;
use crate::world::{Scene, SurfaceInteraction};

/// Camera paths of one round, most rounds, and the number of places that is enough.
const ROUND: u64 = 4096;
const ROUNDS: u64 = 8;
const ENOUGH: usize = 2 * super::discs::MOST;
/// Paths may end by chance from this many scatterings on, and all end at the second number.
const ROULETTE_DEPTH: u32 = 3;
const MAX_DEPTH: u32 = 32;
const MAX_SURVIVAL: f32 = 0.95;

/// Look for places from which lights are seen.
pub(super) fn trace(
    (scene, estimators, emitters): (&Scene, &Estimators, &LightSelector),
    mask: impl VisibilityMask,
    seed: u64,
) -> Seen {
    let lights = (0..scene.lights().len()).filter(|light| emitters.pmf(*light) > 0.0);
    let pilot = Pilot {
        scene,
        estimators,
        mask,
        lights: lights.collect(),
    };
    let mut by_light = vec![Vec::new(); scene.lights().len()];
    let mut tries = 0;
    for round in 0..ROUNDS {
        let found: Vec<(Found, u32)> = parallel::map(ROUND as usize, |i| {
            let path = round * ROUND + i as u64;
            let mut places = Vec::new();
            if scene.is_interrupted() {
                return (places, 0);
            }
            let mut sampler = Sampler::new(seed, 0, Purpose::Pilot, path);
            let tries = pilot.path(path % 2 == 1, &mut sampler, &mut places);
            (places, tries)
        });
        for (places, tried) in found {
            tries += u64::from(tried);
            for (light, place) in places {
                by_light[light].push(place);
            }
        }
        let most = by_light.iter().map(Vec::len).max().unwrap_or(0);
        let all: usize = by_light.iter().map(Vec::len).sum();
        // After so slow a start, not enough will be found to aim a light's photons, nor to choose lights.
        let of_one = super::MIN_PLACES / 4;
        let of_all = if pilot.lights.len() > 1 {
            super::choice::MIN_PLACES / 4
        } else {
            of_one
        };
        if most >= ENOUGH || most < of_one && all < of_all {
            break;
        }
    }
    (by_light, tries)
}

struct Pilot<'a, V> {
    scene: &'a Scene,
    estimators: &'a Estimators,
    mask: V,
    /// The lights that shine.
    lights: Vec<usize>,
}

/// A camera path on its way.
struct Path<H> {
    ray: Ray,
    hidden: H,
    medium: MediumId,
    beta: Rgb,
    depth: u32,
    /// Scatterings by lobes that paths do not follow.
    scattered: u32,
    /// Lobes that were followed before the first such scattering.
    followed: u32,
    /// Whether a medium that beams serve has scattered it: photons bring all light that comes to it.
    by_beams: bool,
    /// Whether the last scattering was on a surface.
    was_surface: bool,
    /// Where it was last scattered, if light from there counts, and the density of its direction; `None` for the only
    /// possible direction.
    from: Option<(Vec3, Option<f32>)>,
    /// Length of its way from there.
    distance: f32,
    odd: bool,
    /// How many times lights were looked for.
    tries: u32,
}

/// A point that may scatter light into a path.
enum Vertex<'a> {
    Surface {
        hit: &'a SurfaceHit,
        bsdf: &'a Bsdf<'a>,
        frame: Frame,
        wo: Vec3,
        local_wo: Vec3,
        is_specular: bool,
    },
    Medium {
        point: Vec3,
        dir: Vec3,
        phase: Phase,
    },
}

type Found = Vec<(usize, Viewpoint)>;

impl<V: VisibilityMask> Pilot<'_, V> {
    /// Traces a path. Returns how many times lights were looked for.
    fn path(&self, odd: bool, sampler: &mut Sampler, out: &mut Found) -> u32 {
        let scene = self.scene;
        let camera = &scene.description().camera;
        let image = sampler.next_2d() * Vec2::new(camera.width as f32, camera.height as f32);
        if !camera.sees(image) {
            return 0;
        }
        let ray = camera.ray(image, sampler.next_2d());
        let mut path = Path {
            ray,
            hidden: self.mask.from(Start::Camera),
            medium: scene.medium_of_camera(ray.origin),
            beta: Rgb::ONE,
            depth: 0,
            scattered: 0,
            followed: 0,
            by_beams: false,
            was_surface: false,
            from: None,
            distance: 0.0,
            odd,
            tries: 0,
        };
        while path.depth < MAX_DEPTH && path.beta.max_element() > 0.0 {
            let hit = scene.first_hit(&path.ray, |object| self.mask.hides(path.hidden, object));
            let length = hit.as_ref().map_or(f32::INFINITY, |h| h.t);
            if let Some(id) = path.medium {
                let medium = &scene.media()[usize::from(id)];
                match medium.sample_way(&path.ray, length, path.beta, sampler) {
                    Flight::Passed { weight } => path.beta *= weight,
                    Flight::Scattered { distance, weight } => {
                        path.beta *= weight;
                        self.scatter_in_medium(&mut path, id, distance, sampler, out);
                        if !path.survives(sampler) {
                            return path.tries;
                        }
                        continue;
                    }
                }
            }
            let Some(mut hit) = hit else {
                for &light in &scene.environments {
                    self.meet(&path, light, None, out);
                }
                return path.tries;
            };
            path.distance += hit.t;
            if let Some(light) = scene.objects()[hit.object as usize].light {
                let at = LightHit {
                    normal: hit.ng,
                    primitive: hit.primitive,
                    distance: path.distance,
                };
                self.meet(&path, light as usize, Some((at, &hit)), out);
            }
            let Some(material) = scene.material(&hit).met(&hit.at, || sampler.next_1d()) else {
                path.medium = scene.medium_beyond(&hit, path.ray.dir, path.medium);
                path.ray = hit.spawn_ray(path.ray.dir);
                continue;
            };
            if !self.scatter_at_surface(&mut path, (material, &mut hit), sampler, out) {
                return path.tries;
            }
        }
        path.tries
    }

    /// Handles a light that the path has met.
    fn meet(&self, path: &Path<V::Hidden>, light: usize, hit: Option<(LightHit, &SurfaceHit)>, out: &mut Found) {
        let Some((point, pdf)) = path.from else {
            return;
        };
        if !self.lights.contains(&light) {
            return;
        }
        let scene = self.scene;
        let dir = path.ray.dir;
        let (radiance, at) = match hit {
            Some((at, hit)) => (scene.emitted(hit, dir, at.distance), Some(at)),
            None => (scene.environment(light, dir), None),
        };
        let balance = match pdf {
            Some(pdf) => {
                let sampled = scene.lights()[light].pdf_direct(scene.objects(), point, dir, at);
                power_heuristic(pdf, sampled / self.lights.len() as f32)
            }
            None => 1.0,
        };
        let weight = mean(path.beta * radiance) * balance;
        let place = Viewpoint {
            point,
            towards: dir,
            distance: at.map_or(f32::INFINITY, |at| at.distance),
            normal: at.map_or(-dir, |at| at.normal),
            weight,
            odd: path.odd,
        };
        keep(light, place, out);
    }

    fn scatter_in_medium(
        &self,
        path: &mut Path<V::Hidden>,
        id: u16,
        distance: f32,
        sampler: &mut Sampler,
        out: &mut Found,
    ) {
        let medium = &self.scene.media()[usize::from(id)];
        let (point, dir, phase) = (path.ray.at(distance), path.ray.dir, medium.phase());
        let serves_all = self.estimators.is_by_beams(id);
        let is_sampled = path.scattered == 0 && matches!(medium, Medium::Homogeneous(_));
        let counts = path.by_beams || serves_all && !is_sampled;
        if counts {
            let vertex = Vertex::Medium { point, dir, phase };
            path.tries += 1;
            self.connect(path, &vertex, sampler, out);
        }
        let new = phase.sample(dir, sampler.next_2d());
        path.from = counts.then_some((point, Some(phase.eval_directions(dir, new))));
        path.ray = Ray {
            origin: point,
            dir: new,
        };
        path.hidden = self.hidden(Start::Medium(id), sampler);
        path.distance = 0.0;
        path.scattered += 1;
        path.by_beams |= serves_all;
        path.was_surface = false;
    }

    /// Scatters the path at a surface. Returns false if it ends here.
    fn scatter_at_surface(
        &self,
        path: &mut Path<V::Hidden>,
        (material, hit): (&Material, &mut SurfaceHit),
        sampler: &mut Sampler,
        out: &mut Found,
    ) -> bool {
        let scene = self.scene;
        let SurfaceInteraction {
            bsdf,
            frame,
            wo,
            local_wo,
            ..
        } = scene.interaction(material, hit, path.ray.dir, None);
        let hit = &*hit;
        let is_specular = material.is_specular();
        let is_followed = material.follows(&bsdf) || material.has(BsdfFlags::DELTA | BsdfFlags::NARROW_LOBE);
        let counts = path.by_beams
            || is_followed && path.scattered + path.followed > 0
            || self.estimators.photons_go_on()
                && match path.scattered {
                    0 => false,
                    1 => !path.was_surface,
                    _ => true,
                };
        if counts {
            let vertex = Vertex::Surface {
                hit,
                bsdf: &bsdf,
                frame,
                wo,
                local_wo,
                is_specular,
            };
            path.tries += 1;
            self.connect(path, &vertex, sampler, out);
        }
        // Reflects as for photons: refraction would compress and expand radiance.
        let mode = TransportMode::Flux;
        let (u_lobe, u) = (sampler.next_1d(), sampler.next_2d());
        let Some(sample) = bsdf.sample(local_wo, u_lobe, u, mode) else {
            return false;
        };
        let wi = frame.to_world(sample.wi).normalize();
        if sample.wi.z * hit.ng.dot(wi) <= 0.0 {
            return false;
        }
        path.beta *= sample.weight;
        path.from = counts.then_some((hit.point, (!sample.delta).then_some(sample.pdf)));
        if sample.transmitted {
            path.medium = scene.medium_beyond(hit, wi, path.medium);
        }
        path.hidden = match (path.scattered, sample.delta) {
            (0, true) if sample.transmitted => self.mask.from(Start::Refracted(hit.object)),
            (0, true) => self.mask.from(Start::Reflected(hit.object)),
            _ => self.hidden(Start::Photon(hit.object), sampler),
        };
        path.was_surface = false;
        if !sample.delta && material.follows(&bsdf) {
            path.followed += u32::from(path.scattered == 0);
        } else if !sample.delta {
            path.scattered += 1;
            path.was_surface = true;
        }
        path.ray = hit.spawn_ray(wi);
        path.distance = 0.0;
        path.survives(sampler)
    }

    /// What a piece of the path does not see if photons travel it the other way. It is not yet known where they come
    /// from: a light, something like most surfaces, or something like what the path has met.
    fn hidden(&self, like: Start, sampler: &mut Sampler) -> V::Hidden {
        // Drawn without rules as well: adding objects that no ray sees changes nothing.
        let u = sampler.next_1d() * 3.0;
        if !V::RULED {
            return self.mask.from(like);
        }
        self.mask.from(match u as u32 {
            0 => like,
            1 => Start::Gather,
            _ => {
                let number = ((u - 2.0).max(0.0) * self.lights.len() as f32) as usize;
                self.lights
                    .get(number)
                    .map_or(Start::Gather, |&light| Start::Light(light))
            }
        })
    }

    /// Look for one light from a vertex.
    fn connect(&self, path: &Path<V::Hidden>, vertex: &Vertex, sampler: &mut Sampler, out: &mut Found) {
        let scene = self.scene;
        let count = self.lights.len();
        let choice = sampler.next_1d();
        let (u, u_primitive) = (sampler.next_2d(), sampler.next_1d());
        let Some(&number) = self.lights.get((choice * count as f32) as usize) else {
            return;
        };
        let light = &scene.lights()[number];
        let point = vertex.point();
        let Some(direct) = light.sample_direct(scene.objects(), point, u, u_primitive) else {
            return;
        };
        let hidden = self.mask.from(Start::Light(number));
        let (scattering, ray, medium) = match vertex {
            Vertex::Surface { hit, wo, .. } => {
                if self.mask.hides(hidden, hit.object) {
                    return;
                }
                let crosses = hit.ng.dot(direct.wi) * hit.ng.dot(*wo) < 0.0;
                let beyond = || scene.medium_beyond(hit, direct.wi, path.medium);
                let medium = if crosses { beyond() } else { path.medium };
                let is_environment = matches!(light.kind, LightKind::Environment(_));
                (
                    vertex.towards(&direct, is_environment, count as f32),
                    hit.ray_to(direct.wi, direct.distance).0,
                    medium,
                )
            }
            Vertex::Medium { point, .. } => {
                let ray = Ray {
                    origin: *point,
                    dir: direct.wi,
                };
                (vertex.towards(&direct, false, count as f32), ray, path.medium)
            }
        };
        let value = path.beta * scattering * direct.weight;
        if value.max_element() <= 0.0 {
            return;
        }
        let hides = |object: u32| self.mask.hides(hidden, object);
        let unshadowing = scene.unshadowing[number];
        let seen = scene.unoccluded(
            ray,
            (direct.distance, direct.distance),
            medium,
            unshadowing,
            hides,
            sampler,
        );
        if let Some(transmittance) = seen {
            let place = Viewpoint {
                point,
                towards: direct.wi,
                distance: direct.distance,
                normal: direct.normal,
                weight: mean(value * transmittance) * count as f32,
                odd: path.odd,
            };
            keep(number, place, out);
        }
    }
}

fn keep(light: usize, place: Viewpoint, out: &mut Found) {
    if place.weight > 0.0 && place.weight.is_finite() && place.point.is_finite() {
        out.push((light, place));
    }
}

impl Vertex<'_> {
    fn point(&self) -> Vec3 {
        match self {
            Self::Surface { hit, .. } => hit.point,
            Self::Medium { point, .. } => *point,
        }
    }

    /// Scattering of the sampled light, balanced against meeting it by chance. Specular surfaces, from which the
    /// light's photons go on wherever they come from, count as if they scattered to all sides; but not for
    /// environments, which are met.
    fn towards(&self, direct: &DirectSample, is_environment: bool, lights: f32) -> Rgb {
        let (value, pdf) = match self {
            Self::Surface { is_specular: true, .. } => {
                let value = if is_environment { 0.0 } else { 0.25 / crate::math::PI };
                return Rgb::splat(value);
            }
            Self::Medium { dir, phase, .. } => {
                let pdf = phase.eval_directions(*dir, direct.wi);
                (Rgb::splat(pdf), pdf)
            }
            Self::Surface {
                hit,
                bsdf,
                frame,
                local_wo: wo,
                ..
            } => {
                let wi = frame.to_local(direct.wi);
                if wi.z * hit.ng.dot(direct.wi) <= 0.0 {
                    return Rgb::ZERO;
                }
                // Shadowing by bumps is ignored here.
                let value = bsdf.eval(*wo, wi, TransportMode::Flux);
                (value * wi.z.abs(), bsdf.pdf(*wo, wi))
            }
        };
        if direct.unmet {
            return value;
        }
        value * power_heuristic(direct.pdf / lights, pdf)
    }
}

impl<H> Path<H> {
    fn survives(&mut self, sampler: &mut Sampler) -> bool {
        self.depth += 1;
        if self.depth < ROULETTE_DEPTH {
            return true;
        }
        let q = self.beta.max_element().min(MAX_SURVIVAL);
        let survived = roulette::survives(q, self.depth, sampler);
        self.beta /= survived.unwrap_or(1.0);
        survived.is_some()
    }
}
