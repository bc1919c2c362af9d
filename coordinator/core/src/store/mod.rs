//! The job directory: what a job needs to continue after its coordinator was killed, and its results.
//!
//! | file | |
//! | --- | --- |
//! | `job.json` | what the job renders: [`Description`] |
//! | `scene/HASH` | the scene's files, named by content hash |
//! | `checkpoint-0`, `checkpoint-1` | the sum of the passes, written alternately: [`Checkpoint`] |
//! | `ledger.jsonl` | the events of each block, one per line, appended |
//! | `report.json` | the job's state when a coordinator ends: [`Report`] |
//! | `lock` | held by the coordinator that uses the directory |
//!
//! Only checkpoints decide which passes are done; the ledger says who rendered them. Blocks that arrived after the last
//! checkpoint are rendered again, as the same blocks if the ledger lists them, and compared with its hashes.

mod checkpoint;
mod description;
mod folder;
mod joined;
mod keeper;
mod lines;
mod report;

pub use checkpoint::{Checkpoint, Shape};
pub use description::{Description, Looks};
pub use folder::{Asked, Folder, Resumed};
pub use keeper::{Keeper, RETRY};
pub use report::{BiasReport, FirefliesReport, PartBiasReport, Report, Stopped};

use std::io;
use std::path::{Path, PathBuf};

/// A job directory that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder at fault.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// Another coordinator is using it.
    #[error("{}: another coordinator uses this job directory", .0.display())]
    InUse(PathBuf),
    /// The directory does not exist.
    #[error("{}: no job to resume", .0.display())]
    Missing(PathBuf),
    /// The directory already exists.
    #[error("{}: there is a job already", .0.display())]
    Exists(PathBuf),
    /// The path holds something else.
    #[error("{}: not a job directory: {message}", path.display())]
    Foreign {
        /// The file or folder at fault.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// It holds a different job.
    #[error("{}: holds another job: {differences}", path.display())]
    Different {
        /// The directory.
        path: PathBuf,
        /// What differs, except for the scene.
        differences: String,
        /// The scene file in the directory, if it differs.
        scene: Option<String>,
    },
}

impl StoreError {
    fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }
}
