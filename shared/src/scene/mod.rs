//! The scene: read from TOML, validated, then immutable.

mod assets;
mod build;
mod mitsuba;
mod parse;
mod source;
mod transform;
mod values;

use crate::bsdf::Material;
use crate::bundle::{self, Bundle};
use crate::camera::Camera;
use crate::error::SceneError;
use crate::geometry::Object;
use crate::job::{JobSettings, ScheduleKind};
use crate::light::{Light, SceneBounds};
use crate::medium::{Medium, MediumId};
use crate::rules::Rules;
use crate::target::Targeting;
use assets::gltf;
use build::Problem;
pub use mitsuba::{ImportOptions, Imported, Origin, import};
use parse::{Fault, SceneRecord};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Everything that a pass renders. Lengths in scene units; render space is world space moved so that the camera stands at
/// the origin, which keeps single precision where it is needed.
#[derive(Clone, Debug)]
pub struct SceneDescription {
    /// The camera.
    pub camera: Camera,
    /// Medium that the scene names for the camera, if it does.
    pub camera_medium: Option<MediumId>,
    /// Medium outside of every object.
    pub world_medium: MediumId,
    /// Objects.
    pub objects: Vec<Object>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Media.
    pub media: Vec<Medium>,
    /// Lights; those of emitting objects among them.
    pub lights: Vec<Light>,
    /// A sphere around all objects, positioned lights, and the camera.
    pub bounds: SceneBounds,
    /// Defaults for the job.
    pub defaults: RenderDefaults,
    /// Object visibility rules, if any has an effect.
    pub rules: Option<Rules>,
    /// What the scene says to no effect, each with its file and line.
    pub notes: Vec<String>,
    /// File, line and field of each rule that photons obey.
    pub photon_rules: Vec<String>,
}

/// What the scene file says about rendering; the command line overrides it.
#[derive(Clone, Copy, Debug)]
pub struct RenderDefaults {
    /// Passes.
    pub passes: u64,
    /// Photon paths per pass.
    pub paths_per_pass: u32,
    /// Trade of variance against bias, in (0, 1).
    pub alpha: f64,
    /// Radius schedule.
    pub schedule: ScheduleKind,
    /// Seed.
    pub seed: u64,
    /// Stops of exposure of the PNG.
    pub exposure: f32,
    /// Fixed base radius of beams and surface photons in scene units, in place of photon differentials.
    pub radius: Option<f32>,
    /// When photons are aimed at what the camera sees.
    pub targeting: Targeting,
}

impl RenderDefaults {
    /// The settings of a job that overrides nothing.
    pub fn job_settings(&self) -> JobSettings {
        JobSettings {
            seed: self.seed,
            alpha: self.alpha,
            schedule: self.schedule,
            budget: None,
            paths_per_pass: self.paths_per_pass,
            reference_paths: self.paths_per_pass,
        }
    }
}

impl Default for RenderDefaults {
    fn default() -> Self {
        Self {
            passes: 64,
            paths_per_pass: 50_000,
            alpha: 2.0 / 3.0,
            schedule: ScheduleKind::Pass,
            seed: 0,
            exposure: 0.0,
            radius: None,
            targeting: Targeting::Auto,
        }
    }
}

impl SceneDescription {
    /// Parse and validate the scene of a bundle. Errors name files as the bundle does: relative to the scene's folder.
    pub fn load(bundle: &Bundle) -> Result<Self, SceneError> {
        let file = Path::new(&bundle.scene);
        let bytes = bundle.files.get(&bundle.scene).ok_or_else(|| SceneError {
            file: file.to_path_buf(),
            line: None,
            message: "the bundle lacks its scene file".to_string(),
        })?;
        let text = text_of(file, bytes)?;
        let record =
            SceneRecord::parse(text).map_err(|fault| source::locate(file, text, &fault))?;
        let built = build::build(&record, bundle).map_err(|problem| match problem {
            Problem::Scene(fault) => source::locate(file, text, &fault),
            Problem::Asset { file, flaw } => SceneError {
                file: PathBuf::from(file),
                line: flaw.line,
                message: flaw.message,
            },
        });
        let (mut description, notes) = built?;
        let note = |fault: &Fault| source::locate(file, text, fault).to_string();
        description.notes = notes.iter().map(note).collect();
        let rules = description.rules.iter().filter(|r| r.touches_photons);
        let places = rules.flat_map(|rules| &rules.photon_places);
        let rule = |place: &Range<usize>| note(&Fault::new(place.clone(), "photons obey this"));
        description.photon_rules = places.map(rule).collect();
        Ok(description)
    }
}

