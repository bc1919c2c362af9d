//! job.json: what the job renders.

use super::StoreError;
use beamfarm_image::job::{EngineKind, JobSettings, ScheduleKind, Technique, Techniques};
use beamfarm_image::layer::Layer;
use beamfarm_image::view::white::NEUTRAL;
use beamfarm_image::view::{View, ViewTransform};
use beamfarm_proto::{FileHash, VERSION};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;

/// The format of job.json, ledger.jsonl and report.json. In the previous one, jobs also differed by the program's
/// version, and passes on processors had no version of their bits.
pub(super) const FORMAT: u32 = 2;
const BEFORE: u32 = 1;

/// What a job renders, as stored in job.json.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// Version of the format.
    format: u32,
    /// Version of the program that started it.
    pub version: String,
    /// Hash of the scene bundle.
    pub scene: String,
    /// Path of the scene file among `files`.
    pub scene_file: String,
    /// The scene's files.
    pub files: Vec<File>,
    /// Seed of the whole job.
    pub seed: u64,
    /// The schedule's alpha, which trades variance against bias. Stored as text, as not every JSON reader keeps all
    /// bits of a number.
    pub alpha: String,
    /// When the radius shrinks.
    pub schedule: ScheduleKind,
    /// Radii for a known number of passes, stored as text.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub budget: Option<String>,
    /// Photon paths per pass.
    pub paths_per_pass: u32,
    /// Photon paths that base radii refer to.
    pub reference_paths: u32,
    /// The technique for light that media scatter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub media_finder: Option<Technique>,
    /// The technique for light that surfaces scatter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface_finder: Option<Technique>,
    /// The technique for caustics of large lights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub caustic_finder: Option<Technique>,
    /// Whether photons are aimed, where the scene leaves it open.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aimed: Option<bool>,
    /// Engine of the passes with the version of its bits; `None`: processors, before their bits had versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub engine: Option<String>,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Names of the layers.
    pub layers: Vec<String>,
    /// First pass.
    pub first_pass: u64,
    /// End of the passes, exclusive; `None`: no limit.
    pub passes: Option<u64>,
    /// The scene's own number of passes, if it was used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) scene_passes: Option<u64>,
    /// Exposure of the PNG in stops.
    exposure: f32,
    /// White balance of the PNG in kelvin; `None`: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    white_balance: Option<f32>,
    /// The PNG's curve.
    #[serde(default, skip_serializing_if = "is_standard")]
    view: ViewTransform,
    /// Whether the image includes its standard error.
    pub standard_error: bool,
    /// Whether the scene drops photons that miss all targets.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub drops_photons: bool,
    /// Depth of the empty background; `None`: infinite.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub empty_depth: Option<f32>,
}

fn is_standard(transform: &ViewTransform) -> bool {
    *transform == ViewTransform::Standard
}

/// How the image is written. Jobs never differ because of it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Looks {
    /// How the PNG displays it.
    pub view: View,
    /// Whether the image includes its standard error.
    pub standard_error: bool,
    /// Whether the scene drops photons that miss all targets.
    pub drops_photons: bool,
    /// Depth of the empty background; `None`: infinite.
    pub empty_depth: Option<f32>,
}

/// A file of the scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct File {
    /// Its key in the bundle.
    pub path: String,
    /// BLAKE3 of its bytes, in hexadecimal.
    pub hash: String,
    /// Its size in bytes.
    pub size: u64,
}

