//! What a scene is before any structure is built over it: what a scene file, or a program, hands to the renderer.

use crate::world::bsdf::Material;
use crate::world::camera::Camera;
use crate::world::geometry::Object;
use crate::world::interrupt::Interrupt;
use crate::world::light::{Light, SceneBounds};
use crate::world::medium::{Medium, MediumId};
use crate::world::rules::Rules;
use beamfarm_image::exr::Names;
use beamfarm_image::job::{EngineChoice, EngineKind, JobSettings, ScheduleKind, Targeting, Techniques};
use beamfarm_image::view::View;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

/// Everything that a pass renders. Lengths in scene units; render space is world space moved so that the camera stands
/// at the origin, which keeps single precision where it is needed, or near it, where a camera moves about.
#[derive(Clone, Debug)]
pub struct SceneDescription {
    /// The camera.
    pub camera: Camera,
    /// Medium that the scene names for the camera, if it does.
    pub camera_medium: Option<MediumId>,
    /// Medium outside of every object.
    pub world_medium: MediumId,
    /// Objects.
    pub objects: Vec<Object>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Names of those that the scene file names, by their numbers.
    pub material_names: BTreeMap<u32, String>,
    /// Media.
    pub media: Vec<Medium>,
    /// What the scene file calls them.
    pub media_names: Vec<String>,
    /// Lights; those of emitting objects among them.
    pub lights: Vec<Light>,
    /// A sphere around all objects, positioned lights, and the camera.
    pub bounds: SceneBounds,
    /// Defaults for the job.
    pub defaults: RenderDefaults,
    /// Object visibility rules, if any has an effect.
    pub rules: Option<Rules>,
    /// What the scene says to no effect, each with its file and line.
    pub notes: Vec<String>,
    /// File, line and field of each rule that photons obey.
    pub photon_rules: Vec<String>,
    /// What moves, if something does. All is as it is in the middle of the time that the shutter is open.
    pub motion: Option<Motion>,
    /// Scenes like it follow, as frames do or moments of an exposure, in which some of its meshes stand still: large
    /// ones have hierarchies of their own, which are built once for all of them.
    pub has_frames: bool,
    /// Stops what is done with the scene, and with clones of this description.
    pub interrupt: Interrupt,
}

/// A scene at all moments of an exposure. Every pass has one of them, at which everything stands still. Where the
/// shutter is open for no time that is all the same, and only vectors of motion tell of what moves.
#[derive(Clone)]
pub struct Motion {
    /// When the shutter opens and closes, frames.
    shutter: [f64; 2],
    at: Arc<At>,
}

/// The description at a time, in frames, in the same render space.
type At = dyn Fn(f64) -> Result<SceneDescription, String> + Send + Sync;

impl Motion {
    /// `at`: the description at a time within the shutter's or beside them, without motion and in the same render
    /// space.
    pub fn new(
        shutter: [f64; 2],
        at: impl Fn(f64) -> Result<SceneDescription, String> + Send + Sync + 'static,
    ) -> Self {
        Self {
            shutter,
            at: Arc::new(at),
        }
    }

    /// Whether the shutter is open for any time.
    pub fn blurs(&self) -> bool {
        self.shutter[0] != self.shutter[1]
    }

    /// When the shutter opens and closes, frames.
    pub fn shutter(&self) -> [f64; 2] {
        self.shutter
    }

    /// The scene at a time within the shutter's, or why there is none.
    pub fn at(&self, time: f64) -> Result<SceneDescription, String> {
        (self.at)(time)
    }
}

impl fmt::Debug for Motion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Motion({:?})", self.shutter)
    }
}

/// What a material without a name is called.
const NO_NAME: &str = "default";

impl SceneDescription {
    /// What a material is called.
    pub fn material_name(&self, material: u32) -> &str {
        self.material_names.get(&material).map_or(NO_NAME, String::as_str)
    }

    /// Names of all that mattes may tell apart.
    pub fn names(&self) -> Names {
        Names {
            objects: self.objects.iter().map(|object| object.name.clone()).collect(),
            materials: (0..self.materials.len() as u32)
                .map(|material| self.material_name(material).to_owned())
                .collect(),
        }
    }
}

/// What the scene file says about rendering; the command line overrides it.
#[derive(Clone, Copy, Debug)]
pub struct RenderDefaults {
    /// Passes.
    pub passes: u64,
    /// Photon paths per pass. `None`: as many as a pilot finds best ([`crate::plan::pilot`]).
    pub paths_per_pass: Option<u32>,
    /// Trade of variance against bias, in (0, 1).
    pub alpha: f64,
    /// Radius schedule.
    pub schedule: ScheduleKind,
    /// Seed.
    pub seed: u64,
    /// How the PNG shows it.
    pub view: View,
    /// Depth that is written where nothing is; `None`: infinite.
    pub empty_depth: Option<f32>,
    /// Fixed base radius of beams and surface photons in scene units, in place of photon differentials.
    pub radius: Option<f32>,
    /// When photons are aimed at what the camera sees.
    pub targeting: Targeting,
    /// What finds scattered light. `None`: what a pilot finds best.
    pub techniques: Techniques,
    /// What renders passes, for those who have a choice.
    pub engine: EngineChoice,
}

/// Photon paths of a pass that nothing is known of; base radii are made for so many where the scene does not say.
const PATHS_PER_PASS: u32 = 50_000;

impl RenderDefaults {
    /// The settings of a job that overrides nothing, before any pilot: on processors, whatever [`Self::engine`] is.
    pub fn job_settings(&self) -> JobSettings {
        JobSettings {
            seed: self.seed,
            alpha: self.alpha,
            schedule: self.schedule,
            budget: None,
            paths_per_pass: self.paths_per_pass.unwrap_or(PATHS_PER_PASS),
            reference_paths: self.paths_per_pass.unwrap_or(PATHS_PER_PASS),
            techniques: self.techniques,
            engine: EngineKind::Cpu,
        }
    }
}

impl Default for RenderDefaults {
    fn default() -> Self {
        Self {
            passes: 64,
            paths_per_pass: None,
            alpha: 2.0 / 3.0,
            schedule: ScheduleKind::Pass,
            seed: 0,
            view: View::default(),
            empty_depth: None,
            radius: None,
            targeting: Targeting::Auto,
            techniques: Techniques::default(),
            engine: EngineChoice::Is(EngineKind::Cpu),
        }
    }
}
