//! Scene files on this machine's disk, by content hash. Every file is verified before use, so the folder needs no care:
//! it may be shared, damaged, or deleted at any time.

use beamfarm_image::bundle::MAX_BYTES;
use beamfarm_image::input;
use beamfarm_proto::FileHash;
use std::io::{self, Write};
use std::path::PathBuf;

/// A cache folder, or none.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: Option<PathBuf>,
}

impl Cache {
    /// A cache in this folder, which is created on first use; `None` caches nothing.
    pub fn new(folder: Option<PathBuf>) -> Self {
        Self { folder }
    }

    /// The file with this content, if it is here and intact.
    pub fn get(&self, hash: FileHash) -> Option<Vec<u8>> {
        let bytes = input::read(&self.path(hash)?, MAX_BYTES).ok()?;
        if FileHash::of(&bytes) == hash {
            Some(bytes)
        } else {
            tracing::warn!("{hash} in the cache is damaged; fetching it again");
            None
        }
    }

    /// Stores a file atomically: readers see all of it or nothing.
    pub fn put(&self, hash: FileHash, bytes: &[u8]) -> io::Result<()> {
        let Some((path, folder)) = self.path(hash).zip(self.folder.as_ref()) else {
            return Ok(());
        };
        std::fs::create_dir_all(folder)?;
        let mut file = tempfile::NamedTempFile::new_in(folder)?;
        file.write_all(bytes)?;
        file.persist(path).map_err(|error| error.error)?;
        Ok(())
    }

    fn path(&self, hash: FileHash) -> Option<PathBuf> {
        let folder = self.folder.as_ref()?;
        Some(folder.join(hash.to_string()))
    }
}

/// `beamfarm` in the user's cache folder, or else in the folder for temporary files.
pub fn default_folder() -> PathBuf {
    let set = |name| std::env::var_os(name).filter(|value| !value.is_empty());
    let cache = set("XDG_CACHE_HOME").map(PathBuf::from);
    let cache = cache.or_else(|| set("HOME").map(|home| PathBuf::from(home).join(".cache")));
    cache.unwrap_or_else(std::env::temp_dir).join("beamfarm")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_put_is_found_and_what_is_damaged_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(Some(folder.path().join("new").join("deep")));
        let hash = FileHash::of(b"content");
        assert_eq!(cache.get(hash), None);
        cache.put(hash, b"content").unwrap();
        assert_eq!(cache.get(hash).as_deref(), Some(&b"content"[..]));
        std::fs::write(cache.path(hash).unwrap(), b"damaged").unwrap();
        assert_eq!(cache.get(hash), None);
        cache.put(hash, b"content").unwrap();
        assert_eq!(cache.get(hash).as_deref(), Some(&b"content"[..]));
        let names = std::fs::read_dir(cache.folder.as_ref().unwrap()).unwrap();
        assert_eq!(names.count(), 1, "temporary files are left over");
    }

    #[test]
    fn no_folder_keeps_nothing() {
        let cache = Cache::new(None);
        let hash = FileHash::of(b"content");
        cache.put(hash, b"content").unwrap();
        assert_eq!(cache.get(hash), None);
    }
}
