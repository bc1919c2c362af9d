//! What a worker is told.

use crate::security::Credentials;
use std::path::PathBuf;
use std::time::Duration;

/// What a worker is told on its command line.
#[derive(Clone, Debug)]
pub struct Config {
    /// Coordinator, as http://host:port or https://host:port.
    pub url: String,
    /// Who to be there, and whom to believe.
    pub credentials: Credentials,
    /// Rendering threads, at least one.
    pub threads: usize,
    /// Blocks of passes rendered at the same time, at least one. The threads share them: those that have to wait in one
    /// work at another. `None`: as suits the job's engine.
    pub at_once: Option<usize>,
    /// Name for the coordinator's log.
    pub name: String,
    /// Folder in which it keeps what it is known by; `None`: it is a stranger.
    pub state: Option<PathBuf>,
    /// Where to keep files of scenes; `None` keeps them in memory only.
    pub cache: Option<PathBuf>,
    /// How long to go on trying to reach the coordinator.
    pub patience: Duration,
    /// How long to go on rendering and delivering when told to finish.
    pub grace: Duration,
}
