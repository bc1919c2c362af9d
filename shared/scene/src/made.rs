//! Builds a scene from its files at one moment.

use crate::assemble::{self, Assembled, Extents, Kept, Problem, Space};
use crate::assets::gltf;
use crate::disk::text_of;
use crate::error::SceneError;
use crate::files::Source;
use crate::parse::{Fault, SceneRecord, Snapshot};
use crate::source;
use crate::time::When;
use crate::values::Spanned;
use beamfarm_image::bundle;
use beamfarm_render::world::SceneDescription;
use glam::DVec3;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A source's scene file at a moment.
pub fn snapshot(source: Source<'_>, when: When) -> Result<Snapshot, SceneError> {
    let (file, text) = scene_file(source)?;
    SceneRecord::snapshot(text, when).map_err(|fault| source::locate(file, text, &fault))
}

/// `None` if nothing moves; otherwise whether anything changes while the shutter is open.
pub fn motion(source: Source<'_>, snapshot: &Snapshot) -> Option<bool> {
    let [open, close] = snapshot.clock.open();
    let plays = |file: &Spanned<String>| {
        let bytes = source.bytes(&bundle::key(file.get_ref()));
        bytes.is_some_and(gltf::is_animated)
    };
    let plays = snapshot.clock.is_given() && snapshot.record.gltf_files().any(plays);
    let moves = plays || !snapshot.moving.is_empty();
    moves.then_some(snapshot.blurs || plays && open != close)
}

pub fn scene_file(source: Source<'_>) -> Result<(&Path, &str), SceneError> {
    let file = Path::new(source.scene());
    let bytes = source.bytes(source.scene()).ok_or_else(|| SceneError {
        file: file.to_path_buf(),
        line: None,
        message: "the bundle lacks its scene file".to_string(),
    })?;
    Ok((file, text_of(file, bytes)?))
}

/// A scene that has been built.
pub struct Made {
    pub description: SceneDescription,
    pub extents: Extents,
    /// World position of the origin of render space.
    pub render_origin: DVec3,
}

/// `snapshot`: the source's scene file.
pub fn assembled(source: Source<'_>, snapshot: &Snapshot, kept: &mut Kept, space: Space) -> Result<Made, SceneError> {
    let (file, text) = scene_file(source)?;
    let assembled =
        assemble::assemble(snapshot, source, kept, space).map_err(|problem| located(file, text, problem))?;
    let Assembled {
        mut description,
        notes,
        photon_places,
        extents,
        render_origin,
    } = assembled;
    let note = |fault: &Fault| source::locate(file, text, fault).to_string();
    let notes = notes
        .into_iter()
        .map(|problem| located(file, text, problem).to_string());
    description.notes = notes.collect();
    let rule = |place: &Range<usize>| note(&Fault::new(place.clone(), "photons obey this"));
    description.photon_rules = photon_places.iter().map(rule).collect();
    Ok(Made {
        description,
        extents,
        render_origin,
    })
}

/// What keeps a scene from being built, with its location.
pub fn located(file: &Path, text: &str, problem: Problem) -> SceneError {
    match problem {
        Problem::Scene(fault) => source::locate(file, text, &fault),
        Problem::NoArea(place) => source::locate(file, text, &Fault::new(place, "the mesh has no area")),
        Problem::Asset { file, flaw } => SceneError {
            file: PathBuf::from(file),
            line: flaw.line,
            message: flaw.message,
        },
    }
}