/// A scene file with every asset that it names, native or Mitsuba's XML.
#[derive(Clone, Debug)]
pub struct SceneFile {
    /// The native scene and its assets.
    pub bundle: Bundle,
    /// What was replaced of an XML scene, each with its file and line.
    pub notes: Vec<String>,
    /// What is not supported of an XML scene and was left out, each with its file and line.
    pub left_out: Vec<String>,
    folder: PathBuf,
    origin: Option<Origin>,
}

impl SceneFile {
    /// Read a scene; Mitsuba's if the file's name ends in `.xml`.
    pub fn read(path: &Path, options: &ImportOptions) -> Result<Self, SceneError> {
        Self::read_for(path, path.parent().unwrap_or(Path::new("")), options)
    }

    /// As [`Self::read`]. An XML scene becomes a native one that names its assets relative to `folder`.
    pub fn read_for(
        path: &Path,
        folder: &Path,
        options: &ImportOptions,
    ) -> Result<Self, SceneError> {
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
        if !is_mitsuba(path) {
            let folder = path.parent().unwrap_or(Path::new(""));
            let bytes = read_file(path, bundle::MAX_BYTES).map_err(unreadable)?;
            let bundle = with_assets(name.to_string(), bytes, path, folder)?;
            return Ok(Self {
                bundle,
                notes: Vec::new(),
                left_out: Vec::new(),
                folder: folder.to_path_buf(),
                origin: None,
            });
        }
        let imported = import(path, folder, options)?;
        let origin = imported.origin().clone();
        let native = Path::new(name).with_extension("toml");
        let native = native.to_string_lossy().into_owned();
        let bundle = with_assets(native, imported.text.into_bytes(), path, folder)
            .map_err(|error| origin.relocate(error))?;
        Ok(Self {
            bundle,
            notes: imported.notes,
            left_out: imported.left_out,
            folder: folder.to_path_buf(),
            origin: Some(origin),
        })
    }

    /// The native scene file's text.
    pub fn text(&self) -> &[u8] {
        self.bundle
            .files
            .get(&self.bundle.scene)
            .map_or(&[], Vec::as_slice)
    }

    /// Parse and validate the scene. Errors name files as [`Self::read`] was given them.
    pub fn load(&self) -> Result<SceneDescription, SceneError> {
        SceneDescription::load(&self.bundle).map_err(|error| match &self.origin {
            Some(origin) if error.file == Path::new(&self.bundle.scene) => origin.relocate(error),
            _ => SceneError {
                file: self.folder.join(&error.file),
                ..error
            },
        })
    }
}

/// Whether a scene file is Mitsuba's, by its name.
pub fn is_mitsuba(path: &Path) -> bool {
    path.extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("xml"))
}

/// Read a scene file and every asset that it names into a bundle.
pub fn read_bundle(path: &Path) -> Result<Bundle, SceneError> {
    SceneFile::read(path, &ImportOptions::default()).map(|file| file.bundle)
}

/// A bundle of a native scene file and its assets, which lie in `folder`. Errors name `path`.
fn with_assets(
    name: String,
    bytes: Vec<u8>,
    path: &Path,
    folder: &Path,
) -> Result<Bundle, SceneError> {
    let text = text_of(path, &bytes)?;
    let record = SceneRecord::parse(text).map_err(|fault| source::locate(path, text, &fault))?;
    let scene = bundle::key(&name);
    let mut room = bundle::MAX_BYTES.saturating_sub(bytes.len() as u64);
    let mut files = BTreeMap::from([(scene.clone(), bytes.clone())]);
    let mut add =
        |files: &mut BTreeMap<String, Vec<u8>>, written: &str, span: std::ops::Range<usize>| {
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
            let bytes = read_file(&folder.join(written), room)
                .map_err(|reason| fault(format!("the file \"{written}\": {reason}")))?;
            room -= bytes.len() as u64;
            files.insert(key, bytes);
            Ok(())
        };
    for asset in record.assets() {
        add(&mut files, asset.get_ref(), asset.span())?;
    }
    for asset in record.gltf_files() {
        let name = asset.get_ref();
        let bytes = files.get(&bundle::key(name)).map_or(&[][..], Vec::as_slice);
        let named = gltf::files(bytes).map_err(|flaw| SceneError {
            file: folder.join(name),
            line: None,
            message: flaw.message,
        })?;
        for file in named {
            add(&mut files, &gltf::beside(name, &file), asset.span())?;
        }
    }
    Ok(Bundle { scene, files })
}

/// The JSON Schema (draft 7) of native scene files, for editors: a JSON document.
pub fn json_schema() -> String {
    parse::json_schema()
}

fn text_of<'a>(file: &Path, bytes: &'a [u8]) -> Result<&'a str, SceneError> {
    std::str::from_utf8(bytes).map_err(|e| SceneError {
        file: file.to_path_buf(),
        line: Some(source::line_of(bytes, e.valid_up_to())),
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
