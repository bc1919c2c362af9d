//! Errors that name the file at fault.

use std::path::PathBuf;

/// A scene that cannot be rendered. `Display` gives `file:line: message`, as compilers do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}{}: {message}", file.display(), line.map(|l| format!(":{l}")).unwrap_or_default())]
pub struct SceneError {
    /// The file at fault: the scene, or one of its assets.
    pub file: PathBuf,
    /// Line in that file, from one, if known.
    pub line: Option<usize>,
    /// What is wrong, in which field, and what was expected.
    pub message: String,
}
