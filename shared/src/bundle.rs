//! The scene bundle: the scene file and every asset that it names, as bytes, addressed by content.

use crate::job::SceneHash;
use std::collections::BTreeMap;

/// A scene and its assets. Keys are the paths as the scene file writes them, relative to the scene's folder; nothing is
/// ever written to disk under these names.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bundle {
    /// Key of the scene file.
    pub scene: String,
    /// Bytes of every file, the scene file among them.
    pub files: BTreeMap<String, Vec<u8>>,
}

impl Bundle {
    /// BLAKE3 over the scene's key and, in key order, every file's key and BLAKE3.
    pub fn hash(&self) -> SceneHash {
        let mut hasher = blake3::Hasher::new();
        let mut field = |bytes: &[u8]| {
            hasher.update(&(bytes.len() as u64).to_le_bytes());
            hasher.update(bytes);
        };
        field(self.scene.as_bytes());
        for (path, bytes) in &self.files {
            field(path.as_bytes());
            field(blake3::hash(bytes).as_bytes());
        }
        SceneHash(*hasher.finalize().as_bytes())
    }
}
