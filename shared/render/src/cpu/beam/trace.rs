//! From lights to photon beams and surface photons.
//!
//! A photon path goes from a light through media and off surfaces until Russian roulette ends it, or until nothing that
//! it may leave counts. In a scattering medium its segments leave [`PhotonBeam`]s, its hits on surfaces that are not
//! specular [`SurfacePhoton`]s, where the table in `transport` says that photons bring that light.

use super::PhotonBeam;
use super::edges::{Probe, SurfaceKernel};
use super::walls::{self, End, Plane};
use crate::cpu::photon_map::{Arrival, SeenBy, SurfacePhoton};
use crate::math::{Ray, Rgb, Vec3, exp_neg, mean};
use crate::parallel;
use crate::plan::RenderPlan;
use crate::plan::aov::GroupNumber;
use crate::plan::estimators::PathEnds;
use crate::plan::footprint::{Footprint, spread};
use crate::plan::targeting::{Aim, Targets};
use crate::plan::weights::{DEEPER, FoundBy, Weights};
use crate::roulette;
use crate::sampler::{Purpose, Sampler};
use crate::world::bsdf::{BsdfFlags, Material, TransportMode};
use crate::world::geometry::SurfaceHit;
use crate::world::light::{EmissionSample, EmissionUniforms, LightChoice, LightHit, LightPoint, SceneBounds};
use crate::world::mask::{Ruled, Start, Unruled, VisibilityMask};
use crate::world::medium::transmittance::StepFunctions;
use crate::world::medium::{Flight, Medium, MediumId, MediumSegment};
use crate::world::spectrum::{Wave, WaveSet};
use crate::world::{Scene, SurfaceInteraction};
use beamfarm_image::job::{JobSettings, ScheduleKind};
use beamfarm_image::radius::Schedule;
use std::ops::Range;

/// Everything that the photon paths of a pass leave behind.
#[derive(Debug, Default)]
pub struct Photons {
    /// Beams, in the order of paths, but for the smooth ones.
    pub beams: Vec<PhotonBeam>,
    /// Beams of light that has been scattered: their kernels are wide, so that camera segments share what they gather.
    pub smooth_beams: Vec<PhotonBeam>,
    /// Transmittance along the beams in heterogeneous media, but for the smooth ones.
    pub steps: StepFunctions,
    /// The same along the smooth ones.
    pub smooth_steps: StepFunctions,
    /// Walls near the beams, but for the smooth ones.
    pub walls: Vec<Plane>,
    /// The same near the smooth ones.
    pub smooth_walls: Vec<Plane>,
    /// Surface photons, in the order of paths.
    pub surface: Vec<SurfacePhoton>,
    /// Rays that were traced for them.
    pub rays: u64,
    /// How many of these met a surface, or something that scatters in a medium.
    pub met: u64,
}

/// Paths that one task traces. Any number gives the same photons.
const CHUNK: u32 = 256;
/// Paths after which a task looks whether it is interrupted.
const BETWEEN_LOOKS: u32 = 16;

