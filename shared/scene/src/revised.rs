//! The files of a scene whose text is being edited.

use crate::edits::Edits;
use crate::error::SceneError;
use crate::files::{File, Files};
use crate::gather::{Authors, Naming, gather};
use crate::meaning::{self, CANONICAL_NAME};
use crate::reach::{Reach, Written};
use std::path::Path;

impl Files {
    /// The scene with another text for its scene file at `path`, and with further edits. Files already present are not
    /// read again. Others are read if `reach` allows them to whoever wrote the text. Errors name `path`.
    pub fn revised(
        &self,
        path: &Path,
        (text, written): (&str, Written),
        edits: &Edits,
        reach: &Reach,
    ) -> Result<Self, SceneError> {
        let edited = edits.apply(path, text)?;
        let text = edited.as_deref().unwrap_or(text);
        let folder = path.parent().unwrap_or(Path::new(""));
        let authors = match written {
            Written::ByUser => Authors::USER,
            Written::Elsewhere | Written::ByPage => Authors::PAGE,
        };
        let read = |naming: Naming<'_>| match self.files.get(naming.key).filter(|_| naming.key != self.scene) {
            Some(known) => Ok(known.clone()),
            None => {
                let read = reach.read(naming.path, naming.room, naming.written);
                read.map(File::new)
            }
        };
        Ok(Self {
            scene: self.scene.clone(),
            files: gather(&self.scene, File::new(text.as_bytes()), path, folder, authors, read)?,
        })
    }

    /// The files shared by all texts of the same meaning, see [`SceneFile::canonical_bundle`](crate::SceneFile).
    pub fn canonical(mut self) -> Self {
        let text = self.files.get(&self.scene);
        let text = text.and_then(|file| std::str::from_utf8(file.bytes()).ok());
        let text = text.and_then(meaning::canonical);
        let free = self.scene == CANONICAL_NAME || !self.files.contains_key(CANONICAL_NAME);
        if let Some(text) = text.filter(|_| free) {
            self.files.remove(&self.scene);
            self.scene = CANONICAL_NAME.into();
            self.files.insert(CANONICAL_NAME.into(), File::new(text.as_bytes()));
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ImportOptions, SceneFile};

    const SCENE: &str = "\
image = { width = 8, height = 6 }
camera = { origin = [0, 0, 3], target = [0, 0, 0], fov = 40 }
[[shapes]]
type = \"mesh\"
file = \"a.ply\"
";
    const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

    /// A changed text reads each file it names once, and means the same as a bundle of that text.
    #[test]
    fn a_text_is_revised() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.toml");
        std::fs::write(&path, SCENE).unwrap();
        for name in ["a.ply", "b.ply"] {
            std::fs::write(folder.path().join(name), PLY).unwrap();
        }
        let read = SceneFile::read(&path, &ImportOptions::default()).unwrap();
        let files = Files::from(read.bundle.clone());
        assert_eq!(files.scene, "s.toml");
        let edits = Edits::default();
        let known = files.files["a.ply"].bytes().clone();
        std::fs::remove_file(folder.path().join("a.ply")).unwrap();
        let reach = Reach::new(&path, &[]);
        let revised =
            |files: &Files, text: &str, edits: &Edits| files.revised(&path, (text, Written::ByPage), edits, &reach);
        let same = revised(&files, SCENE, &edits).unwrap();
        assert!(std::sync::Arc::ptr_eq(same.files["a.ply"].bytes(), &known));
        let canonical = read.canonical_bundle();
        let meant = same.canonical();
        assert_eq!(meant.scene, canonical.scene);
        assert_eq!(**meant.files[&meant.scene].bytes(), canonical.files[&canonical.scene]);

        let other = revised(&files, &SCENE.replace("a.ply", "b.ply"), &edits).unwrap();
        assert_eq!(other.files.keys().collect::<Vec<_>>(), ["b.ply", "s.toml"]);
        let wider = Edits {
            scale: Some(2.0),
            ..Edits::default()
        };
        let wide = revised(&files, SCENE, &wider).unwrap();
        let text = std::str::from_utf8(wide.files["s.toml"].bytes()).unwrap();
        assert!(text.contains("width = 16"), "{text}");
        let error = revised(&other, SCENE, &edits).unwrap_err();
        assert_eq!((error.line, error.file), (Some(5), path));
    }
}
