//! What a plan asks of the engine that renders its passes: pilots try plans by it, without knowing which one it is.

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

    /// A whole pass. Where things move it sees them at a moment of its own.
    fn pass(&self, scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Result<PassImage, NoPass>;

    /// Trace the photons of a pass.
    fn photons(&self, scene: &Scene, plan: &RenderPlan, pass_index: u64) -> Self::Photons;

    /// The picture that the camera of a pass makes of them, which may be those of another pass.
    fn picture(
        &self,
        photons: &Self::Photons,
        scene: &Scene,
        plan: &RenderPlan,
        pass_index: u64,
    ) -> Result<PassImage, NoPass>;
}

/// What a pass returns.
#[derive(Clone, Debug)]
pub struct PassImage {
    /// Radiance.
    pub film: Film,
    /// What the plan has beside it, in its order.
    pub layers: Vec<Film>,
    /// The mattes among them.
    pub mattes: Vec<Matte>,
    /// What kernel radii of the pass were scaled by.
    pub radius_scale: f64,
    /// Counters.
    pub stats: PassStats,
    /// Rays of photons.
    pub photon_rays: u64,
    /// What the camera's paths took.
    pub camera: CameraWork,
}

impl PassImage {
    /// In place of a picture, where nothing depends on it any more.
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
    /// Its scene was interrupted meanwhile.
    Interrupted,
    /// Things move, and cannot be as they should at the moment of the pass: what is wrong with them.
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

/// What camera paths take, counted.
#[derive(Clone, Copy, Debug, Default)]
pub struct CameraWork {
    /// Rays traced.
    pub rays: u64,
    /// Pairs of beam and segment that contributed.
    pub evaluations: u64,
    /// Blocks of segments for which beams were looked for together.
    pub blocks: u64,
}

impl AddAssign for CameraWork {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.evaluations += other.evaluations;
        self.blocks += other.blocks;
    }
}
