//! How a command fails: a message and an exit code.

use beamfarm_coordinator::store::StoreError;
use beamfarm_image::error::ImageError;
use beamfarm_scene::SceneError;
use beamfarm_worker::complain;
use beamfarm_worker::engine::{EngineError, NotRendered};
use beamfarm_worker::exit;
use beamfarm_worker::security::with_hint;
use std::fmt::Display;
use std::io;
use std::process::ExitCode;

/// Start of the message for an unreachable coordinator; its address is appended.
pub const UNREACHABLE: &str = "cannot reach the coordinator";

/// Why a command failed.
#[derive(Debug)]
pub struct Failure {
    code: u8,
    message: String,
    may_pass: bool,
    cause: Cause,
}

/// The cause, for programs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Cause {
    /// See the exit code.
    #[default]
    Other,
    /// The scene, with all its errors.
    Scene(Vec<SceneError>),
    /// There is no device for passes, or it failed.
    Device,
    /// There is not enough memory.
    Memory,
}

impl Failure {
    pub(crate) fn usage(message: impl Display) -> Self {
        Self::new(exit::USAGE, format!("error: {message}"))
    }
    pub(crate) fn io(message: impl Display) -> Self {
        Self::new(exit::IO, format!("error: {message}"))
    }
    pub(crate) fn nothing(message: impl Display) -> Self {
        Self::new(exit::NOTHING, format!("error: {message}"))
    }
    pub(crate) fn job(message: impl Display) -> Self {
        Self::new(exit::FAILED, format!("error: {message}"))
    }
    pub(crate) fn unreachable(message: impl Display) -> Self {
        Self::new(exit::UNREACHABLE, format!("error: {message}"))
    }
    pub(crate) fn refused(message: impl Display) -> Self {
        Self::new(exit::REFUSED, format!("error: {message}"))
    }
    pub(crate) fn preempted(message: impl Display) -> Self {
        Self::new(exit::PREEMPTED, format!("error: {message}"))
    }
    fn new(code: u8, message: String) -> Self {
        Self {
            code,
            message,
            may_pass: false,
            cause: Cause::Other,
        }
    }
    /// There is not enough memory.
    pub(crate) fn memory(message: impl Display) -> Self {
        Self {
            cause: Cause::Memory,
            ..Self::io(message)
        }
    }
    /// The cause.
    pub fn cause(&self) -> &Cause {
        &self.cause
    }
    /// The exit code.
    pub fn code(&self) -> u8 {
        self.code
    }
    /// From an error of the operating system.
    pub fn because_of(error: &io::Error, message: impl Display) -> Self {
        Self {
            may_pass: may_pass(error.kind()) && error.kind() != io::ErrorKind::NotFound,
            ..Self::io(message)
        }
    }
    /// The same for writing to a folder that existed before.
    fn of_writing(error: &io::Error, message: impl Display) -> Self {
        Self {
            may_pass: may_pass(error.kind()),
            ..Self::io(message)
        }
    }
    /// The same with additional information.
    pub fn and(self, more: &str) -> Self {
        Self {
            message: format!("{}; {more}", self.message),
            ..self
        }
    }
    /// The same, marked as temporary: its cause existed before and may recover.
    pub fn passing(self) -> Self {
        Self { may_pass: true, ..self }
    }
    /// Whether a later attempt may succeed without a change of the request, for example when a disk is full.
    pub fn may_pass(&self) -> bool {
        self.may_pass
    }
    /// Add the address of an unreachable coordinator, and what else may be wrong.
    pub fn with_hint(self, url: &str) -> Self {
        match self.code {
            exit::UNREACHABLE => {
                let named = self
                    .message
                    .replacen(UNREACHABLE, &format!("{UNREACHABLE} at {url}"), 1);
                Self::new(self.code, with_hint(url, named))
            }
            _ => self,
        }
    }
    pub(crate) fn report(self) -> ExitCode {
        complain!("{}", self.message);
        ExitCode::from(self.code)
    }
}

impl Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message)
    }
}

/// One line each.
impl From<Vec<SceneError>> for Failure {
    fn from(errors: Vec<SceneError>) -> Self {
        let lines: Vec<String> = errors.iter().map(ToString::to_string).collect();
        Self {
            cause: Cause::Scene(errors),
            ..Self::new(exit::USAGE, lines.join("\n"))
        }
    }
}

/// As compilers do, with file and line first, so that editors can jump there.
impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        vec![error].into()
    }
}

impl From<ImageError> for Failure {
    fn from(error: ImageError) -> Self {
        match &error {
            ImageError::Io { source, .. } => Self::of_writing(source, &error),
            _ => Self::io(error),
        }
    }
}

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Io { ref source, .. } => Self::of_writing(source, &error),
            StoreError::InUse(_) => Self::io(error),
            _ => Self::usage(error),
        }
    }
}

impl From<EngineError> for Failure {
    fn from(error: EngineError) -> Self {
        let failure = match error {
            EngineError::NotBuilt | EngineError::Scene(_) => Self::usage(error),
            EngineError::NoDevice(_) | EngineError::Broke(_) => Self::io(error),
        };
        Self {
            cause: Cause::Device,
            ..failure
        }
    }
}

impl From<NotRendered> for Failure {
    fn from(error: NotRendered) -> Self {
        match error {
            NotRendered::Pass(why) => Self::job(why),
            NotRendered::Machine(why) => why.into(),
        }
    }
}

/// Whether an error is temporary and outside the program: disk space, network, a file system that is away. Most system
/// errors are, and some have no named kind, so the permanent ones are listed.
fn may_pass(kind: io::ErrorKind) -> bool {
    use io::ErrorKind::{
        AlreadyExists, FileTooLarge, InvalidData, InvalidFilename, InvalidInput, IsADirectory, NotADirectory,
        PermissionDenied, Unsupported,
    };
    !matches!(
        kind,
        AlreadyExists
            | FileTooLarge
            | InvalidData
            | InvalidFilename
            | InvalidInput
            | IsADirectory
            | NotADirectory
            | PermissionDenied
            | Unsupported
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use io::ErrorKind;

    /// Also if it is wrapped in other errors. A folder that never existed is a different matter.
    #[test]
    fn disks_that_are_full_or_gone_may_come_back() {
        // EIO has no named kind.
        let gone = io::Error::from_raw_os_error(5).kind();
        for (kind, expected) in [
            (ErrorKind::StorageFull, true),
            (ErrorKind::QuotaExceeded, true),
            (ErrorKind::ReadOnlyFilesystem, true),
            (ErrorKind::StaleNetworkFileHandle, true),
            (ErrorKind::NotConnected, true),
            (ErrorKind::NotFound, true),
            (gone, true),
            (ErrorKind::PermissionDenied, false),
            // A file size limit.
            (ErrorKind::FileTooLarge, false),
        ] {
            let path = std::path::PathBuf::from("a.exr");
            let image: Failure = ImageError::Io {
                path: path.clone(),
                source: kind.into(),
            }
            .into();
            let store: Failure = StoreError::Io {
                path,
                source: kind.into(),
            }
            .into();
            for failure in [image, store] {
                assert_eq!(failure.may_pass(), expected, "{failure}");
                assert!(failure.to_string().starts_with("error: a.exr: "), "{failure}");
                assert_eq!(failure.code, exit::IO);
            }
        }
        let missing = Failure::because_of(&ErrorKind::NotFound.into(), "a folder");
        assert!(!missing.may_pass() && missing.passing().may_pass());
        assert!(!Failure::io("a.exr: no space").may_pass());
    }
}
