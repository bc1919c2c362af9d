//! The scene: read from TOML, validated, then immutable.

use crate::bsdf::Material;
use crate::camera::Camera;
use crate::geometry::Object;
use crate::job::ScheduleKind;
use crate::light::{Light, SceneBounds};
use crate::medium::{Homogeneous, MediumId};

/// Everything that a pass renders. Lengths in scene units; render space is world space moved so that the camera stands at
/// the origin, which keeps single precision where it is needed.
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
    /// Media.
    pub media: Vec<Homogeneous>,
    /// Lights; those of emitting objects among them.
    pub lights: Vec<Light>,
    /// A sphere around all objects, positioned lights, and the camera.
    pub bounds: SceneBounds,
    /// Defaults for the job.
    pub defaults: RenderDefaults,
}

/// What the scene file says about rendering; the command line overrides it.
#[derive(Clone, Copy, Debug)]
pub struct RenderDefaults {
    /// Passes.
    pub passes: u64,
    /// Photon paths per pass.
    pub paths_per_pass: u32,
    /// Trade of variance against bias, in (0, 1).
    pub alpha: f64,
    /// Radius schedule.
    pub schedule: ScheduleKind,
    /// Seed.
    pub seed: u64,
    /// Stops of exposure of the PNG.
    pub exposure: f32,
    /// Fixed base radius of beams and surface photons in scene units, in place of photon differentials.
    pub radius: Option<f32>,
}

impl SceneDescription {
    /// Read, parse and validate the scene of a bundle.
    pub fn load(bundle: &crate::bundle::Bundle) -> Result<Self, crate::error::SceneError> {
        let _ = bundle;
        unimplemented!()
    }
}

/// Read a scene file and every asset that it names into a bundle.
pub fn read_bundle(
    path: &std::path::Path,
) -> Result<crate::bundle::Bundle, crate::error::SceneError> {
    let _ = path;
    unimplemented!()
}
