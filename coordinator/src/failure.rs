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

/// How a message begins on a coordinator that cannot be reached, to which its address is added.
pub const UNREACHABLE: &str = "cannot reach the coordinator";

/// What a command says when it does not succeed.
#[derive(Debug)]
pub struct Failure {
    code: u8,
    message: String,
    may_pass: bool,
    cause: Cause,
}

/// What is at fault, for programs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Cause {
    /// The exit code says it.
    #[default]
    Other,
    /// The scene: all that is wrong with it.
    Scene(Vec<SceneError>),
    /// There is no device for passes, or it did not do what it was asked.
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
    /// What is at fault.
    pub fn cause(&self) -> &Cause {
        &self.cause
    }
    /// The exit code.
    pub fn code(&self) -> u8 {
        self.code
    }
    /// Of an error of the operating system.
    pub fn because_of(error: &io::Error, message: impl Display) -> Self {
        Self {
            may_pass: may_pass(error.kind()) && error.kind() != io::ErrorKind::NotFound,
            ..Self::io(message)
        }
    }
    /// The same of what is written to a folder that was there before.
    fn of_writing(error: &io::Error, message: impl Display) -> Self {
        Self {
            may_pass: may_pass(error.kind()),
            ..Self::io(message)
        }
    }
    /// The same, and what else has to be known.
    pub fn and(self, more: &str) -> Self {
        Self {
            message: format!("{}; {more}", self.message),
            ..self
        }
    }
    /// The same, which comes of something that was there before and may be there again.
    pub fn passing(self) -> Self {
        Self { may_pass: true, ..self }
    }
    /// Whether the same may succeed a little later, without anybody changing what is asked: a disk is full, say.
    pub fn may_pass(&self) -> bool {
        self.may_pass
    }
    /// Which coordinator it was that cannot be reached, at this address, and what else may be wrong.
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

/// A line each.
impl From<Vec<SceneError>> for Failure {
    fn from(errors: Vec<SceneError>) -> Self {
        let lines: Vec<String> = errors.iter().map(ToString::to_string).collect();
        Self {
            cause: Cause::Scene(errors),
            ..Self::new(exit::USAGE, lines.join("\n"))
        }
    }
}

/// As compilers do, file and line first, so that editors can jump there.
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

/// What others cause and others end: room on a disk, a network, a file system that is gone for a while. That is most
/// of what systems say, and not all of it has a name; the rest is known.
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

    /// Also when it comes through the errors of others. A folder that was never there is another matter.
    #[test]
    fn disks_that_are_full_or_gone_may_come_back() {
        // EIO has no kind with a name.
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
            // A limit on the size of files.
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
