//! Files that a scene names: meshes and images. Nothing that their headers claim is believed before the bytes are there.

pub mod image;
pub mod mesh;
mod obj;
mod ply;

/// What is wrong with an asset.
#[derive(Debug)]
pub struct Flaw {
    /// Line from one, for text formats where it can be told.
    pub line: Option<usize>,
    /// What is wrong and what was expected.
    pub message: String,
}

impl<M: Into<String>> From<M> for Flaw {
    fn from(message: M) -> Self {
        Self {
            line: None,
            message: message.into(),
        }
    }
}
