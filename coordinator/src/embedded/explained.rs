//! What a pass of a scene does, and why.

use super::wait::State;
use super::{Asked, Failure, Notes};
use crate::explain;
use crate::loaded::Choosing;
use beamfarm_image::job::JobSettings;
use beamfarm_scene::{Extent, SceneFile};
use beamfarm_worker::engine::Where;

/// The plan of a scene.
pub struct Explained {
    /// The text that `beamfarm explain` prints.
    pub text: String,
    /// Hash of the scene and its files.
    pub scene: String,
    /// Settings of each pass.
    pub settings: JobSettings,
    /// Size of the image in pixels.
    pub size: [u32; 2],
    /// Number of passes, unless another is requested.
    pub passes: u64,
    /// Extents of the scene's objects.
    pub places: Vec<Extent>,
    /// Messages about the scene.
    pub notes: Notes,
}

/// Explain what a pass of a scene does.
pub fn explain(asked: &Asked, tell: &mut dyn FnMut(State) -> bool) -> Result<Explained, Failure> {
    let mut settings = asked.settings()?;
    // What a device cannot do is reported next to the plan.
    settings.device = None;
    let places = SceneFile::of_text(&asked.scene, &Default::default()).and_then(|file| file.extents());
    let loaded = asked.load(settings, Choosing::By(None), tell)?;
    let places = places?;
    let place = match &asked.gpu {
        Some(gpu) => Where::Here(gpu.clone()),
        None => Where::Elsewhere,
    };
    let camera = &loaded.description.camera;
    Ok(Explained {
        scene: loaded.bundle.hash().to_string(),
        settings: loaded.settings,
        size: [camera.width, camera.height],
        passes: loaded.defaults.passes,
        notes: Notes::of(&loaded),
        text: explain::text(loaded, &places, &place)?,
        places,
    })
}
