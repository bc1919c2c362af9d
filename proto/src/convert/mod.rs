//! All conversions between wire and domain types. Inbound ones validate; outbound ones cannot fail.

mod live;
mod offer;

use crate::domain::{FileEntry, FileHash, Grant, Job, LeaseId, Manifest};
use crate::wire;
use beamfarm_image::bundle::{MAX_BYTES, MAX_FILES, check_key};
use beamfarm_image::job::{
    Block, Budget, EngineKind, JobSettings, MAX_PASSES, PassStats, SceneHash, ScheduleKind, Technique, Techniques,
};
use beamfarm_image::layer::{self, Layer};
use prost::bytes::Bytes;

/// An impossible message.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {message}")]
pub struct WireError {
    /// The field at fault.
    pub field: &'static str,
    /// What is wrong, or what was expected.
    pub message: String,
}

impl WireError {
    fn new(field: &'static str, message: impl Into<String>) -> Self {
        let message = message.into();
        Self { field, message }
    }
}

impl From<WireError> for tonic::Status {
    fn from(error: WireError) -> Self {
        Self::invalid_argument(error.to_string())
    }
}

fn require<T>(value: Option<T>, field: &'static str) -> Result<T, WireError> {
    value.ok_or_else(|| WireError::new(field, "is missing"))
}

fn hash(bytes: &Bytes, field: &'static str) -> Result<[u8; 32], WireError> {
    let wrong = || WireError::new(field, format!("{} bytes; expected 32", bytes.len()));
    bytes.as_ref().try_into().map_err(|_| wrong())
}

