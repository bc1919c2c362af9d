//! How a command fails: a message and an exit code.

use beamfarm_coordinator::store::StoreError;
use beamfarm_image::error::ImageError;
use beamfarm_scene::SceneError;
use beamfarm_worker::complain;
use beamfarm_worker::exit;
use beamfarm_worker::security::with_hint;
use std::fmt::Display;
use std::process::ExitCode;

/// What a command says when it does not succeed.
#[derive(Debug)]
pub struct Failure {
    code: u8,
    message: String,
}

impl Failure {
    pub fn usage(message: impl Display) -> Self {
        Self::new(exit::USAGE, format!("error: {message}"))
    }
    pub fn io(message: impl Display) -> Self {
        Self::new(exit::IO, format!("error: {message}"))
    }
    pub fn nothing(message: impl Display) -> Self {
        Self::new(exit::NOTHING, format!("error: {message}"))
    }
    pub fn job(message: impl Display) -> Self {
        Self::new(exit::FAILED, format!("error: {message}"))
    }
    pub fn unreachable(message: impl Display) -> Self {
        Self::new(exit::UNREACHABLE, format!("error: {message}"))
    }
    pub fn refused(message: impl Display) -> Self {
        Self::new(exit::REFUSED, format!("error: {message}"))
    }
    pub fn preempted(message: impl Display) -> Self {
        Self::new(exit::PREEMPTED, format!("error: {message}"))
    }
    fn new(code: u8, message: String) -> Self {
        Self { code, message }
    }
    /// What else may be wrong, of a coordinator at this address that cannot be reached.
    pub fn with_hint(self, url: &str) -> Self {
        match self.code {
            exit::UNREACHABLE => Self::new(self.code, with_hint(url, self.message)),
            _ => self,
        }
    }
    pub fn report(self) -> ExitCode {
        complain!("{}", self.message);
        ExitCode::from(self.code)
    }
}

impl Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message)
    }
}

/// A line each.
impl From<Vec<SceneError>> for Failure {
    fn from(errors: Vec<SceneError>) -> Self {
        let lines: Vec<String> = errors.iter().map(ToString::to_string).collect();
        Self::new(exit::USAGE, lines.join("\n"))
    }
}

/// As compilers do, file and line first, so that editors can jump there.
impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        Self::new(exit::USAGE, error.to_string())
    }
}

impl From<ImageError> for Failure {
    fn from(error: ImageError) -> Self {
        Self::io(error)
    }
}

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Io { .. } | StoreError::InUse(_) => Self::io(error),
            _ => Self::usage(error),
        }
    }
}