/// Trace the photon paths of a pass.
pub fn trace_photons(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Photons {
    trace_paths(scene, plan, pass_index, 0..plan.surface_paths)
}

/// Trace some of them: the first of all leave beams as well.
pub fn trace_paths(scene: &Scene, plan: &RenderPlan, pass_index: u64, some: Range<u32>) -> Photons {
    match &scene.description().rules {
        None => trace_with(scene, plan, (pass_index, some), Unruled),
        Some(rules) => trace_with(scene, plan, (pass_index, some), Ruled(rules)),
    }
}

fn trace_with(
    scene: &Scene,
    plan: &RenderPlan,
    (pass_index, some): (u64, Range<u32>),
    mask: impl VisibilityMask,
) -> Photons {
    let schedule = Schedule::new(&plan.settings);
    let paths = plan.surface_paths;
    let beam_paths = plan.settings.paths_per_pass;
    let share = beam_paths as f32 / paths as f32;
    let tracer = Tracer {
        scene,
        plan,
        radius_scale: schedule.scale(pass_index) as f32,
        surface_scale: schedule.surface_scale(pass_index) as f32,
        paths: paths as f32,
        beam_paths: beam_paths as f32,
        kernel_paths: kernel_paths(&plan.settings),
        // Kernels are those of paths that leave beams.
        surface_footprint: share.sqrt(),
        goes_on: plan.estimators.photons_go_on(),
        weights: Weights::new(scene, plan, pass_index),
        waves: plan.wave_set(pass_index),
        mask,
    };
    let chunks = parallel::map(some.len().div_ceil(CHUNK as usize), |chunk| {
        let mut photons = Photons::default();
        let first = some.start + chunk as u32 * CHUNK;
        for path in first..(first + CHUNK).min(some.end) {
            if path % BETWEEN_LOOKS == 0 && scene.is_interrupted() {
                break;
            }
            let seed = plan.settings.seed;
            let mut sampler = match plan.is_even {
                true => Sampler::of_paths(seed, pass_index, Purpose::Photons, (path, paths)),
                false => Sampler::new(seed, pass_index, Purpose::Photons, path.into()),
            };
            tracer.trace(&mut sampler, path < beam_paths, &mut photons);
        }
        photons
    });
    let mut joined = Photons {
        beams: Vec::with_capacity(chunks.iter().map(|c| c.beams.len()).sum()),
        smooth_beams: Vec::with_capacity(chunks.iter().map(|c| c.smooth_beams.len()).sum()),
        surface: Vec::with_capacity(chunks.iter().map(|c| c.surface.len()).sum()),
        steps: StepFunctions::default(),
        smooth_steps: StepFunctions::default(),
        walls: Vec::with_capacity(chunks.iter().map(|c| c.walls.len()).sum()),
        smooth_walls: Vec::with_capacity(chunks.iter().map(|c| c.smooth_walls.len()).sum()),
        rays: chunks.iter().map(|c| c.rays).sum(),
        met: chunks.iter().map(|c| c.met).sum(),
    };
    for mut chunk in chunks {
        let before = joined.steps.append(&chunk.steps);
        chunk.beams.iter_mut().for_each(|beam| beam.steps += before);
        let before = joined.smooth_steps.append(&chunk.smooth_steps);
        chunk.smooth_beams.iter_mut().for_each(|beam| beam.steps += before);
        let after = |beams: &mut [PhotonBeam], before: u32| {
            beams
                .iter_mut()
                .for_each(|beam| beam.walls = beam.walls.map(|wall| wall + before));
        };
        after(&mut chunk.beams, joined.walls.len() as u32);
        after(&mut chunk.smooth_beams, joined.smooth_walls.len() as u32);
        joined.walls.extend(chunk.walls);
        joined.smooth_walls.extend(chunk.smooth_walls);
        joined.beams.extend(chunk.beams);
        joined.smooth_beams.extend(chunk.smooth_beams);
        joined.surface.extend(chunk.surface);
    }
    joined
}

/// Number of paths whose footprints kernels are as wide as. Fewer paths a pass are more passes: kernels are such that
/// after as many paths in all they are as wide. Their area goes as one over this number, and in passes as N^(alpha -
/// 1).
pub fn kernel_paths(settings: &JobSettings) -> f32 {
    let (paths, reference) = (settings.paths_per_pass, settings.reference_paths);
    if paths >= reference {
        return paths as f32;
    }
    let ratio = f64::from(paths) / f64::from(reference);
    let power = match settings.schedule {
        ScheduleKind::Pass => 1.0 - settings.alpha,
        ScheduleKind::Beam => 0.0,
    };
    (f64::from(reference) * libm::pow(ratio, power)) as f32
}

struct Tracer<'a, V> {
    scene: &'a Scene,
    plan: &'a RenderPlan,
    radius_scale: f32,
    surface_scale: f32,
    /// All paths, and those that leave beams.
    paths: f32,
    beam_paths: f32,
    /// Paths that kernels are made for.
    kernel_paths: f32,
    surface_footprint: f32,
    /// Beyond surfaces and media that paths do not follow: what a photon leaves there may count.
    goes_on: bool,
    weights: Weights,
    /// Where some surface bends light of each wavelength by another angle.
    waves: Option<WaveSet>,
    mask: V,
}

