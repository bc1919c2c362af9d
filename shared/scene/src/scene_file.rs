//! Scene files of every kind on disk.

use crate::assemble::{Extent, Extents};
use crate::assets::gltf;
use crate::disk::{read_file, text_of};
use crate::error::SceneError;
use crate::files::Files;
use crate::gather::{Authors, with_assets};
use crate::kinds;
use crate::load::load_with_extents;
use crate::lone::{self, is_gltf};
use crate::meaning::{self, CANONICAL_NAME};
use crate::mitsuba::{Origin, import_within, is_mitsuba};
use crate::options::ImportOptions;
use crate::reach::Reach;
use crate::store::Store;
use beamfarm_image::bundle::{self, Bundle};
use beamfarm_render::world::SceneDescription;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A native scene that is not in a file.
#[derive(Clone, Debug, Default)]
pub struct SceneText {
    /// Its name in errors. Files it names that are not in `made` are looked up in this path's folder.
    pub path: PathBuf,
    /// The TOML text.
    pub text: String,
    /// Generated files by their names in the text.
    pub made: BTreeMap<String, Vec<u8>>,
    /// Where its other files may be: the reach of the file it was made from, which already admits the files that this
    /// text names. `None`: as for a file at `path`.
    pub reach: Option<Arc<Reach>>,
}

impl SceneText {
    /// Where its files may be.
    pub(crate) fn reach(&self, options: &ImportOptions) -> Arc<Reach> {
        let own = || Arc::new(Reach::new(&self.path, &options.allow_outside));
        self.reach.clone().unwrap_or_else(own)
    }
}

/// A scene file with all its assets: native, Mitsuba's XML, or glTF.
#[derive(Clone, Debug)]
pub struct SceneFile {
    /// The native scene and its assets.
    pub bundle: Bundle,
    /// What was replaced in an XML scene, each with its file and line, or what was made up to show a glTF file.
    pub notes: Vec<String>,
    /// What was left out of an XML scene as unsupported, each with its file and line.
    pub left_out: Vec<String>,
    /// Generated assets of an XML scene, by their names in the native scene.
    pub made: Vec<String>,
    /// Where its files may be, and which of them are outside its folder.
    pub reach: Arc<Reach>,
    folder: PathBuf,
    origin: Option<Origin>,
}

impl SceneFile {
    /// Read a scene. A name ending in `.xml` means Mitsuba, `.glb` or `.gltf` means glTF.
    pub fn read(path: &Path, options: &ImportOptions) -> Result<Self, SceneError> {
        Self::read_for(path, path.parent().unwrap_or(Path::new("")), options)
    }

    /// Take a scene that is not in a file, and read the files it names.
    pub fn of_text(scene: &SceneText, options: &ImportOptions) -> Result<Self, SceneError> {
        let SceneText { path, text, made, .. } = scene;
        let text = options.edits.apply(path, text)?.unwrap_or_else(|| text.clone());
        let reach = scene.reach(options);
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let scene = (name, text.into_bytes());
        Ok(Self {
            bundle: with_assets(scene, path, &folder, (&reach, Authors::USER), made)?,
            notes: Vec::new(),
            left_out: Vec::new(),
            made: made.keys().cloned().collect(),
            reach,
            folder,
            origin: None,
        })
    }

