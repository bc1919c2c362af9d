//! What a plan needs from the engine that renders its passes. Pilots try plans through it, without knowing which engine
//! it is.

use super::RenderPlan;
use crate::world::Scene;
use beamfarm_image::film::Film;
use beamfarm_image::job::PassStats;
use beamfarm_image::matte::Matte;
use std::fmt;
use std::ops::AddAssign;

/// Renders passes.
pub trait Engine: Sync {
    /// What the photons of a pass leave for the camera to find.
    type Photons: Send + Sync;

    /// Renders a whole pass. If things move, each pass sees them at its own moment.
    fn pass(&self, scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Result<PassImage, NoPass>;

    /// Trace the photons of a pass.
    fn photons(&self, scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Self::Photons;

    /// The picture that the camera of a pass makes of photons, which may be those of another pass.
    fn picture(
        &self,
        photons: &Self::Photons,
        scene: &Scene,
        plan: &RenderPlan,
        pass_index: u64,
    ) -> Result<PassImage, NoPass>;
}

/// The result of a pass.
#[derive(Clone, Debug)]
pub struct PassImage {
    /// Radiance.
    pub film: Film,
    /// The plan's layers, in its order.
    pub layers: Vec<Film>,
    /// The mattes among the layers.
    pub mattes: Vec<Matte>,
    /// The factor on kernel radii in this pass.
    pub radius_scale: f64,
    /// Counters.
    pub stats: PassStats,
    /// Number of photon rays.
    pub photon_rays: u64,
    /// Work of the camera's paths.
    pub camera: CameraWork,
}

impl PassImage {
    /// Stands for a picture on which nothing depends any more.
    pub(super) fn black(scene: &Scene) -> Self {
        let camera = &scene.description().camera;
        Self {
            film: Film::new(camera.width, camera.height),
            layers: Vec::new(),
            mattes: Vec::new(),
            radius_scale: 1.0,
            stats: PassStats::default(),
            photon_rays: 0,
            camera: CameraWork::default(),
        }
    }
}

/// Why a pass has no picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoPass {
    /// Its scene was interrupted.
    Interrupted,
    /// Things move, and the scene of the pass's moment cannot be made; says why.
    NoMoment(String),
}

impl fmt::Display for NoPass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Interrupted => f.write_str("the pass was interrupted"),
            Self::NoMoment(why) => f.write_str(why),
        }
    }
}

impl std::error::Error for NoPass {}

/// Counted work of camera paths.
#[derive(Clone, Copy, Debug, Default)]
pub struct CameraWork {
    /// Rays traced.
    pub rays: u64,
    /// Pairs of beam and segment that contributed.
    pub evaluations: u64,
    /// Blocks of segments that looked for beams together.
    pub blocks: u64,
}

impl AddAssign for CameraWork {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.evaluations += other.evaluations;
        self.blocks += other.blocks;
    }
}
