//! From lights to photon beams and surface photons.
//!
//! A photon path goes from a light through media and off surfaces, until Russian roulette ends it or nothing it could
//! still leave would count. Its segments in scattering media leave [`PhotonBeam`]s, and its hits on surfaces that are
//! not specular leave [`SurfacePhoton`]s, where the table in `transport` assigns that light to photons.

mod flight;
mod start;
mod surface;

use super::PhotonBeam;
use super::walls::{End, Plane};
use crate::cpu::photon_map::{Arrival, SurfacePhoton};
use crate::math::{Ray, Rgb, mean};
use crate::parallel;
use crate::plan::RenderPlan;
use crate::plan::aov::GroupNumber;
use crate::plan::footprint::Footprint;
use crate::plan::weights::{FoundBy, Weights};
use crate::roulette;
use crate::sampler::{Purpose, Sampler};
use crate::world::Scene;
use crate::world::light::LightPoint;
use crate::world::mask::{Ruled, Unruled, VisibilityMask};
use crate::world::medium::MediumId;
use crate::world::medium::transmittance::StepFunctions;
use crate::world::spectrum::{Wave, WaveSet};
use beamfarm_image::job::{JobSettings, ScheduleKind};
use beamfarm_image::radius::Schedule;
use std::ops::Range;

/// Everything that the photon paths of a pass leave behind.
#[derive(Debug, Default)]
pub struct Photons {
    /// Beams, in the order of paths, without the smooth ones.
    pub beams: Vec<PhotonBeam>,
    /// Beams of scattered light. Their kernels are wide, so camera segments share what they gather.
    pub smooth_beams: Vec<PhotonBeam>,
    /// Transmittance along `beams` in heterogeneous media.
    pub steps: StepFunctions,
    /// The same along `smooth_beams`.
    pub smooth_steps: StepFunctions,
    /// Walls near `beams`.
    pub walls: Vec<Plane>,
    /// Walls near `smooth_beams`.
    pub smooth_walls: Vec<Plane>,
    /// Surface photons, in the order of paths.
    pub surface: Vec<SurfacePhoton>,
    /// Rays traced for them.
    pub rays: u64,
    /// How many of these rays met a surface, or were scattered in a medium.
    pub met: u64,
}

impl Photons {
    /// Those of all tasks, in the order of the tasks.
    fn joined(chunks: Vec<Self>) -> Self {
        let mut joined = Self {
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
}

/// Paths that one task traces. The photons do not depend on it.
const CHUNK: u32 = 256;
/// Paths between a task's checks for an interruption.
const BETWEEN_LOOKS: u32 = 16;

/// Trace the photon paths of a pass.
pub fn trace_photons(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Photons {
    trace_paths(scene, plan, pass_index, 0..plan.surface_paths)
}

/// Trace some of them. Paths below `paths_per_pass` leave beams as well.
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
        // Kernels are sized for the paths that leave beams.
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
    Photons::joined(chunks)
}

/// Number of paths whose footprints set the kernels' width. Fewer paths per pass mean more passes, so this is chosen
/// for kernels to be equally wide after equally many paths in all. Their area goes as one over this number, and over
/// passes as N^(alpha - 1).
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
    /// All paths.
    paths: f32,
    beam_paths: f32,
    /// Paths that kernels are sized for.
    kernel_paths: f32,
    surface_footprint: f32,
    /// Photons go on beyond the surfaces and media that paths do not follow: what they leave there may count.
    goes_on: bool,
    weights: Weights,
    /// If some surface disperses light.
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
    /// Set once it has met a dispersive surface. The power does not contain its weight.
    wave: Option<Wave>,
    medium: MediumId,
    footprint: Footprint,
    /// The surface that the ray starts on, if it does.
    starts_on: Option<End>,
    arrival: Arrival,
    /// Which technique finds the light that it leaves at the next surface.
    found_by: FoundBy,
    /// The same for the caustics that it brings.
    caustic_by: FoundBy,
    /// Length of its way since it was last scattered.
    flown: f32,
    /// Where on the light it started. For lights without a surface: the direction back.
    emitted_at: LightPoint,
    /// No surface or medium has scattered it widely.
    is_pure: bool,
    /// No surface or medium has scattered it at all: it was only reflected and refracted.
    is_sharp: bool,
    /// Its light, and that light's group.
    light: usize,
    group: Option<GroupNumber>,
    depth: u32,
    /// The least that it has been worth for its position.
    worth: f32,
    leaves_beams: bool,
}

impl<V: VisibilityMask> Tracer<'_, V> {
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

    /// Whether photons bring the caustics of this one's light, alone or shared with camera paths.
    fn brings_caustics(&self, photon: &Photon<V::Hidden>) -> bool {
        self.plan.estimators.brings_photons(photon.light)
    }
}

impl<H> Photon<H> {
    /// Russian roulette: a survivor has the flux that it had before the scattering, as far as probabilities allow.
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
