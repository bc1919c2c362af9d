//! Configuration of a worker.

use crate::security::Credentials;
use std::path::PathBuf;
use std::time::Duration;

/// Configuration of a worker, from its command line.
#[derive(Clone, Debug)]
pub struct Config {
    /// Coordinator, as http://host:port or https://host:port.
    pub url: String,
    /// Its own credentials, and the authorities that it trusts.
    pub credentials: Credentials,
    /// Rendering threads, at least one.
    pub threads: usize,
    /// Blocks of passes rendered at the same time, at least one. They share the threads: a thread that has to wait in
    /// one works on another. `None`: as suits the job's engine.
    pub at_once: Option<usize>,
    /// Name for the coordinator's log.
    pub name: String,
    /// Folder for its secret; `None`: it registers as a stranger.
    pub state: Option<PathBuf>,
    /// Folder for scene files; `None` keeps them in memory only.
    pub cache: Option<PathBuf>,
    /// How long to keep trying to reach the coordinator.
    pub patience: Duration,
    /// How long to go on rendering and delivering after a request to finish.
    pub grace: Duration,
}
