//! What can go wrong.

use crate::engine::EngineError;
use beamfarm_scene::SceneError;

/// Why a worker stopped before its job did.
#[derive(Debug, thiserror::Error)]
pub enum WorkerError {
    /// The coordinator's address makes no sense.
    #[error("{url}: expected http://HOST:PORT or https://HOST:PORT ({message})")]
    Address {
        /// What was given.
        url: String,
        /// What is wrong with it.
        message: String,
    },
    /// A certificate, a key or the token cannot be read.
    #[error("{0}")]
    Security(String),
    /// Options that make no sense together.
    #[error("{0}")]
    Usage(String),
    /// The coordinator cannot be reached, or no longer.
    #[error("cannot reach the coordinator at {url}: {message}")]
    Unreachable {
        /// Its address.
        url: String,
        /// What the last attempt said.
        message: String,
    },
    /// The coordinator wants nothing from this worker.
    #[error("refused by the coordinator: {0}")]
    Refused(String),
    /// The job's scene cannot be read here.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// This worker has not what it was to offer, or what the job is rendered by.
    #[error("{0}")]
    Engine(#[from] EngineError),
    /// Its rendering does not get on.
    #[error("{0}")]
    Stuck(String),
    /// Anything else.
    #[error("{0}")]
    Internal(String),
}
