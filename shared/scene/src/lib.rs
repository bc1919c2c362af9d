//! Scene files: native ones (TOML), Mitsuba's (XML) and glTF, with the meshes, images and volumes that they name, read
//! and validated into a [`SceneDescription`].
//!
//! `parse` turns text into records that know their places in the file, `assemble` turns records into what the renderer
//! takes, `assets` reads what they name, and `mitsuba` turns XML into a native file. [`desk`] changes a file's text.
//!
//! # Example
//!
//! ```
//! use beamfarm_image::bundle::Bundle;
//! use beamfarm_image::merge::{Node, TreeSum};
//! use beamfarm_render::cpu::pass::render_pass;
//! use beamfarm_render::plan::RenderPlan;
//! use beamfarm_render::world::Scene;
//!
//! let text = r#"
//! [image]
//! width = 32
//! height = 24
//! [camera]
//! origin = [0, 0, 3]
//! target = [0, 0, 0]
//! fov = 40
//! [[shapes]]
//! type = "sphere"
//! center = [0, 0, 0]
//! radius = 1
//! [[lights]]
//! type = "point"
//! position = [2, 2, 3]
//! power = 100
//! "#;
//! let mut bundle = Bundle { scene: "ball.toml".into(), ..Bundle::default() };
//! bundle.files.insert("ball.toml".into(), text.into());
//!
//! let scene = Scene::new(beamfarm_scene::load(&bundle)?);
//! let plan = RenderPlan::new(&scene, scene.description().defaults.job_settings());
//! let mut sum = TreeSum::new(32, 24);
//! for pass_index in 0..4 {
//!     let pass = render_pass(&scene, &plan, pass_index).expect("a pass");
//!     sum.insert(Node::leaf(pass_index, pass.film))?;
//! }
//! let image = sum.average().expect("four passes are complete");
//! assert!(image.beauty.pixels[12 * 32 + 16][0] > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod assemble;
mod assets;
mod cie;
pub mod desk;
mod edits;
mod error;
mod faults;
mod files;
mod frames;
mod lone;
mod meaning;
mod mitsuba;
mod options;
mod parse;
mod paths;
mod place;
mod revised;
mod source;
mod store;
mod time;
mod transform;
mod values;

pub use assemble::Extent;
use assemble::{Assembled, Extents, Kept, Problem, Space};
use assets::gltf;
use beamfarm_image::bundle::{self, Bundle};
use beamfarm_render::world::SceneDescription;
pub use edits::Edits;
pub use error::SceneError;
pub use faults::errors;
use files::Source;
pub use files::{ContentHash, File, Files};
pub use frames::{frames, numbered};
use glam::DVec3;
pub use lone::is_gltf;
pub use meaning::differences;
pub use mitsuba::{Imported, Origin, import};
pub use options::ImportOptions;
use parse::{Fault, SceneRecord, Snapshot};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
pub use store::Store;
use time::When;
use values::Spanned;

/// Parse and validate the scene of a bundle. Errors name files as the bundle does: relative to the scene's folder.
pub fn load(bundle: &Bundle) -> Result<SceneDescription, SceneError> {
    load_with_extents(bundle).map(|(description, _)| description)
}

