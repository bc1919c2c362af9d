//! Files of a scene, identified by content.

use beamfarm_image::bundle::Bundle;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

/// BLAKE3 of a file's bytes.
pub type ContentHash = [u8; 32];

/// A file's bytes, shared, and their hash.
#[derive(Clone)]
pub struct File {
    hash: ContentHash,
    bytes: Arc<[u8]>,
}

impl File {
    /// A file whose hash is computed on demand.
    pub fn new(bytes: impl Into<Arc<[u8]>>) -> Self {
        let bytes = bytes.into();
        Self {
            hash: *blake3::hash(&bytes).as_bytes(),
            bytes,
        }
    }

    /// A file whose hash is already known; it must be that of these bytes.
    pub fn known(hash: ContentHash, bytes: Arc<[u8]>) -> Self {
        Self { hash, bytes }
    }

    /// The hash of its bytes.
    pub fn hash(&self) -> ContentHash {
        self.hash
    }

    /// Its bytes.
    pub fn bytes(&self) -> &Arc<[u8]> {
        &self.bytes
    }
}

impl AsRef<[u8]> for File {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

impl fmt::Debug for File {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "File({} bytes)", self.bytes.len())
    }
}

/// A bundle with shared files: cloning copies no bytes.
#[derive(Clone, Debug, Default)]
pub struct Files {
    /// Key of the scene file.
    pub scene: String,
    /// Every file by key, including the scene file.
    pub files: BTreeMap<String, File>,
}

impl Files {
    /// The same files with another scene text.
    pub fn with_text(&self, text: &str) -> Self {
        let mut files = self.clone();
        files.files.insert(self.scene.clone(), File::new(text.as_bytes()));
        files
    }
}

impl From<Bundle> for Files {
    fn from(bundle: Bundle) -> Self {
        let files = bundle.files.into_iter();
        Self {
            scene: bundle.scene,
            files: files.map(|(key, bytes)| (key, File::new(bytes))).collect(),
        }
    }
}

/// Where a scene's files are read from.
#[derive(Clone, Copy)]
pub enum Source<'a> {
    Bundle(&'a Bundle),
    Files(&'a Files),
}

/// Identifies a file by its content, or by its key if nothing outlives the scene.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Content {
    Hash(ContentHash),
    Key(String),
}

impl<'a> Source<'a> {
    /// Key of the scene file.
    pub fn scene(self) -> &'a str {
        match self {
            Self::Bundle(bundle) => &bundle.scene,
            Self::Files(files) => &files.scene,
        }
    }

    /// A file by its key.
    pub fn bytes(self, key: &str) -> Option<&'a [u8]> {
        match self {
            Self::Bundle(bundle) => bundle.files.get(key).map(Vec::as_slice),
            Self::Files(files) => files.files.get(key).map(|file| &*file.bytes),
        }
    }

    /// A file's identity.
    pub fn content(self, key: &str) -> Content {
        match self {
            Self::Files(Files { files, .. }) if files.contains_key(key) => Content::Hash(files[key].hash),
            _ => Content::Key(key.to_owned()),
        }
    }
}
