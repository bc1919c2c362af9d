//! Files that a scene names, decoded: meshes, images and volumes. Nothing that their headers claim is believed before
//! the bytes are there.
//!
//! A crate of its own, since it is built with all optimisation, and the text of scenes is not.

#[cfg(test)]
mod damage;
pub mod draco;
pub mod elements;
pub mod image;
pub mod mesh;
pub mod meshopt;
mod parallel;
mod ply_number;
pub mod strands;
pub mod volume;

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

/// The line, from one, of a byte of a text.
pub fn line_of(text: &[u8], byte: usize) -> usize {
    let before = text.get(..byte).unwrap_or(text);
    1 + before.iter().filter(|b| **b == b'\n').count()
}
