//! The scene of a bundle, whether it moves or not.

use crate::assemble::{Extents, Kept, Space};
use crate::error::SceneError;
use crate::files::{Files, Source};
use crate::made::{assembled, motion, snapshot};
use crate::store::Store;
use crate::time::When;
use beamfarm_image::bundle::Bundle;
use beamfarm_render::world::SceneDescription;

/// Parse and validate the scene of a bundle. Errors name files as the bundle does: relative to the scene's folder.
pub fn load(bundle: &Bundle) -> Result<SceneDescription, SceneError> {
    load_with_extents(bundle).map(|(description, _)| description)
}

/// The same, and where its shapes and volumes are.
pub fn load_with_extents(bundle: &Bundle) -> Result<(SceneDescription, Extents), SceneError> {
    let source = Source::Bundle(bundle);
    let snapshot = snapshot(source, When::Middle)?;
    match motion(source, &snapshot).is_some() {
        // Its other moments have most of it in common.
        true => Store::default().load_with_extents(&Files::from(bundle.clone())),
        false => {
            let made = assembled(source, &snapshot, &mut Kept::default(), Space::AtCamera)?;
            Ok((made.description, made.extents))
        }
    }
}