    /// [`Self::read`], but scenes of other formats become native ones that name assets relative to `folder`.
    pub fn read_for(path: &Path, folder: &Path, options: &ImportOptions) -> Result<Self, SceneError> {
        let unreadable = |reason: String| SceneError {
            file: path.to_path_buf(),
            line: None,
            message: reason,
        };
        let name = path
            .file_name()
            .ok_or_else(|| unreadable("not the name of a file".to_string()))?;
        let name = name
            .to_str()
            .ok_or_else(|| unreadable("the file's name is not UTF-8".to_string()))?;
        if let Some(refusal) = kinds::refusal(path) {
            return Err(unreadable(refusal));
        }
        let reach = Arc::new(Reach::new(path, &options.allow_outside));
        if !is_mitsuba(path) && !is_gltf(path) {
            let folder = path.parent().unwrap_or(Path::new(""));
            let mut bytes = read_file(path, bundle::MAX_BYTES).map_err(unreadable)?;
            if let Some(edited) = options.edits.apply(path, text_of(path, &bytes)?)? {
                bytes = edited.into_bytes();
            }
            let scene = (name.to_string(), bytes);
            let bundle = with_assets(scene, path, folder, (&reach, Authors::USER), &BTreeMap::new())?;
            return Ok(Self {
                bundle,
                notes: Vec::new(),
                left_out: Vec::new(),
                made: Vec::new(),
                reach,
                folder: folder.to_path_buf(),
                origin: None,
            });
        }
        let (mut text, notes, left_out, made, origin) = if is_gltf(path) {
            let gltf::Whole { text, notes } = lone::scene(path, folder, &reach)?;
            let note = |note: String| unreadable(note).to_string();
            let notes = notes.into_iter().map(note).collect();
            (text, notes, Vec::new(), BTreeMap::new(), Origin::whole(path))
        } else {
            let imported = import_within(path, folder, options, &reach)?;
            let origin = imported.origin().clone();
            (imported.text, imported.notes, imported.left_out, imported.made, origin)
        };
        if let Some(edited) = options.edits.apply(path, &text)? {
            text = edited;
        }
        let native = Path::new(name).with_extension("toml");
        let native = native.to_string_lossy().into_owned();
        let authors = match is_gltf(path) {
            true => Authors::USER_OF_GLTF,
            false => Authors::CONVERTED,
        };
        let bundle = with_assets((native, text.into_bytes()), path, folder, (&reach, authors), &made);
        let bundle = bundle.map_err(|error| origin.relocate(error))?;
        Ok(Self {
            bundle,
            notes,
            left_out,
            made: made.into_keys().collect(),
            reach,
            folder: folder.to_path_buf(),
            origin: Some(origin),
        })
    }

    /// The bundle shared by all files of the same meaning: without comments, white space, key order, the number of
    /// passes, the view and the file's name.
    pub fn canonical_bundle(mut self) -> Bundle {
        let text = std::str::from_utf8(self.text()).ok();
        let text = text.and_then(meaning::canonical);
        let free = self.bundle.scene == CANONICAL_NAME || !self.bundle.files.contains_key(CANONICAL_NAME);
        if let Some(text) = text.filter(|_| free) {
            self.bundle.files.remove(&self.bundle.scene);
            self.bundle.scene = CANONICAL_NAME.into();
            self.bundle.files.insert(CANONICAL_NAME.into(), text.into_bytes());
        }
        self.bundle
    }

    /// The native scene file's text.
    pub fn text(&self) -> &[u8] {
        self.bundle.files.get(&self.bundle.scene).map_or(&[], Vec::as_slice)
    }

    /// Parse and validate the scene. Errors name files as given to [`Self::read`].
    pub fn load(&self) -> Result<SceneDescription, SceneError> {
        self.load_with_extents().map(|(description, _)| description)
    }

    /// The bounding boxes of the scene's shapes and volumes, world space.
    pub fn extents(&self) -> Result<Vec<Extent>, SceneError> {
        let (description, extents) = self.load_with_extents()?;
        Ok(extents.list(&description.objects))
    }

    /// [`Self::load`], sharing with `store` what earlier scenes had in common.
    pub fn load_from(&self, store: &mut Store) -> Result<SceneDescription, SceneError> {
        let files = Files::from(self.bundle.clone());
        store.load(&files).map_err(|error| self.as_given(error))
    }

    fn load_with_extents(&self) -> Result<(SceneDescription, Extents), SceneError> {
        load_with_extents(&self.bundle).map_err(|error| self.as_given(error))
    }

    /// The error, with the file named as given to [`Self::read`].
    fn as_given(&self, error: SceneError) -> SceneError {
        match &self.origin {
            Some(origin) if error.file == Path::new(&self.bundle.scene) => origin.relocate(error),
            _ => SceneError {
                file: self.folder.join(&error.file),
                ..error
            },
        }
    }
}

/// Read a scene file and all its assets into a bundle.
pub fn read_bundle(path: &Path) -> Result<Bundle, SceneError> {
    SceneFile::read(path, &ImportOptions::default()).map(|file| file.bundle)
}
