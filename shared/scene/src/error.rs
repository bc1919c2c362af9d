//! Errors that name their culprit.

use std::path::PathBuf;

/// A scene that cannot be rendered. `Display` gives `file:line: message` as compilers do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}{}: {message}", file.display(), line.map(|l| format!(":{l}")).unwrap_or_default())]
pub struct SceneError {
    /// The file at fault: the scene, or one of its assets.
    pub file: PathBuf,
    /// Line in that file, from one, where it can be told.
    pub line: Option<usize>,
    /// What is wrong, which field, and what was expected.
    pub message: String,
}
