//! Sketches on disk, which cannot be mistaken for averages.

use super::denoised::write_film;
use super::header::text;
use crate::error::ImageError;
use crate::film::Film;
use crate::job::SceneHash;
use std::path::Path;

/// A sketch's metadata.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SketchMeta {
    /// How coarse it is, in words.
    pub sketch: String,
    /// The scene.
    pub scene: SceneHash,
    /// [`ImageMeta::scene_file`](super::ImageMeta::scene_file).
    pub scene_file: Option<String>,
    /// Version of the program.
    pub version: String,
}

/// Write a sketch: R, G, B, float32, lossless ZIP. Its attribute `beamfarmSketch` marks it as one, and it has no
/// passes.
pub fn write_sketch(path: &Path, film: &Film, meta: &SketchMeta) -> Result<(), ImageError> {
    let mut own = vec![
        ("beamfarmSketch", text("sketch", &meta.sketch)?),
        ("beamfarmScene", text("scene", &meta.scene.to_string())?),
        ("beamfarmVersion", text("version", &meta.version)?),
    ];
    if let Some(file) = &meta.scene_file {
        own.push(("beamfarmSceneFile", text("scene file", file)?));
    }
    write_film(path, film, &meta.version, own)
}
