//! Errors of a worker.

use crate::engine::EngineError;
use beamfarm_scene::SceneError;

/// Why a worker stopped before its job ended.
#[derive(Debug, thiserror::Error)]
pub enum WorkerError {
    /// The coordinator's address is invalid.
    #[error("{url}: expected http://HOST:PORT or https://HOST:PORT ({message})")]
    Address {
        /// The given address.
        url: String,
        /// What is wrong with it.
        message: String,
    },
    /// A certificate, a key or the token cannot be read.
    #[error("{0}")]
    Security(String),
    /// Options that contradict each other.
    #[error("{0}")]
    Usage(String),
    /// The coordinator is unreachable, from the start or by now.
    #[error("cannot reach the coordinator at {url}: {message}")]
    Unreachable {
        /// Its address.
        url: String,
        /// Message of the last attempt.
        message: String,
    },
    /// The coordinator rejects this worker.
    #[error("refused by the coordinator: {0}")]
    Refused(String),
    /// The job's scene cannot be read here.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// This worker lacks what it was to offer, or the job's engine.
    #[error("{0}")]
    Engine(#[from] EngineError),
    /// Its rendering hangs.
    #[error("{0}")]
    Stuck(String),
    /// Anything else.
    #[error("{0}")]
    Internal(String),
}
