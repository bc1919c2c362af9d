//! Successive scenes that share files.

use crate::assemble::{Extents, Kept, Purpose, Space};
use crate::error::SceneError;
use crate::files::{Files, Source};
use crate::made::{self, Made, motion, snapshot};
use crate::time::When;
use beamfarm_render::world::{Motion, SceneDescription};
use glam::DVec3;

/// Decoded assets by content, so that later scenes with the same files load without decoding them again. What the last
/// few scenes did not use is dropped.
#[derive(Default)]
pub struct Store {
    kept: Kept,
}

impl Store {
    /// The description that [`load`](crate::load) gives, or its error. Unchanged meshes are shared with earlier
    /// descriptions, so that [`Scene::new_like`](beamfarm_render::world::Scene::new_like) recognises them.
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
            // Faults at the shutter's opening or closing are reported before rendering starts.
            if blurs {
                for time in shutter {
                    self.made(files, When::At(time), Purpose::Exact, space)?;
                }
            }
            // A clone per moment, so that passes rendered in parallel do not wait for each other.
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

    /// The scene for interactive viewing. Render space has its origin at a fixed world point, wherever the camera is,
    /// and meshes are placed without being baked. Scenes with the same `origin` share everything except their
    /// differences. Single precision is finest near the origin; distant things are rendered less exactly than with
    /// [`Self::load`], and the bits differ. Moving things stand at the middle of the exposure.
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
