//! The frames of a scene.

use crate::assemble;
use crate::disk::{read_file, text_of};
use crate::error::SceneError;
use crate::files::Source;
use crate::kinds;
use crate::lone::{self, is_gltf};
use crate::made::{scene_file, snapshot};
use crate::mitsuba::is_mitsuba;
use crate::options::ImportOptions;
use crate::reach::Reach;
use crate::scene_file::SceneFile;
use crate::source::{self, Fault};
use crate::time::{self, When};
use beamfarm_image::bundle;
use beamfarm_render::world::RenderDefaults;
use std::path::Path;
use toml::de::DeTable;

/// A file name with its last run of `#` replaced by the frame number, padded to at least as many digits.
pub fn numbered(name: &str, frame: i64) -> String {
    time::numbered(name, frame)
}

/// The first and last frame of a scene file, from its `animation.frames` or the animations of a glTF file; `None` if it
/// has no frames. Nothing else of the scene is read.
pub fn frames(path: &Path, options: &ImportOptions) -> Result<Option<[i64; 2]>, SceneError> {
    if is_mitsuba(path) {
        return Ok(None);
    }
    let unreadable = |message: String| SceneError {
        file: path.to_path_buf(),
        line: None,
        message,
    };
    if let Some(refusal) = kinds::refusal(path) {
        return Err(unreadable(refusal));
    }
    let text = match is_gltf(path) {
        true => {
            let reach = Reach::new(path, &options.allow_outside);
            let folder = path.parent().unwrap_or(Path::new(""));
            lone::scene(path, folder, &reach)?.text.into_bytes()
        }
        false => read_file(path, bundle::MAX_BYTES).map_err(unreadable)?,
    };
    let text = text_of(path, &text)?;
    let edited = options.edits.apply(path, text)?;
    let text = edited.as_deref().unwrap_or(text);
    let found = DeTable::parse(text).map_err(Fault::from);
    let found = found.and_then(|root| time::frames(root.get_ref()));
    found.map_err(|fault| source::locate(path, text, &fault))
}

impl SceneFile {
    /// The scene file's job defaults; reads no assets.
    pub fn defaults(&self) -> Result<RenderDefaults, SceneError> {
        let source = Source::Bundle(&self.bundle);
        let snapshot = snapshot(source, When::Middle)?;
        let (file, text) = scene_file(source)?;
        assemble::defaults(&snapshot.record.render).map_err(|fault| source::locate(file, text, &fault))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_says_its_frames() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let of = |text: &str| {
            std::fs::write(&path, text).unwrap();
            frames(&path, &ImportOptions::default())
        };
        assert_eq!(of("[animation]\nframes = [3, 48]\n").unwrap(), Some([3, 48]));
        assert_eq!(of("[camera]\nfov = 3\n").unwrap(), None);
        let said = of("[camera]\n[animation]\nframes = [3, 2]\n").unwrap_err();
        assert_eq!(said.line, Some(3));
        assert!(
            said.message.contains("animation.frames: expected the first frame"),
            "{said}"
        );
    }
}
