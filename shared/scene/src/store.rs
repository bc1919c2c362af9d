//! Scenes one after the other that have files in common.

use crate::assemble::{Extents, Kept, Purpose, Space};
use crate::error::SceneError;
use crate::files::{Files, Source};
use crate::made::{self, Made, motion, snapshot};
use crate::time::When;
use beamfarm_render::world::{Motion, SceneDescription};
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
        self.load_with_extents(files).map(|(description, _)| description)
    }

    pub(crate) fn load_with_extents(&mut self, files: &Files) -> Result<(SceneDescription, Extents), SceneError> {
        let snapshot = snapshot(Source::Files(files), When::Middle)?;
        let made = self.made(files, When::Middle, Purpose::Exact, Space::AtCamera)?;
        let (mut description, extents) = (made.description, made.extents);
        if let Some(blurs) = motion(Source::Files(files), &snapshot) {
            let space = Space::Of(made.render_origin);
            let shutter = match blurs {
                true => snapshot.clock.open(),
                false => [snapshot.clock.time(When::Middle); 2],
            };
            // What is wrong when it opens or closes is told before anything is rendered.
            if blurs {
                for time in shutter {
                    self.made(files, When::At(time), Purpose::Exact, space)?;
                }
            }
            // Passes that are rendered at the same time have nothing to wait for.
            let (kept, files) = (self.kept.clone(), files.clone());
            let at = move |time| {
                let mut store = Self { kept: kept.clone() };
                let made = store.made(&files, When::At(time), Purpose::Exact, space);
                made.map(|made| made.description).map_err(|error| error.to_string())
            };
            description.motion = Some(Motion::new(shutter, at));
        }
        Ok((description, extents))
    }

    /// The scene for looking around: render space has its origin at a point of the world, wherever the camera stands,
    /// and meshes are put at their places without being made for them. Scenes with one `origin` share all but what
    /// differs. Single precision is finest near the origin; what is far from it is rendered less exactly than by
    /// [`Self::load`], and no bits are the same. Of what moves it is the middle of the exposure.
    pub fn sketch(&mut self, files: &Files, origin: [f64; 3]) -> Result<SceneDescription, SceneError> {
        let space = Space::Sketched(DVec3::from(origin));
        let made = self.made(files, When::Middle, Purpose::Sketch, space);
        made.map(|made| made.description)
    }

    fn made(&mut self, files: &Files, when: When, purpose: Purpose, space: Space) -> Result<Made, SceneError> {
        let source = Source::Files(files);
        let snapshot = snapshot(source, when)?;
        self.kept.begin(purpose);
        let made = made::assembled(source, &snapshot, &mut self.kept, space);
        match &made {
            Ok(_) => self.kept.tidy(),
            Err(_) => self.kept.forget(),
        }
        made
    }
}

impl std::fmt::Debug for Store {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Store")
    }
}
