//! Scenes one after the other that have files in common.

use crate::assemble::{Kept, Purpose};
use crate::error::SceneError;
use crate::files::{Files, Source};
use beamfarm_render::world::SceneDescription;
use glam::DVec3;

/// What was decoded for scenes, kept by content, so that a scene of the same files is loaded without decoding them
/// again. What the last few scenes had no use for is dropped.
#[derive(Default)]
pub struct Store {
    kept: Kept,
}

impl Store {
    /// The description that [`load`](crate::load) gives, or its error. Meshes that nothing has changed of are the very
    /// same ones as in the last descriptions, by which
    /// [`Scene::new_like`](beamfarm_render::world::Scene::new_like) knows them.
    pub fn load(&mut self, files: &Files) -> Result<SceneDescription, SceneError> {
        self.assembled(files, Purpose::Exact, None)
    }

    /// The scene for looking around: render space has its origin at a point of the world, wherever the camera stands,
    /// and meshes are put at their places without being made for them. Scenes with one `origin` share all but what
    /// differs. Single precision is finest near the origin; what is far from it is rendered less exactly than by
    /// [`Self::load`], and no bits are the same.
    pub fn sketch(&mut self, files: &Files, origin: [f64; 3]) -> Result<SceneDescription, SceneError> {
        self.assembled(files, Purpose::Sketch, Some(DVec3::from(origin)))
    }

    fn assembled(
        &mut self,
        files: &Files,
        purpose: Purpose,
        origin: Option<DVec3>,
    ) -> Result<SceneDescription, SceneError> {
        self.kept.begin(purpose);
        let assembled = crate::assembled(Source::Files(files), &mut self.kept, origin);
        match &assembled {
            Ok(_) => self.kept.tidy(),
            Err(_) => self.kept.forget(),
        }
        assembled.map(|(description, _)| description)
    }
}

impl std::fmt::Debug for Store {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Store")
    }
}