impl Description {
    /// The description of a job.
    pub fn new(spec: &crate::JobSpec, looks: Looks) -> Self {
        let settings = spec.settings;
        let file = |(path, bytes): (&String, &Vec<u8>)| File {
            path: path.clone(),
            hash: FileHash::of(bytes).to_string(),
            size: bytes.len() as u64,
        };
        Self {
            format: FORMAT,
            version: VERSION.into(),
            scene: spec.bundle.hash().to_string(),
            scene_file: spec.bundle.scene.clone(),
            files: spec.bundle.files.iter().map(file).collect(),
            seed: settings.seed,
            alpha: settings.alpha.to_string(),
            schedule: settings.schedule,
            budget: settings.budget.map(|budget| budget.to_string()),
            paths_per_pass: settings.paths_per_pass,
            reference_paths: settings.reference_paths,
            media_finder: settings.techniques.media,
            surface_finder: settings.techniques.surfaces,
            caustic_finder: settings.techniques.caustics,
            aimed: settings.techniques.aimed,
            engine: Some(settings.engine.identity()),
            width: spec.width,
            height: spec.height,
            layers: spec.layers.iter().map(Layer::to_string).collect(),
            first_pass: spec.first_pass,
            passes: (spec.passes < beamfarm_image::job::MAX_PASSES).then_some(spec.passes),
            scene_passes: None,
            exposure: looks.view.exposure,
            white_balance: Some(looks.view.white_balance).filter(|kelvin| *kelvin != NEUTRAL),
            view: looks.view.transform,
            standard_error: looks.standard_error,
            drops_photons: looks.drops_photons,
            empty_depth: looks.empty_depth,
        }
    }

    /// The settings of the passes.
    pub fn settings(&self, path: &Path) -> Result<JobSettings, StoreError> {
        let foreign = |message: String| StoreError::Foreign {
            path: path.to_owned(),
            message,
        };
        let alpha = self.alpha.parse();
        let budget = self.budget.as_deref().map(str::parse).transpose();
        let engine = self.engine.as_deref().map(EngineKind::identified).transpose();
        let settings = JobSettings {
            seed: self.seed,
            alpha: alpha.map_err(|_| foreign(format!("alpha is {:?}", self.alpha)))?,
            schedule: self.schedule,
            budget: budget.map_err(|error| foreign(format!("budget is {error}")))?,
            paths_per_pass: self.paths_per_pass,
            reference_paths: self.reference_paths,
            techniques: Techniques {
                media: self.media_finder,
                surfaces: self.surface_finder,
                caustics: self.caustic_finder,
                aimed: self.aimed,
            },
            engine: engine.map_err(foreign)?.unwrap_or_default(),
        };
        settings.check().map_err(|error| foreign(error.to_string()))?;
        Ok(settings)
    }

    /// How the PNG displays the image.
    pub fn view(&self) -> View {
        View {
            transform: self.view,
            exposure: self.exposure,
            white_balance: self.white_balance.unwrap_or(NEUTRAL),
        }
    }

