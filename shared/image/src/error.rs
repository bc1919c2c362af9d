//! Errors that name the file or field at fault.

use std::path::PathBuf;

/// An image that cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The operating system reported an error.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder at fault.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The file is not a usable image.
    #[error("{}: {message}", path.display())]
    File {
        /// The file at fault.
        path: PathBuf,
        /// What is wrong and what was expected.
        message: String,
    },
    /// Bytes from another machine are not the expected block image.
    #[error("block image: {field}: {message}")]
    Block {
        /// The part of the image at fault.
        field: &'static str,
        /// What is wrong and what was expected.
        message: String,
    },
    /// The block is well formed, but the sum refuses it.
    #[error(transparent)]
    Merge(#[from] crate::merge::MergeError),
    /// An image that EXR or PNG cannot represent.
    #[error("cannot encode {field}: {message}")]
    Encode {
        /// The part of the image at fault.
        field: &'static str,
        /// What is wrong and what was expected.
        message: String,
    },
}