/// A photon on its way.
struct Photon<H> {
    ray: Ray,
    /// What the ray does not see.
    hidden: H,
    /// Flux, W, divided by the number of emitted paths.
    power: Rgb,
    /// Since it met a surface that bends light of each by another angle. Its weight is no part of the power.
    wave: Option<Wave>,
    medium: MediumId,
    footprint: Footprint,
    /// The surface that the ray starts on, if it does.
    starts_on: Option<End>,
    arrival: Arrival,
    /// Which technique finds what it leaves at the next surface.
    found_by: FoundBy,
    /// The same of caustics that it brings.
    caustic_by: FoundBy,
    /// Length of its way since it was scattered last.
    flown: f32,
    /// Where on the light it started; of other lights than surfaces the direction back.
    emitted_at: LightPoint,
    /// No surface or medium has scattered it widely.
    is_pure: bool,
    /// No surface or medium has scattered it at all: it was reflected and refracted.
    is_sharp: bool,
    /// Its light, and that light's group.
    light: usize,
    group: Option<GroupNumber>,
    depth: u32,
    /// The least that it has been worth for where it was.
    worth: f32,
    leaves_beams: bool,
}

impl<V: VisibilityMask> Tracer<'_, V> {
    fn trace(&self, sampler: &mut Sampler, leaves_beams: bool, out: &mut Photons) {
        let targets = self.plan.targets.as_deref();
        let Some(choice) = self.plan.emitters().sample(sampler.next_1d()) else {
            return;
        };
        let aim = targets.and_then(|targets| targets.of(choice.light));
        match aim {
            Some(aim) if targets.is_some_and(Targets::rejects) => {
                for _ in 0..aim.trials {
                    let emission = self.emit(choice.light, None, sampler);
                    let Some(photon) = self.start(choice, emission, aim.trials, leaves_beams) else {
                        continue;
                    };
                    if aim.is_hit(self.scene, choice.light, &photon.ray, self.mask) {
                        self.follow(photon, sampler, out);
                    }
                }
            }
            aim => {
                let emission = self.emit(choice.light, aim, sampler);
                if let Some(photon) = self.start(choice, emission, 1, leaves_beams) {
                    self.follow(photon, sampler, out);
                }
            }
        }
    }

    fn follow(&self, mut photon: Photon<V::Hidden>, sampler: &mut Sampler, out: &mut Photons) {
        while photon.power.max_element() > 0.0 {
            out.rays += 1;
            let hit = self
                .scene
                .first_hit(&photon.ray, |object| self.mask.hides(photon.hidden, object));
            if let Some(id) = photon.medium
                && self.fly(&mut photon, id, hit.as_ref(), sampler, out)
            {
                out.met += 1;
                continue;
            }
            let Some(mut hit) = hit else { return };
            out.met += 1;
            photon.footprint = photon.footprint.advanced(hit.t);
            photon.flown += hit.t;
            self.meet_surface(&mut photon, &mut hit, sampler, out);
        }
    }

    /// Where a photon of a light starts: as the light emits it, or, if there is an aim, some of the time through that.
    fn emit(&self, light: usize, aim: Option<&Aim>, sampler: &mut Sampler) -> Option<EmissionSample> {
        let light = &self.scene.lights()[light];
        let (objects, bounds) = (self.scene.objects(), self.scene.bounds());
        let uniforms = EmissionUniforms::draw(sampler);
        match aim {
            None => Some(light.sample_emission(objects, bounds, uniforms)),
            Some(aim) => light.sample_mixture(objects, bounds, aim, uniforms, sampler.next_1d()),
        }
    }

    /// A photon on its way from a light. `trials`: as many are started for each path.
    fn start(
        &self,
        choice: LightChoice,
        emission: Option<EmissionSample>,
        trials: u32,
        leaves_beams: bool,
    ) -> Option<Photon<V::Hidden>> {
        let emission = emission?;
        let paths = self.kernel_paths * choice.pmf * trials as f32;
        let radius = (1.0 / (std::f32::consts::PI * emission.pdf_pos * paths)).sqrt();
        let origin = self.scene.start_of(&emission);
        let emitted_at = LightPoint {
            normal: emission.normal.unwrap_or(-emission.dir),
            primitive: emission.primitive,
        };
        let caustic_by = match self.weights.in_caustic[choice.light] {
            0.0 => FoundBy::Photons,
            in_caustic => {
                let light = &self.scene.lights()[choice.light];
                let (objects, bounds) = (self.scene.objects(), self.scene.bounds());
                FoundBy::Both(in_caustic * light.emitted_density(objects, bounds, emission.dir, emitted_at))
            }
        };
        Some(Photon {
            ray: Ray {
                origin,
                dir: emission.dir,
            },
            hidden: self.mask.from(Start::Light(choice.light)),
            power: emission.power / (self.paths * choice.pmf * trials as f32),
            wave: None,
            medium: self.scene.medium_of_light(choice.light, origin),
            footprint: Footprint::new(emission.dir, radius, spread(emission.pdf_dir, paths)),
            starts_on: emission.normal.map(|normal| End { normal, bounds: false }),
            arrival: Arrival::Direct,
            found_by: FoundBy::Photons,
            caustic_by,
            flown: 0.0,
            emitted_at,
            is_pure: true,
            is_sharp: true,
            light: choice.light,
            group: self.plan.layers.group(choice.light),
            depth: 0,
            worth: 1.0,
            leaves_beams,
        })
    }

    /// Whether what a photon brings, by way of specular surfaces alone, is found by no camera path.
    fn brings_caustics(&self, photon: &Photon<V::Hidden>) -> bool {
        self.plan.estimators.brings_photons(photon.light)
    }

    /// Fly through a medium to the next surface, leaving a beam. True: the photon was scattered on the way.
    fn fly(
        &self,
        photon: &mut Photon<V::Hidden>,
        id: u16,
        hit: Option<&SurfaceHit>,
        sampler: &mut Sampler,
        out: &mut Photons,
    ) -> bool {
        let medium = &self.scene.media()[id as usize];
        let length = hit.map_or(f32::INFINITY, |h| h.t);
        let serves_all = self.plan.estimators.is_by_beams(id);
        let counts = match photon.arrival {
            // Light straight from its source is sampled where the medium is homogeneous.
            Arrival::Direct => serves_all && !matches!(medium, Medium::Homogeneous(_)),
            Arrival::Surface => serves_all,
            Arrival::Caustic => serves_all || self.brings_caustics(photon),
            Arrival::Scattered => true,
        };
        let of_medium = self.mask.from(Start::Medium(id));
        let is_unlit = self.mask.hides_light(of_medium, photon.light);
        if photon.leaves_beams && medium.scatters() && counts && !is_unlit {
            let (steps, beams, near) = match photon.footprint.is_smooth() {
                true => (&mut out.smooth_steps, &mut out.smooth_beams, &mut out.smooth_walls),
                false => (&mut out.steps, &mut out.beams, &mut out.walls),
            };
            let (segment, _) = medium.segment(&photon.ray, length, sampler, steps);
            if let Some(segment) = segment {
                let (mut beam, ends) = self.beam(photon, id, segment, hit, sampler);
                // In other media camera paths go on from their vertices, and may gather beams anywhere.
                let view = self.plan.view.as_ref().filter(|_| serves_all);
                let is_seen = view.is_none_or(|view| view.meets(beam.ends(), beam.max_radius()));
                if is_seen {
                    walls::find(self.scene, &mut beam, ends, near);
                    beams.push(beam);
                }
            }
        }
        let before = mean(photon.power);
        match medium.sample_flight(&photon.ray, length, photon.power, sampler) {
            Flight::Passed { weight } => {
                photon.power *= weight;
                false
            }
            Flight::Scattered { distance, weight } => {
                photon.power *= weight;
                let worth = self.far_worth(photon, id, distance);
                if !serves_all && !self.goes_on {
                    photon.power = Rgb::ZERO;
                } else if photon.survives(before / worth, sampler) {
                    let old = photon.ray.dir;
                    let dir = medium.phase().sample(old, sampler.next_2d());
                    let pdf = medium.phase().pdf(old.dot(dir));
                    photon.footprint = photon
                        .footprint
                        .advanced(distance)
                        .scattered(dir, pdf, self.kernel_paths, true);
                    photon.ray = Ray {
                        origin: photon.ray.at(distance),
                        dir,
                    };
                    photon.hidden = of_medium;
                    photon.starts_on = None;
                    photon.arrival = match serves_all {
                        true => Arrival::Scattered,
                        false => Arrival::Surface,
                    };
                    // What other media send on is found by camera paths.
                    photon.found_by = match serves_all {
                        true => FoundBy::Photons,
                        false => FoundBy::Paths,
                    };
                    photon.flown = 0.0;
                    photon.is_pure = false;
                    photon.is_sharp = false;
                }
                true
            }
        }
    }

    /// Factor on the probability that a photon goes on which was scattered at this distance: what it is worth there,
    /// over the least that it has been worth.
    fn far_worth(&self, photon: &mut Photon<V::Hidden>, id: u16, distance: f32) -> f32 {
        let Medium::Homogeneous(medium) = &self.scene.media()[usize::from(id)] else {
            return 1.0;
        };
        let SceneBounds { center, radius } = *self.scene.bounds();
        let beyond = photon.ray.at(distance).distance(center) - radius;
        if beyond <= 0.0 || beyond.is_nan() {
            return 1.0;
        }
        let worth = exp_neg(-FAR_DECAY * medium.least_sigma_t() * beyond).max(LEAST_WORTH);
        let share = (worth / photon.worth).min(1.0);
        photon.worth = photon.worth.min(worth);
        share
    }

    /// The beam of a photon that flies to `hit`, over the segment of its way that can be seen, and what it starts and
    /// ends on.
    fn beam(
        &self,
        photon: &Photon<V::Hidden>,
        id: u16,
        segment: MediumSegment,
        hit: Option<&SurfaceHit>,
        sampler: &mut Sampler,
    ) -> (PhotonBeam, [Option<End>; 2]) {
        let [start, length] = segment.range;
        let widest = match photon.footprint.is_smooth() {
            true => f32::INFINITY,
            false => self.scene.free_paths[usize::from(id)],
        };
        let scaled = |footprint: Footprint| self.plan.radii.beam(&footprint).min(widest) * self.radius_scale;
        let radius = scaled(photon.footprint);
        let radius_end = scaled(photon.footprint.advanced(length));
        let slope = (radius_end - radius) / length;
        let beyond =
            |end: Option<End>, radius: f32| end.map_or(0.0, |e| overhang(photon.ray.dir.dot(e.normal), radius, slope));
        let ends_on = hit.filter(|h| length == h.t).map(|h| End::on(self.scene, h));
        let starts_on = photon.starts_on.filter(|_| start == 0.0);
        let before = if start == 0.0 {
            beyond(starts_on, radius)
        } else {
            // Where it enters the medium's box, its whole width does.
            start.min(BOX_MARGIN * radius)
        };
        // Other kernels are narrow.
        let factor = match start == 0.0 && photon.footprint.is_smooth() {
            true => {
                let probe = Probe {
                    scene: self.scene,
                    hides: |object: u32| self.mask.hides(photon.hidden, object),
                };
                probe.beam(&photon.ray, starts_on.map(|end| end.normal), radius, sampler)
            }
            false => 1.0,
        };
        let beam = PhotonBeam {
            origin: photon.ray.origin,
            dir: photon.ray.dir,
            length,
            extent: [start - before, length + beyond(ends_on, radius_end)],
            power: photon.power * (factor * self.paths / self.beam_paths),
            radius,
            radius_slope: slope,
            medium: id,
            group: photon.group,
            wave: photon.wave.map(|wave| wave.number),
            steps: segment.steps,
            walls: [0; 2],
        };
        (beam, [starts_on, ends_on])
    }

    /// Leave a surface photon where one is due, and go on in a sampled direction.
    fn meet_surface(
        &self,
        photon: &mut Photon<V::Hidden>,
        hit: &mut SurfaceHit,
        sampler: &mut Sampler,
        out: &mut Photons,
    ) {
        let dir = photon.ray.dir;
        let material = self.scene.material(hit);
        let Some(part) = material.met(&hit.at, || sampler.next_1d()) else {
            photon.ray = hit.spawn_ray(dir);
            photon.starts_on = Some(End::on(self.scene, hit));
            photon.medium = self.scene.medium_beyond(hit, dir, photon.medium);
            return;
        };
        if let Some(waves) = self
            .waves
            .as_ref()
            .filter(|_| photon.wave.is_none() && part.has(BsdfFlags::DISPERSES))
        {
            photon.wave = Some(waves.choose(sampler.next_1d()));
        }
        let SurfaceInteraction {
            mut bsdf,
            bump_shadowing,
            frame,
            wo,
            local_wo,
            ..
        } = self.scene.interaction(part, hit, dir, photon.wave);
        if let Some(lobes) = self.seen_by(photon, material) {
            self.leave_surface_photon(photon, hit, lobes, sampler, out);
        }
        let before = mean(photon.power);
        let mut u_lobe = sampler.next_1d();
        let mut is_narrow = bsdf.has(BsdfFlags::FOLLOWED);
        if let Some((p, [narrow, wide])) = bsdf.narrow_and_wide(local_wo) {
            is_narrow = u_lobe < p;
            let q;
            (bsdf, q, u_lobe) = match is_narrow {
                true => (narrow, p, u_lobe / p),
                false => (wide, 1.0 - p, (u_lobe - p) / (1.0 - p)),
            };
            photon.power /= q;
        }
        let sample = bsdf.sample(local_wo, u_lobe, sampler.next_2d(), TransportMode::Flux);
        let Some(sample) = sample else {
            photon.power = Rgb::ZERO;
            return;
        };
        let is_followed = sample.delta || is_narrow;
        if !is_followed && !self.goes_on {
            photon.power = Rgb::ZERO;
            return;
        }
        let wi = frame.to_world(sample.wi).normalize();
        photon.power *= sample.weight * adjoint_factor(hit, wo, wi);
        if let Some(shadowing) = bump_shadowing {
            photon.power *= shadowing.factor(wo);
        }
        if !photon.survives(before, sampler) {
            return;
        }
        let n = hit.ns;
        photon.footprint = if !sample.delta {
            let footprint = &photon.footprint;
            footprint.scattered(wi, sample.pdf, self.kernel_paths, !is_followed)
        } else if sample.transmitted {
            let eta = part.eta_of_crossing(hit.ng.dot(dir) > 0.0, photon.wave);
            photon.footprint.refracted(dir, wi, n, hit.curvature, eta)
        } else {
            photon.footprint.reflected(dir, n, hit.curvature)
        };
        if sample.transmitted {
            photon.medium = self.scene.medium_beyond(hit, wi, photon.medium);
        }
        photon.found_by = match is_followed || !self.mask.is_gathered(hit.object) {
            true if photon.is_pure => photon.caustic_by,
            true => FoundBy::Photons,
            // The normal is another one seen from elsewhere: left to gather rays, which see it from one side only. So
            // are surfaces that camera paths go on from.
            false if bump_shadowing.is_some() || !self.plan.estimators.ends_paths(&bsdf) => FoundBy::Paths,
            false => {
                let photons = self.expected(photon, hit) * sample.pdf;
                FoundBy::Both(photons / wi.dot(hit.ng).abs())
            }
        };
        photon.arrival = match (photon.arrival, is_followed) {
            (Arrival::Direct | Arrival::Caustic, true) => Arrival::Caustic,
            (Arrival::Surface, true) if self.goes_on => Arrival::Caustic,
            (before, true) => before,
            (_, false) => Arrival::Surface,
        };
        photon.is_pure &= is_followed;
        photon.is_sharp &= sample.delta;
        photon.flown = 0.0;
        photon.ray = hit.spawn_ray(wi);
        photon.hidden = self.mask.from(Start::Photon(hit.object));
        photon.starts_on = Some(End::on(self.scene, hit));
    }

    /// By which lobes of a surface a photon that lands there is to be seen; none if it is not to be left. Of a blend,
    /// camera paths choose the part that sees it.
    fn seen_by(&self, photon: &Photon<V::Hidden>, material: &Material) -> Option<SeenBy> {
        let by_wide = material.has(BsdfFlags::WIDE)
            && match photon.arrival {
                Arrival::Direct => false,
                Arrival::Caustic => self.brings_caustics(photon),
                Arrival::Scattered => true,
                Arrival::Surface => self.plan.estimators.ends() != PathEnds::Never,
            };
        // Where a rough lobe was before, camera paths look for the light from there.
        let by_followed = photon.arrival == Arrival::Caustic
            && photon.is_sharp
            && self.scene.lights()[photon.light].kind.is_unmet()
            && material.has(BsdfFlags::FOLLOWED | BsdfFlags::NARROW_LOBE);
        match (by_wide, by_followed) {
            (true, true) => Some(SeenBy::All),
            (true, false) => Some(SeenBy::Wide),
            (false, true) => Some(SeenBy::Followed),
            (false, false) => None,
        }
    }

    /// Leave a surface photon where a photon has landed.
    fn leave_surface_photon(
        &self,
        photon: &Photon<V::Hidden>,
        hit: &SurfaceHit,
        lobes: SeenBy,
        sampler: &mut Sampler,
        out: &mut Photons,
    ) {
        let wi = -photon.ray.dir;
        let radii = &self.plan.radii;
        let radius = radii.surface(&photon.footprint, self.surface_footprint);
        let probe = Probe {
            scene: self.scene,
            hides: |object: u32| self.mask.hides(photon.hidden, object),
        };
        let widest = LOCAL * self.scene.extents[hit.object as usize];
        let radius = radius.min(widest) * self.surface_scale;
        let SurfaceKernel { radius, factor, walls } = probe.surface(hit, wi, radius, sampler);
        let of_object = self.mask.from(Start::Photon(hit.object));
        // Camera paths go on after a flight so short from a surface that they would have ended at.
        let is_near = photon.arrival != Arrival::Caustic && photon.flown < self.weights.least_flight;
        out.surface.push(SurfacePhoton {
            point: hit.point,
            ng: hit.ng,
            wi,
            power: photon.power * factor,
            radius,
            walls,
            arrival: photon.arrival,
            found_by: match self.mask.hides_light(of_object, photon.light) {
                true => FoundBy::PathsByRule,
                false if photon.found_by != FoundBy::Photons && is_near => FoundBy::Paths,
                false => photon.found_by,
            },
            lobes,
            group: photon.group,
            wave: photon.wave.map(|wave| wave.number),
            light_kind: self.mask.light_kind(photon.light),
        });
    }

    /// Expected photons of the light that one brings to a surface, before the density of its next direction.
    fn expected(&self, photon: &Photon<V::Hidden>, hit: &SurfaceHit) -> f32 {
        if photon.arrival != Arrival::Direct {
            return DEEPER;
        }
        let wo = -photon.ray.dir;
        let at = LightHit {
            normal: photon.emitted_at.normal,
            primitive: photon.emitted_at.primitive,
            distance: photon.flown,
        };
        let density = self.scene.lights()[photon.light].photon_density(
            self.scene.objects(),
            self.scene.bounds(),
            hit.point,
            wo,
            at,
        );
        self.weights.in_kernel * density * wo.dot(hit.ng).abs()
    }
}

