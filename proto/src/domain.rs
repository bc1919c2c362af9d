//! The farm's messages as domain types.

use beamfarm_image::bundle::Bundle;
use beamfarm_image::job::{Block, EngineKind, JobSettings, SceneHash};
use beamfarm_image::layer::Layer;
use std::fmt;

/// A worker's secret key, shown in each of its calls and known to nobody else. Never displayed.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct WorkerKey(pub u64);

impl std::fmt::Debug for WorkerKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("WorkerKey(..)")
    }
}

/// A worker's number at one coordinator, for logs and tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WorkerId(pub u64);

/// A lease's number at one coordinator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LeaseId(pub u64);

/// BLAKE3 of a file's bytes.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FileHash(pub [u8; 32]);

impl FileHash {
    /// The hash of some bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Self(*blake3::hash(bytes).as_bytes())
    }
}

impl fmt::Display for FileHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for FileHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// A file of a bundle, without its bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileEntry {
    /// Its key in the bundle: a relative path below the bundle's folder.
    pub path: String,
    /// Hash of its bytes.
    pub hash: FileHash,
    /// Size in bytes.
    pub size: u64,
}

/// The files of a bundle, without their bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Manifest {
    /// Key of the scene file.
    pub scene: String,
    /// The files, ordered by path.
    pub files: Vec<FileEntry>,
}

impl From<&Bundle> for Manifest {
    fn from(bundle: &Bundle) -> Self {
        let entry = |(path, bytes): (&String, &Vec<u8>)| FileEntry {
            path: path.clone(),
            hash: FileHash::of(bytes),
            size: bytes.len() as u64,
        };
        Self {
            scene: bundle.scene.clone(),
            files: bundle.files.iter().map(entry).collect(),
        }
    }
}

/// A job whose passes a worker renders.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Hash of the scene bundle.
    pub scene: SceneHash,
    /// Its files.
    pub manifest: Manifest,
    /// What passes depend on in addition to the scene.
    pub settings: JobSettings,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Layers other than radiance.
    pub layers: Vec<Layer>,
}

/// The answer to a worker's request for work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grant {
    /// Render this block.
    Lease(LeaseId, Block),
    /// Ask again later.
    NotNow,
    /// There will be no more work.
    Done,
    /// Another job has work.
    Elsewhere,
}

/// An engine that a worker offers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Offer {
    /// The engine.
    pub engine: EngineKind,
    /// Hash of its test render; `None` if it has not rendered it yet.
    pub canary: Option<[u8; 32]>,
    /// The device, unless processors render.
    pub device: Option<Device>,
}

/// A device, as its driver describes it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Device {
    /// Its name.
    pub name: String,
    /// `discrete`, `integrated`, `virtual`, `software` or `other`.
    pub kind: String,
    /// The driver's name and version.
    pub driver: String,
    /// Bytes of its memory, or of the memory it shares with the processor.
    pub memory: Option<u64>,
}

/// Writes its name, kind, and memory in GiB.
impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {}", self.name, self.kind)?;
        match self.memory {
            Some(bytes) => write!(f, ", {:.1} GiB", bytes as f64 / f64::from(1 << 30)),
            None => Ok(()),
        }
    }
}

/// An engine that a worker does not offer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lack {
    /// The engine.
    pub engine: EngineKind,
    /// The reason.
    pub reason: String,
}