    /// Every difference that keeps the passes of two jobs from becoming one image; empty if they can.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let list = |names: &[String]| match names.is_empty() {
            true => "none".to_owned(),
            false => names.join(","),
        };
        let technique =
            |technique: Option<Technique>| technique.map_or("by rule".to_owned(), |technique| technique.to_string());
        let fields = |job: &Self| {
            [
                ("seed", job.seed.to_string()),
                ("alpha", job.alpha.clone()),
                ("schedule", job.schedule.to_string()),
                ("budget", job.budget.clone().unwrap_or_else(|| "none".into())),
                ("paths per pass", job.paths_per_pass.to_string()),
                ("reference paths", job.reference_paths.to_string()),
                ("technique for light in media", technique(job.media_finder)),
                ("technique for light of surfaces", technique(job.surface_finder)),
                ("technique for caustics", technique(job.caustic_finder)),
                (
                    "photons aimed",
                    job.aimed.map_or("by rule".into(), |aimed| aimed.to_string()),
                ),
                (
                    "engine",
                    job.engine.clone().unwrap_or_else(|| EngineKind::Cpu.to_string()),
                ),
                ("width", job.width.to_string()),
                ("height", job.height.to_string()),
                ("layers", list(&job.layers)),
            ]
        };
        let pairs = fields(self).into_iter().zip(fields(other));
        let different = pairs.filter(|((_, mine), (_, theirs))| mine != theirs);
        let different = different.map(|((name, mine), (_, theirs))| format!("{name} {mine} there, {theirs} here"));
        let mut all: Vec<String> = self.scene_differences(other).into_iter().chain(different).collect();
        let kind = |job: &Self| {
            job.engine
                .as_deref()
                .and_then(|engine| engine.split(' ').next().map(str::to_owned))
        };
        let [mine, theirs] = [self, other].map(|job| kind(job).unwrap_or_else(|| EngineKind::Cpu.to_string()));
        if self.engine != other.engine && mine == theirs {
            let version = &self.version;
            all.push(format!(
                "only the version that began it, {version}, renders passes of these bits"
            ));
        }
        all
    }

    /// The same job as a known one, with the version that it started with.
    pub(super) fn going_on_from(self, known: &Self) -> Self {
        Self {
            format: known.format,
            version: known.version.clone(),
            ..self
        }
    }

    /// Files in which the scenes differ. The scene file's content is left for the caller to compare.
    fn scene_differences(&self, other: &Self) -> Vec<String> {
        if self.scene == other.scene {
            return Vec::new();
        }
        let find = |job: &Self, path: &str| job.files.iter().find(|file| file.path == path).cloned();
        let paths: BTreeSet<&String> = self.files.iter().chain(&other.files).map(|file| &file.path).collect();
        let of_scene = |path: &str| path == self.scene_file || path == other.scene_file;
        let paths = paths.into_iter().filter(|path| !of_scene(path));
        let different = paths.filter(|path| find(self, path) != find(other, path));
        let words = different.map(|path| match (find(self, path), find(other, path)) {
            (Some(_), Some(_)) => format!("another {path} there than here"),
            (Some(_), None) => format!("{path} there and not here"),
            _ => format!("{path} here and not there"),
        });
        let scene = format!("scene {} there, {} here", self.scene, other.scene);
        std::iter::once(scene).chain(words).collect()
    }

    /// Hash of the scene file.
    pub(super) fn scene_hash(&self) -> Option<&str> {
        let mut files = self.files.iter();
        let file = files.find(|file| file.path == self.scene_file);
        file.map(|file| &*file.hash)
    }

    /// Hash of everything that [`Self::differences`] compares, and of the first pass.
    pub(super) fn digest(&self) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        let mut field = |text: &str| {
            hasher.update(&(text.len() as u64).to_le_bytes());
            hasher.update(text.as_bytes());
        };
        if self.format == BEFORE {
            field(&self.version);
        }
        field(&self.scene);
        field(&self.alpha);
        field(&self.schedule.to_string());
        self.budget.iter().for_each(|budget| field(budget));
        for number in [
            self.seed,
            self.paths_per_pass.into(),
            self.reference_paths.into(),
            self.width.into(),
            self.height.into(),
            self.first_pass,
        ] {
            field(&number.to_string());
        }
        for technique in [self.media_finder, self.surface_finder, self.caustic_finder] {
            field(&technique.map(|technique| technique.to_string()).unwrap_or_default());
        }
        self.aimed.iter().for_each(|aimed| field(&aimed.to_string()));
        // A missing field is not hashed, so that older jobs keep their digest.
        self.engine.iter().for_each(|engine| field(engine));
        self.layers.iter().for_each(|layer| field(layer));
        *hasher.finalize().as_bytes()
    }

    /// As JSON, in field order, one field per line.
    pub(super) fn to_json(&self) -> Result<Vec<u8>, serde_json::Error> {
        let mut json = serde_json::to_vec_pretty(self)?;
        json.push(b'\n');
        Ok(json)
    }

    /// Parse what [`Self::to_json`] wrote.
    pub(super) fn from_json(path: &Path, json: &[u8]) -> Result<Self, StoreError> {
        #[derive(Deserialize)]
        struct Format {
            format: u32,
        }
        let foreign = |message: String| StoreError::Foreign {
            path: path.to_owned(),
            message,
        };
        let wrong = |error: serde_json::Error| foreign(error.to_string());
        let format: Format = serde_json::from_slice(json).map_err(wrong)?;
        match format.format {
            BEFORE | FORMAT => serde_json::from_slice(json).map_err(wrong),
            other => Err(foreign(format!(
                "format {other}; this version of beamfarm, {VERSION}, reads {BEFORE} and {FORMAT}"
            ))),
        }
    }
}