fn load_with_extents(bundle: &Bundle) -> Result<(SceneDescription, Extents), SceneError> {
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

/// The scene file of a source at a moment.
fn snapshot(source: Source<'_>, when: When) -> Result<Snapshot, SceneError> {
    let (file, text) = scene_file(source)?;
    SceneRecord::snapshot(text, when).map_err(|fault| source::locate(file, text, &fault))
}

/// None where nothing moves; otherwise whether something is not the same while the shutter is open.
fn motion(source: Source<'_>, snapshot: &Snapshot) -> Option<bool> {
    let [open, close] = snapshot.clock.open();
    let plays = |file: &Spanned<String>| {
        let bytes = source.bytes(&bundle::key(file.get_ref()));
        bytes.is_some_and(gltf::is_animated)
    };
    let plays = snapshot.clock.is_given() && snapshot.record.gltf_files().any(plays);
    let moves = plays || !snapshot.moving.is_empty();
    moves.then_some(snapshot.blurs || plays && open != close)
}

fn scene_file(source: Source<'_>) -> Result<(&Path, &str), SceneError> {
    let file = Path::new(source.scene());
    let bytes = source.bytes(source.scene()).ok_or_else(|| SceneError {
        file: file.to_path_buf(),
        line: None,
        message: "the bundle lacks its scene file".to_string(),
    })?;
    Ok((file, text_of(file, bytes)?))
}

/// A scene that is put together.
struct Made {
    description: SceneDescription,
    extents: Extents,
    /// World position of the origin of render space.
    render_origin: DVec3,
}

/// `snapshot`: of the source's scene file.
fn assembled(source: Source<'_>, snapshot: &Snapshot, kept: &mut Kept, space: Space) -> Result<Made, SceneError> {
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

/// What keeps a scene from being built, with its place.
fn located(file: &Path, text: &str, problem: Problem) -> SceneError {
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

/// A scene file with every asset that it names: native, Mitsuba's XML, or glTF.
#[derive(Clone, Debug)]
pub struct SceneFile {
    /// The native scene and its assets.
    pub bundle: Bundle,
    /// What was replaced of an XML scene, each with its file and line, or what was made up to show a glTF file.
    pub notes: Vec<String>,
    /// What is not supported of an XML scene and was left out, each with its file and line.
    pub left_out: Vec<String>,
    /// Assets of an XML scene that were made and are not on the disk, by their names in the native scene.
    pub made: Vec<String>,
    folder: PathBuf,
    origin: Option<Origin>,
}

impl SceneFile {
    /// Read a scene; Mitsuba's if the file's name ends in `.xml`, glTF if in `.glb` or `.gltf`.
    pub fn read(path: &Path, options: &ImportOptions) -> Result<Self, SceneError> {
        Self::read_for(path, path.parent().unwrap_or(Path::new("")), options)
    }

    /// As [`Self::read`]. Other scenes become native ones that name their assets relative to `folder`.
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
        if !is_mitsuba(path) && !is_gltf(path) {
            let folder = path.parent().unwrap_or(Path::new(""));
            let mut bytes = read_file(path, bundle::MAX_BYTES).map_err(unreadable)?;
            if let Some(edited) = options.edits.apply(path, text_of(path, &bytes)?)? {
                bytes = edited.into_bytes();
            }
            let bundle = with_assets(name.to_string(), bytes, path, folder, &BTreeMap::new())?;
            return Ok(Self {
                bundle,
                notes: Vec::new(),
                left_out: Vec::new(),
                made: Vec::new(),
                folder: folder.to_path_buf(),
                origin: None,
            });
        }
        let (mut text, notes, left_out, made, origin) = if is_gltf(path) {
            let gltf::Whole { text, notes } = lone::scene(path, folder)?;
            let note = |note: String| unreadable(note).to_string();
            let notes = notes.into_iter().map(note).collect();
            (text, notes, Vec::new(), BTreeMap::new(), Origin::whole(path))
        } else {
            let imported = import(path, folder, options)?;
            let origin = imported.origin().clone();
            (imported.text, imported.notes, imported.left_out, imported.made, origin)
        };
        if let Some(edited) = options.edits.apply(path, &text)? {
            text = edited;
        }
        let native = Path::new(name).with_extension("toml");
        let native = native.to_string_lossy().into_owned();
        let bundle = with_assets(native, text.into_bytes(), path, folder, &made);
        let bundle = bundle.map_err(|error| origin.relocate(error))?;
        Ok(Self {
            bundle,
            notes,
            left_out,
            made: made.into_keys().collect(),
            folder: folder.to_path_buf(),
            origin: Some(origin),
        })
    }

    /// The bundle that all files of the same meaning have: comments, white space, the order of keys, the number of
    /// passes, the view and the file's own name are left out.
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

    /// Parse and validate the scene. Errors name files as [`Self::read`] was given them.
    pub fn load(&self) -> Result<SceneDescription, SceneError> {
        self.load_with_extents().map(|(description, _)| description)
    }

    /// Where in the world the shapes and the volumes of the scene are, each as a box.
    pub fn extents(&self) -> Result<Vec<Extent>, SceneError> {
        let (description, extents) = self.load_with_extents()?;
        Ok(extents.list(&description.objects))
    }

    /// The same, but what scenes before it had as well is taken from `store`.
    pub fn load_from(&self, store: &mut Store) -> Result<SceneDescription, SceneError> {
        let files = Files::from(self.bundle.clone());
        store.load(&files).map_err(|error| self.as_given(error))
    }

    fn load_with_extents(&self) -> Result<(SceneDescription, Extents), SceneError> {
        load_with_extents(&self.bundle).map_err(|error| self.as_given(error))
    }

    /// The error with the file's name as [`Self::read`] was given it.
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

/// The scene file of bundles in which only its meaning counts.
const CANONICAL_NAME: &str = "scene.toml";

/// Whether a scene file is Mitsuba's, by its name.
pub fn is_mitsuba(path: &Path) -> bool {
    path.extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("xml"))
}

/// Read a scene file and every asset that it names into a bundle.
pub fn read_bundle(path: &Path) -> Result<Bundle, SceneError> {
    SceneFile::read(path, &ImportOptions::default()).map(|file| file.bundle)
}

/// A bundle of a native scene file and its assets, which lie in `folder` unless they were made. Errors name `path`.
fn with_assets(
    name: String,
    bytes: Vec<u8>,
    path: &Path,
    folder: &Path,
    made: &BTreeMap<String, Vec<u8>>,
) -> Result<Bundle, SceneError> {
    let scene = bundle::key(&name);
    let files = gather(&scene, bytes, path, folder, |key, path, room| {
        let made = made.iter().find(|(name, _)| bundle::key(name) == key);
        made.map_or_else(|| read_file(path, room), |(_, bytes)| Ok(bytes.clone()))
    })?;
    Ok(Bundle { scene, files })
}

/// A native scene file and its assets, which lie in `folder`, each as `read` gives it by its key, its path and the most
/// bytes that it may have. Errors name `path`.
fn gather<B: AsRef<[u8]> + Clone>(
    scene: &str,
    scene_file: B,
    path: &Path,
    folder: &Path,
    read: impl Fn(&str, &Path, u64) -> Result<B, String>,
) -> Result<BTreeMap<String, B>, SceneError> {
    let text = text_of(path, scene_file.as_ref())?;
    let located = |fault: Fault| source::locate(path, text, &fault);
    let middle = SceneRecord::snapshot(text, When::Middle).map_err(located)?;
    let others = match middle.blurs {
        true => middle.times_of_files.as_slice(),
        false => &[],
    };
    let others = others.iter().map(|time| SceneRecord::snapshot(text, When::At(*time)));
    let others: Vec<Snapshot> = others.collect::<Result<_, _>>().map_err(located)?;
    let records = || [&middle].into_iter().chain(&others).map(|snapshot| &snapshot.record);
    let mut room = bundle::MAX_BYTES.saturating_sub(text.len() as u64);
    let mut files = BTreeMap::from([(scene.to_owned(), scene_file.clone())]);
    let mut add = |files: &mut BTreeMap<String, B>, written: &str, span: Range<usize>| {
        let fault = |reason: String| {
            let fault = Fault::new(span.clone(), reason);
            source::locate(path, text, &fault)
        };
        let key = bundle::key(written);
        if files.contains_key(&key) {
            return Ok(());
        }
        bundle::check_key(&key).map_err(fault)?;
        if files.len() == bundle::MAX_FILES {
            return Err(fault(format!(
                "the scene names more files than the {} that it may have",
                bundle::MAX_FILES
            )));
        }
        let file = read(&key, &folder.join(written), room)
            .map_err(|reason| fault(format!("the file \"{written}\": {reason}")))?;
        room = room.saturating_sub(file.as_ref().len() as u64);
        files.insert(key, file);
        Ok(())
    };
    for asset in records().flat_map(SceneRecord::assets) {
        add(&mut files, asset.get_ref(), asset.span())?;
    }
    for asset in records().flat_map(SceneRecord::gltf_files) {
        let name = asset.get_ref();
        let named = {
            let bytes = files.get(&bundle::key(name)).map_or(&[][..], AsRef::as_ref);
            gltf::files(bytes).map_err(|flaw| SceneError {
                file: folder.join(name),
                line: None,
                message: flaw.message,
            })?
        };
        for file in named {
            add(&mut files, &gltf::beside(name, &file), asset.span())?;
        }
    }
    Ok(files)
}

/// The JSON Schema (draft 7) of native scene files, for editors: a JSON document.
pub fn json_schema() -> String {
    parse::json_schema_with_keys()
}

fn text_of<'a>(file: &Path, bytes: &'a [u8]) -> Result<&'a str, SceneError> {
    std::str::from_utf8(bytes).map_err(|e| SceneError {
        file: file.to_path_buf(),
        line: Some(beamfarm_assets::line_of(bytes, e.valid_up_to())),
        message: "the scene file is not UTF-8 text".to_string(),
    })
}

/// A file of at most `room` bytes.
fn read_file(path: &Path, room: u64) -> Result<Vec<u8>, String> {
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
