//! The job directory: what a job needs to go on after its coordinator was killed, and what it leaves behind.
//!
//! | file | |
//! | --- | --- |
//! | `job.json` | what is rendered: [`Description`] |
//! | `scene/HASH` | the files of the scene, by the hash of their content |
//! | `checkpoint-0`, `checkpoint-1` | the sum of the passes, written in turns: [`Checkpoint`] |
//! | `ledger.jsonl` | what became of each block, a line each, appended |
//! | `report.json` | how the job stands, when a coordinator ends: [`Report`] |
//! | `lock` | held by the coordinator that uses the directory |
//!
//! Checkpoints alone decide what is there; the ledger says who rendered it. Blocks that came in after the last
//! checkpoint are rendered again, as the same blocks if the ledger knows of them, and compared with what it says.

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
        /// What it said.
        source: io::Error,
    },
    /// Another coordinator is at work in it.
    #[error("{}: another coordinator uses this job directory", .0.display())]
    InUse(PathBuf),
    /// There is none.
    #[error("{}: no job to resume", .0.display())]
    Missing(PathBuf),
    /// There is one already.
    #[error("{}: there is a job already", .0.display())]
    Exists(PathBuf),
    /// There is something else.
    #[error("{}: not a job directory: {message}", path.display())]
    Foreign {
        /// The file or folder at fault.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// It holds another job than the one asked for.
    #[error("{}: holds another job: {differences}", path.display())]
    Different {
        /// The directory.
        path: PathBuf,
        /// What differs, but for the scene.
        differences: String,
        /// The scene file there, if it is another one.
        scene: Option<String>,
    },
}

impl StoreError {
    fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }
}
