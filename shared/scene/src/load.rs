//! Loads the scene of a bundle, moving or not.

use crate::assemble::{Extents, Kept, Space};
use crate::error::SceneError;
use crate::files::{Files, Source};
use crate::made::{assembled, motion, snapshot};
use crate::store::Store;
use crate::time::When;
use beamfarm_image::bundle::Bundle;
use beamfarm_render::world::SceneDescription;

/// Parse and validate the scene of a bundle. Errors name files like the bundle does: relative to the scene's folder.
pub fn load(bundle: &Bundle) -> Result<SceneDescription, SceneError> {
    load_with_extents(bundle).map(|(description, _)| description)
}

/// [`load`], with the extents of its shapes and volumes.
pub fn load_with_extents(bundle: &Bundle) -> Result<(SceneDescription, Extents), SceneError> {
    let source = Source::Bundle(bundle);
    let snapshot = snapshot(source, When::Middle)?;
    match motion(source, &snapshot).is_some() {
        // Its other moments share most of it.
        true => Store::default().load_with_extents(&Files::from(bundle.clone())),
        false => {
            let made = assembled(source, &snapshot, &mut Kept::default(), Space::AtCamera)?;
            Ok((made.description, made.extents))
        }
    }
}
