//! The scene before any structure is built over it, as a scene file or a program hands it to the renderer.

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

/// Everything that a pass renders. Lengths in scene units. Render space is world space moved so that the camera stands
/// at the origin, or near it if the camera moves, where single precision is best.
#[derive(Clone, Debug)]
pub struct SceneDescription {
    /// The camera.
    pub camera: Camera,
    /// The camera's medium, if the scene names one.
    pub camera_medium: Option<MediumId>,
    /// Medium outside of every object.
    pub world_medium: MediumId,
    /// Objects.
    pub objects: Vec<Object>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Names of the materials that the scene file names, by number.
    pub material_names: BTreeMap<u32, String>,
    /// Media.
    pub media: Vec<Medium>,
    /// Names of the media in the scene file.
    pub media_names: Vec<String>,
    /// Lights, including those of emitting objects.
    pub lights: Vec<Light>,
    /// A sphere around all objects, lights with a position, and the camera.
    pub bounds: SceneBounds,
    /// Defaults for the job.
    pub defaults: RenderDefaults,
    /// Object visibility rules, if any has an effect.
    pub rules: Option<Rules>,
    /// Statements of the scene that have no effect, each with its file and line.
    pub notes: Vec<String>,
    /// File, line and field of each rule that photons obey.
    pub photon_rules: Vec<String>,
    /// Motion, if anything moves. The rest of the description is at the middle of the exposure.
    pub motion: Option<Motion>,
    /// Similar scenes follow, such as frames or moments of an exposure, in which some meshes stand still. Large meshes
    /// then get their own hierarchies, which are built once for all the scenes.
    pub has_frames: bool,
    /// Stops all work on the scene and on clones of this description.
    pub interrupt: Interrupt,
}

/// A scene at all moments of an exposure. Each pass renders one moment, at which everything stands still. With a zero
/// exposure all moments are the same, and only motion vectors show what moves.
#[derive(Clone)]
pub struct Motion {
    /// When the shutter opens and closes, frames.
    shutter: [f64; 2],
    at: Arc<At>,
}

/// The description at a time, in frames, in the same render space.
type At = dyn Fn(f64) -> Result<SceneDescription, String> + Send + Sync;

impl Motion {
    /// `at`: the description at a time within the exposure or next to it, without motion and in the same render space.
    pub fn new(
        shutter: [f64; 2],
        at: impl Fn(f64) -> Result<SceneDescription, String> + Send + Sync + 'static,
    ) -> Self {
        Self {
            shutter,
            at: Arc::new(at),
        }
    }

    /// Whether the exposure is longer than zero.
    pub fn blurs(&self) -> bool {
        self.shutter[0] != self.shutter[1]
    }

    /// When the shutter opens and closes, frames.
    pub fn shutter(&self) -> [f64; 2] {
        self.shutter
    }

    /// The scene at a time within the exposure, or an error.
    pub fn at(&self, time: f64) -> Result<SceneDescription, String> {
        (self.at)(time)
    }
}

impl fmt::Debug for Motion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Motion({:?})", self.shutter)
    }
}

/// Name of materials without one.
const NO_NAME: &str = "default";

impl SceneDescription {
    /// A material's name.
    pub fn material_name(&self, material: u32) -> &str {
        self.material_names.get(&material).map_or(NO_NAME, String::as_str)
    }

    /// Names of everything that mattes can separate.
    pub fn names(&self) -> Names {
        Names {
            objects: self.objects.iter().map(|object| object.name.clone()).collect(),
            materials: (0..self.materials.len() as u32)
                .map(|material| self.material_name(material).to_owned())
                .collect(),
        }
    }
}

/// The scene file's render settings; the command line overrides them.
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
    /// Display transform of the PNG.
    pub view: View,
    /// Depth of empty pixels; `None`: infinite.
    pub empty_depth: Option<f32>,
    /// Fixed base radius of beams and surface photons, scene units, instead of photon differentials.
    pub radius: Option<f32>,
    /// When photons are aimed at what the camera sees.
    pub targeting: Targeting,
    /// Techniques that find scattered light. `None`: those that a pilot finds best.
    pub techniques: Techniques,
    /// What renders passes, if there is a choice.
    pub engine: EngineChoice,
}

/// Photon paths per pass before anything is known; base radii assume this many where the scene sets none.
const PATHS_PER_PASS: u32 = 50_000;

impl RenderDefaults {
    /// Job settings without overrides, before any pilot; on processors, whatever [`Self::engine`] is.
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