impl<H> Photon<H> {
    /// Russian roulette: the flux after survival is what it was before the scattering, as far as probabilities allow.
    fn survives(&mut self, flux_before: f32, sampler: &mut Sampler) -> bool {
        self.depth += 1;
        match roulette::survives(mean(self.power) / flux_before, self.depth, sampler) {
            Some(q) => {
                self.power /= q;
                true
            }
            None => {
                self.power = Rgb::ZERO;
                false
            }
        }
    }
}

/// How far beyond a surface a beam of `radius` reaches with some of its width, when it meets the surface at `cos`.
/// Bounded for grazing angles and so that the cone keeps half of its radius.
fn overhang(cos: f32, radius: f32, slope: f32) -> f32 {
    let cos = cos.abs().max(0.05);
    let length = radius * (1.0 - cos * cos).max(0.0).sqrt() / cos;
    let limit = if slope == 0.0 {
        f32::INFINITY
    } else {
        0.5 * radius / slope.abs()
    };
    length.min(MAX_OVERHANG * radius).min(limit)
}

/// What a photon is worth that has been scattered beyond the scene's bounds, in fog without an end, goes as e to the
/// minus so much times its optical distance from them: it is seen from there, or comes back, through all of that.
const FAR_DECAY: f32 = 0.5;
/// The least that it is worth: none gets heavier than the reciprocal for being far.
const LEAST_WORTH: f32 = 1.0 / 64.0;

/// Widest kernel over the size of what the light lands on.
const LOCAL: f32 = 0.25;
/// How far in radii a beam reaches out of the box that a heterogeneous medium fills.
const BOX_MARGIN: f32 = 2.0;
/// Longest overhang in radii: beams that graze a surface must not reach far behind thin walls.
const MAX_OVERHANG: f32 = 4.0;

/// What interpolated normals cost a photon: paths from lights and paths from the camera then describe the same surface
/// (Veach 1997, section 5.3). Zero where shading and geometric normal disagree about the side.
fn adjoint_factor(hit: &SurfaceHit, wo: Vec3, wi: Vec3) -> f32 {
    let (wo_g, wo_s) = (wo.dot(hit.ng), wo.dot(hit.ns));
    let (wi_g, wi_s) = (wi.dot(hit.ng), wi.dot(hit.ns));
    if wo_g * wo_s <= 0.0 || wi_g * wi_s <= 0.0 {
        return 0.0;
    }
    ((wo_s * wi_g) / (wo_g * wi_s)).abs()
}
