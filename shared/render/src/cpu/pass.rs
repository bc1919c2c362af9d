//! One pass: a pure function of the scene, the plan and the pass index.

mod tiles;

use crate::cpu::beam::estimate::Vectors;
use crate::cpu::beam::store::{Beams, Traced};
use crate::cpu::beam::trace::{Photons, trace_photons};
use crate::cpu::flow::Flow;
use crate::cpu::photon_map::SurfacePhotonMap;
use crate::cpu::transport::CameraTracer;
use crate::plan::RenderPlan;
use crate::plan::aov::Parts;
use crate::plan::engine::{Engine, NoPass, PassImage};
use crate::plan::weights::Weights;
use crate::sampler::{Purpose, mix64};
use crate::world::Scene;
use crate::world::mask::{Ruled, Unruled, VisibilityMask};
use beamfarm_image::film::Film;
use beamfarm_image::job::PassStats;
use beamfarm_image::radius::Schedule;
use tiles::{CameraPass, Picture};

/// The engine for this machine's processors, on the current rayon pool.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cpu;

impl Engine for Cpu {
    type Photons = PassPhotons;

    fn pass(&self, scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Result<PassImage, NoPass> {
        render_pass(scene, plan, pass_index)
    }

    fn photons(&self, scene: &Scene, plan: &RenderPlan, pass_index: u64) -> PassPhotons {
        PassPhotons::new(scene, plan, pass_index)
    }

    fn picture(
        &self,
        photons: &PassPhotons,
        scene: &Scene,
        plan: &RenderPlan,
        pass_index: u64,
    ) -> Result<PassImage, NoPass> {
        photons.render(scene, plan, pass_index, None)
    }
}

/// Render a pass on the current rayon pool. The bits do not depend on the pool. If things move, each pass sees them at
/// its own moment.
pub fn render_pass(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Result<PassImage, NoPass> {
    match scene.moment(plan.settings.seed, pass_index) {
        Ok(None) => at_rest(scene, scene, plan, pass_index),
        Ok(Some(moment)) => at_rest(scene, &moment, &plan.at(scene, &moment), pass_index),
        Err(why) => Err(NoPass::NoMoment(why)),
    }
}

/// `now`: the scene as the pass sees it.
fn at_rest(scene: &Scene, now: &Scene, plan: &RenderPlan, pass_index: u64) -> Result<PassImage, NoPass> {
    let flow = flow(scene, now, plan, pass_index)?;
    PassPhotons::new(now, plan, pass_index).render(now, plan, pass_index, flow.as_ref())
}

fn flow(scene: &Scene, now: &Scene, plan: &RenderPlan, pass_index: u64) -> Result<Option<Flow>, NoPass> {
    match (&scene.description().motion, plan.layers.has_motion()) {
        (Some(motion), true) => {
            let flow = Flow::new(now, motion, motion.time(plan.settings.seed, pass_index));
            Ok(Some(flow.map_err(NoPass::NoMoment)?))
        }
        _ => Ok(None),
    }
}

/// By pixel: what the camera's rays alone tell of a pass, for engines whose devices do not compute it: how things move,
/// and the number of photon targets. All other parts are empty.
///
/// # Errors
/// As for [`render_pass`].
pub fn along_rays(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Result<Vec<Parts>, NoPass> {
    let of = |now: &Scene, plan: &RenderPlan| {
        let flow = flow(scene, now, plan, pass_index)?;
        // No photons: no path is traced.
        let photons = PassPhotons::none();
        match &now.description().rules {
            None => photons
                .camera_pass(now, plan, pass_index, Unruled)
                .along_rays(flow.as_ref()),
            Some(rules) => (photons.camera_pass(now, plan, pass_index, Ruled(rules))).along_rays(flow.as_ref()),
        }
    };
    match scene.moment(plan.settings.seed, pass_index) {
        Ok(None) => of(scene, plan),
        Ok(Some(moment)) => of(&moment, &plan.at(scene, &moment)),
        Err(why) => Err(NoPass::NoMoment(why)),
    }
}

/// What the photons of a pass leave for the camera to find.
pub struct PassPhotons {
    beams: Option<Beams>,
    surface: Option<SurfacePhotonMap>,
    stats: PassStats,
    rays: u64,
}

impl PassPhotons {
    fn none() -> Self {
        Self {
            beams: None,
            surface: None,
            stats: PassStats::default(),
            rays: 0,
        }
    }

    /// Trace the photons of a pass.
    fn new(scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Self {
        let mut stats = PassStats::default();
        let photons = if plan.beams || plan.surface_photons {
            stats.paths = plan.surface_paths as u64;
            let photons = trace_photons(scene, plan, pass_index);
            match scene.is_interrupted() {
                true => Photons::default(),
                false => photons,
            }
        } else {
            Photons::default()
        };
        stats.beams = (photons.beams.len() + photons.smooth_beams.len()) as u64;
        stats.surface_photons = photons.surface.len() as u64;
        let waves = plan.wave_set(pass_index);
        let (beams, surface) = rayon::join(
            || {
                let sharp = Traced {
                    beams: photons.beams,
                    steps: photons.steps,
                    walls: photons.walls,
                };
                let smooth = Traced {
                    beams: photons.smooth_beams,
                    steps: photons.smooth_steps,
                    walls: photons.smooth_walls,
                };
                plan.beams.then(|| Beams::new(sharp, smooth, waves.as_ref()))
            },
            || plan.surface_photons.then(|| SurfacePhotonMap::new(photons.surface)),
        );
        stats.beam_bytes = beams.as_ref().map_or(0, Beams::bytes) as u64;
        Self {
            beams,
            surface,
            stats,
            rays: photons.rays,
        }
    }

    /// The picture that a pass's camera makes of these photons.
    fn render(
        &self,
        scene: &Scene,
        plan: &RenderPlan,
        pass_index: u64,
        flow: Option<&Flow>,
    ) -> Result<PassImage, NoPass> {
        match &scene.description().rules {
            None => self.picture(&CameraPass {
                flow,
                ..self.camera_pass(scene, plan, pass_index, Unruled)
            }),
            Some(rules) => self.picture(&CameraPass {
                flow,
                ..self.camera_pass(scene, plan, pass_index, Ruled(rules))
            }),
        }
    }

    fn picture<V: VisibilityMask>(&self, pass: &CameraPass<'_, V>) -> Result<PassImage, NoPass> {
        let Picture {
            film,
            layers,
            mattes,
            work,
        } = pass.render()?;
        let mut stats = self.stats;
        stats.beam_evaluations = work.evaluations;
        stats.non_finite = layers.iter().chain([&film]).map(Film::non_finite).sum();
        Ok(PassImage {
            film,
            layers,
            mattes,
            radius_scale: Schedule::new(&pass.tracer.plan.settings).scale(pass.pass_index),
            stats,
            photon_rays: self.rays,
            camera: work,
        })
    }

    fn camera_pass<'a, V: VisibilityMask>(
        &'a self,
        scene: &'a Scene,
        plan: &'a RenderPlan,
        pass_index: u64,
        mask: V,
    ) -> CameraPass<'a, V> {
        CameraPass {
            tracer: CameraTracer {
                scene,
                plan,
                photons: self.surface.as_ref(),
                weights: Weights::new(scene, plan, pass_index),
                waves: plan.wave_set(pass_index),
                mask,
            },
            beams: self.beams.as_ref(),
            flow: None,
            pass_index,
            vectors: Vectors::widest(),
            chord_key: mix64(mix64(plan.settings.seed) ^ mix64(pass_index) ^ Purpose::Chords as u64),
        }
    }
}
