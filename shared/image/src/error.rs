//! Errors that name their culprit.

use std::path::PathBuf;

/// An image that cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder at fault.
        path: PathBuf,
        /// What it said.
        source: std::io::Error,
    },
    /// The file is not an image that can be used.
    #[error("{}: {message}", path.display())]
    File {
        /// The file at fault.
        path: PathBuf,
        /// What is wrong and what was expected.
        message: String,
    },
    /// Bytes from another machine that are not the block image they ought to be.
    #[error("block image: {field}: {message}")]
    Block {
        /// The part of the image at fault.
        field: &'static str,
        /// What is wrong and what was expected.
        message: String,
    },
    /// The block is well formed, but no sum may take it.
    #[error(transparent)]
    Merge(#[from] crate::merge::MergeError),
    /// An image that EXR or PNG has no form for.
    #[error("cannot encode {field}: {message}")]
    Encode {
        /// The part of the image at fault.
        field: &'static str,
        /// What is wrong and what was expected.
        message: String,
    },
}