/// A hash on the wire. Scenes and files share its wire type.
pub trait WireHash: Sized {
    /// To the wire.
    fn to_wire(&self) -> Bytes;
    /// From the wire. The error names `field`.
    fn from_wire(bytes: &Bytes, field: &'static str) -> Result<Self, WireError>;
}

impl WireHash for SceneHash {
    fn to_wire(&self) -> Bytes {
        Bytes::copy_from_slice(&self.0)
    }
    fn from_wire(bytes: &Bytes, field: &'static str) -> Result<Self, WireError> {
        hash(bytes, field).map(Self)
    }
}

impl WireHash for FileHash {
    fn to_wire(&self) -> Bytes {
        Bytes::copy_from_slice(&self.0)
    }
    fn from_wire(bytes: &Bytes, field: &'static str) -> Result<Self, WireError> {
        hash(bytes, field).map(Self)
    }
}

impl From<&Job> for wire::Job {
    fn from(job: &Job) -> Self {
        Self {
            scene: job.scene.to_wire(),
            manifest: Some((&job.manifest).into()),
            settings: Some(job.settings.into()),
            width: job.width,
            height: job.height,
            layers: job.layers.iter().map(Layer::to_string).collect(),
        }
    }
}

impl TryFrom<wire::Job> for Job {
    type Error = WireError;
    fn try_from(job: wire::Job) -> Result<Self, WireError> {
        let layers = layer::parse_all(job.layers.iter().map(String::as_str));
        Ok(Self {
            layers: layers.map_err(|error| WireError::new("job.layers", error.to_string()))?,
            scene: SceneHash::from_wire(&job.scene, "job.scene")?,
            manifest: require(job.manifest, "job.manifest")?.try_into()?,
            settings: require(job.settings, "job.settings")?.try_into()?,
            width: job.width,
            height: job.height,
        })
    }
}

impl From<&Manifest> for wire::Manifest {
    fn from(manifest: &Manifest) -> Self {
        let entry = |file: &FileEntry| wire::FileEntry {
            path: file.path.clone(),
            hash: file.hash.to_wire(),
            size: file.size,
        };
        Self {
            scene: manifest.scene.clone(),
            files: manifest.files.iter().map(entry).collect(),
        }
    }
}

impl TryFrom<wire::Manifest> for Manifest {
    type Error = WireError;
    fn try_from(manifest: wire::Manifest) -> Result<Self, WireError> {
        let wrong = |message: String| WireError::new("manifest.files", message);
        if manifest.files.len() > MAX_FILES {
            let count = manifest.files.len();
            return Err(wrong(format!("{count} files; expected at most {MAX_FILES}")));
        }
        let mut files: Vec<FileEntry> = Vec::with_capacity(manifest.files.len());
        let mut room = MAX_BYTES;
        for file in manifest.files {
            check_key(&file.path).map_err(wrong)?;
            let path = &file.path;
            if files.last().is_some_and(|last| last.path >= *path) {
                return Err(wrong(format!(
                    "expected ascending paths, each once, found {path:?} after {:?}",
                    files.last().map(|last| &*last.path).unwrap_or_default()
                )));
            }
            room = room.checked_sub(file.size).ok_or_else(|| {
                wrong(format!(
                    "with {path:?} of {} bytes they take more than {MAX_BYTES}",
                    file.size
                ))
            })?;
            files.push(FileEntry {
                hash: FileHash::from_wire(&file.hash, "manifest.files.hash")?,
                path: file.path,
                size: file.size,
            });
        }
        let scene = manifest.scene;
        if files.binary_search_by(|file| file.path.cmp(&scene)).is_err() {
            let shown: String = scene.chars().take(100).collect();
            return Err(WireError::new(
                "manifest.scene",
                format!("{shown:?} is not among the files"),
            ));
        }
        Ok(Self { scene, files })
    }
}

impl From<JobSettings> for wire::Settings {
    fn from(settings: JobSettings) -> Self {
        let schedule = match settings.schedule {
            ScheduleKind::Pass => wire::Schedule::Pass,
            ScheduleKind::Beam => wire::Schedule::Beam,
        };
        Self {
            seed: settings.seed,
            alpha: settings.alpha,
            schedule: schedule.into(),
            paths_per_pass: settings.paths_per_pass,
            reference_paths: settings.reference_paths,
            budget: settings.budget.map(|budget| wire::Budget {
                passes: budget.passes,
                scale: budget.scale,
            }),
            media_finder: technique_to_wire(settings.techniques.media).into(),
            surface_finder: technique_to_wire(settings.techniques.surfaces).into(),
            caustic_finder: technique_to_wire(settings.techniques.caustics).into(),
            aimed: settings.techniques.aimed,
            gpu_bits: settings.engine.gpu_bits(),
        }
    }
}

fn technique_to_wire(technique: Option<Technique>) -> wire::Finder {
    match technique {
        None => wire::Finder::Unspecified,
        Some(Technique::Photons) => wire::Finder::Photons,
        Some(Technique::Paths) => wire::Finder::Paths,
    }
}

fn technique_from_wire(number: i32, field: &'static str) -> Result<Option<Technique>, WireError> {
    match wire::Finder::try_from(number) {
        Ok(wire::Finder::Unspecified) => Ok(None),
        Ok(wire::Finder::Photons) => Ok(Some(Technique::Photons)),
        Ok(wire::Finder::Paths) => Ok(Some(Technique::Paths)),
        Err(_) => Err(WireError::new(field, "expected PHOTONS or PATHS")),
    }
}

impl TryFrom<wire::Settings> for JobSettings {
    type Error = WireError;
    fn try_from(settings: wire::Settings) -> Result<Self, WireError> {
        let schedule = match settings.schedule() {
            wire::Schedule::Pass => ScheduleKind::Pass,
            wire::Schedule::Beam => ScheduleKind::Beam,
            wire::Schedule::Unspecified => {
                return Err(WireError::new("settings.schedule", "expected PASS or BEAM"));
            }
        };
        let settings = Self {
            seed: settings.seed,
            alpha: settings.alpha,
            schedule,
            budget: settings.budget.map(|budget| Budget {
                passes: budget.passes,
                scale: budget.scale,
            }),
            paths_per_pass: settings.paths_per_pass,
            reference_paths: settings.reference_paths,
            techniques: Techniques {
                media: technique_from_wire(settings.media_finder, "settings.media_finder")?,
                surfaces: technique_from_wire(settings.surface_finder, "settings.surface_finder")?,
                caustics: technique_from_wire(settings.caustic_finder, "settings.caustic_finder")?,
                aimed: settings.aimed,
            },
            engine: EngineKind::of_gpu_bits(settings.gpu_bits).ok_or_else(|| {
                let expected = EngineKind::Gpu.gpu_bits();
                WireError::new(
                    "settings.gpu_bits",
                    format!("{}; expected {expected}, or 0", settings.gpu_bits),
                )
            })?,
        };
        match settings.check() {
            Ok(()) => Ok(settings),
            Err(error) => Err(WireError::new("settings", error.to_string())),
        }
    }
}

impl From<Block> for wire::Block {
    fn from(block: Block) -> Self {
        Self {
            level: block.level,
            index: block.index,
        }
    }
}

impl TryFrom<wire::Block> for Block {
    type Error = WireError;
    fn try_from(block: wire::Block) -> Result<Self, WireError> {
        let beyond = || WireError::new("block", format!("expected passes below {MAX_PASSES}"));
        Self::new(block.level, block.index).ok_or_else(beyond)
    }
}

impl From<PassStats> for wire::PassStats {
    fn from(stats: PassStats) -> Self {
        Self {
            paths: stats.paths,
            beams: stats.beams,
            beam_bytes: stats.beam_bytes,
            surface_photons: stats.surface_photons,
            beam_evaluations: stats.beam_evaluations,
            non_finite: stats.non_finite,
        }
    }
}

impl From<wire::PassStats> for PassStats {
    fn from(stats: wire::PassStats) -> Self {
        Self {
            paths: stats.paths,
            beams: stats.beams,
            beam_bytes: stats.beam_bytes,
            surface_photons: stats.surface_photons,
            beam_evaluations: stats.beam_evaluations,
            non_finite: stats.non_finite,
        }
    }
}

impl From<Grant> for wire::LeaseReply {
    fn from(grant: Grant) -> Self {
        use wire::lease_reply::Outcome;
        let outcome = match grant {
            Grant::Lease(lease, block) => Outcome::Lease(wire::Lease {
                lease: lease.0,
                block: Some(block.into()),
            }),
            Grant::NotNow => Outcome::NotNow(wire::NotNow {}),
            Grant::Done => Outcome::Done(wire::Done {}),
            Grant::Elsewhere => Outcome::Elsewhere(wire::Elsewhere {}),
        };
        Self { outcome: Some(outcome) }
    }
}

impl TryFrom<wire::LeaseReply> for Grant {
    type Error = WireError;
    fn try_from(reply: wire::LeaseReply) -> Result<Self, WireError> {
        use wire::lease_reply::Outcome;
        Ok(match require(reply.outcome, "outcome")? {
            Outcome::Lease(lease) => {
                Self::Lease(LeaseId(lease.lease), require(lease.block, "lease.block")?.try_into()?)
            }
            Outcome::NotNow(_) => Self::NotNow,
            Outcome::Done(_) => Self::Done,
            Outcome::Elsewhere(_) => Self::Elsewhere,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamfarm_image::layer::LightGroup;

    pub(super) fn settings() -> JobSettings {
        JobSettings {
            seed: u64::MAX,
            alpha: 0.7,
            schedule: ScheduleKind::Beam,
            budget: Some(Budget {
                passes: 1 << 40,
                scale: 0.1,
            }),
            paths_per_pass: 5,
            reference_paths: 6,
            techniques: Techniques {
                media: Some(Technique::Paths),
                surfaces: None,
                caustics: Some(Technique::Photons),
                aimed: Some(true),
            },
            engine: EngineKind::Gpu,
        }
    }

    #[test]
    fn a_job_survives_the_wire() {
        let file = |path: &str| FileEntry {
            path: path.into(),
            hash: FileHash::of(path.as_bytes()),
            size: 3,
        };
        let job = Job {
            scene: SceneHash([7; 32]),
            manifest: Manifest {
                scene: "b.toml".into(),
                files: vec![file("a.ply"), file("b.toml")],
            },
            settings: settings(),
            width: 3,
            height: 4,
            layers: vec![Layer::Volume, Layer::Light(LightGroup::named("key"))],
        };
        assert_eq!(Job::try_from(wire::Job::from(&job)), Ok(job));
    }

    #[test]
    fn grants_survive_the_wire() {
        let block = Block { level: 3, index: 9 };
        for grant in [
            Grant::Lease(LeaseId(4), block),
            Grant::NotNow,
            Grant::Done,
            Grant::Elsewhere,
        ] {
            assert_eq!(Grant::try_from(wire::LeaseReply::from(grant)), Ok(grant));
        }
    }

    #[test]
    fn impossible_settings_are_refused() {
        for alpha in [0.0, 1.0, -0.5, f64::NAN, f64::INFINITY] {
            let wire = wire::Settings {
                alpha,
                ..settings().into()
            };
            let error = JobSettings::try_from(wire).unwrap_err();
            assert_eq!(error.field, "settings");
        }
        let wire = wire::Settings {
            paths_per_pass: 0,
            ..settings().into()
        };
        assert!(JobSettings::try_from(wire).is_err());
        let wire = wire::Settings {
            gpu_bits: EngineKind::Gpu.gpu_bits() + 1,
            ..settings().into()
        };
        let error = JobSettings::try_from(wire).unwrap_err();
        assert_eq!(error.field, "settings.gpu_bits");
        let wire = wire::Settings {
            schedule: 17,
            ..settings().into()
        };
        assert!(JobSettings::try_from(wire).is_err());
    }

    #[test]
    fn blocks_past_the_last_pass_are_refused() {
        for (level, index) in [(64, 0), (u32::MAX, 1), (0, u64::MAX), (0, MAX_PASSES), (53, 1)] {
            assert!(Block::try_from(wire::Block { level, index }).is_err());
        }
        for (level, index) in [(0, 0), (0, MAX_PASSES - 1), (53, 0), (5, 77)] {
            assert!(Block::try_from(wire::Block { level, index }).is_ok());
        }
    }

    #[test]
    fn manifests_are_checked() {
        let file = |(path, size): (&str, u64)| wire::FileEntry {
            path: path.into(),
            hash: Bytes::from_static(&[0; 32]),
            size,
        };
        let convert = |scene: &str, files: &[(&str, u64)]| {
            let manifest = wire::Manifest {
                scene: scene.into(),
                files: files.iter().copied().map(file).collect(),
            };
            Manifest::try_from(manifest).map_err(|error| error.to_string())
        };
        assert!(convert("a", &[("a", 0), ("b", MAX_BYTES)]).is_ok());
        let path = "manifest.files: the path";
        let ascending = "manifest.files: expected ascending paths, each once";
        for (scene, files, expected) in [
            (
                "a",
                &[("b", 0), ("a", 0)][..],
                format!("{ascending}, found \"a\" after \"b\""),
            ),
            (
                "a",
                &[("a", 0), ("a", 0)],
                format!("{ascending}, found \"a\" after \"a\""),
            ),
            (
                "a",
                &[("../b", 0), ("a", 0)],
                format!("{path} \"../b\" has the component `..`"),
            ),
            ("a", &[("/b", 0), ("a", 0)], format!("{path} \"/b\" is absolute")),
            (
                "a",
                &[("a", 1), ("b", MAX_BYTES)],
                format!("manifest.files: with \"b\" of {MAX_BYTES} bytes they take more than {MAX_BYTES}"),
            ),
            (
                "a",
                &[("a", u64::MAX), ("b", u64::MAX)],
                format!(
                    "manifest.files: with \"a\" of {} bytes they take more than {MAX_BYTES}",
                    u64::MAX
                ),
            ),
            (
                "c",
                &[("a", 0), ("b", 0)],
                "manifest.scene: \"c\" is not among the files".into(),
            ),
            ("c", &[], "manifest.scene: \"c\" is not among the files".into()),
        ] {
            assert_eq!(convert(scene, files), Err(expected));
        }
        let many = vec![("a", 0); MAX_FILES + 1];
        let error = convert("a", &many).unwrap_err();
        assert_eq!(error, "manifest.files: 16385 files; expected at most 16384");
    }
}
