//! Files as they are read from the disk.

use crate::error::SceneError;
use beamfarm_image::bundle;
use std::path::Path;

/// The text of a scene file.
pub fn text_of<'a>(file: &Path, bytes: &'a [u8]) -> Result<&'a str, SceneError> {
    std::str::from_utf8(bytes).map_err(|e| SceneError {
        file: file.to_path_buf(),
        line: Some(beamfarm_assets::line_of(bytes, e.valid_up_to())),
        message: "the scene file is not UTF-8 text".to_string(),
    })
}

/// A file of at most `room` bytes.
pub fn read_file(path: &Path, room: u64) -> Result<Vec<u8>, String> {
    // A device or a pipe might never end.
    match std::fs::metadata(path) {
        Ok(metadata) if !metadata.is_file() => Err("not a file".to_string()),
        Ok(metadata) if metadata.len() > room => Err(format!(
            "with it the scene's files take more than {} bytes",
            bundle::MAX_BYTES
        )),
        Ok(_) => std::fs::read(path).map_err(|e| e.to_string()),
        Err(e) => Err(e.to_string()),
    }
}
