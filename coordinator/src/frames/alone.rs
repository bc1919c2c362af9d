//! Ensures that only one command at a time renders frames of one name into a folder, and removes leftovers of earlier
//! ones.

use super::names::Names;
use crate::failure::Failure;
use beamfarm_image::atomic::{folder_of, remove_leftovers_of};
use beamfarm_image::input;
use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use tracing::warn;

/// Held while frames of one name are rendered. The lock ends with its process; its file is removed at the end.
pub struct Alone {
    path: PathBuf,
    _lock: File,
}

impl Alone {
    /// Fails if another command writes this report and thus frames of the same names. `None` if files cannot be locked
    /// or written; writing then reports its own error.
    pub fn at(report: &Path) -> Result<Option<Self>, Failure> {
        // Named like a temporary file, so that a leftover is removed in the same way.
        let name = report.file_name().unwrap_or_default().to_string_lossy();
        let path = report.with_file_name(format!(".beamfarm-{name}-lock"));
        loop {
            let mut options = File::options();
            options.write(true).create(true).truncate(false);
            let lock = match input::open_as(&path, &mut options, false) {
                Ok(lock) => lock,
                Err(error) => {
                    warn!("{}: {error}; two commands may render the same frames", path.display());
                    return Ok(None);
                }
            };
            match lock.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    return Err(Failure::io(format!(
                        "{}: another command renders frames of this name into this folder: wait for it, or name others \
                         with -o",
                        report.display()
                    )));
                }
                Err(TryLockError::Error(error)) => {
                    warn!("{}: {error}; two commands may render the same frames", path.display());
                    return Ok(None);
                }
            }
            // The previous holder may have removed it in between.
            if is_at(&lock, &path) {
                return Ok(Some(Self { path, _lock: lock }));
            }
        }
    }
}

impl Drop for Alone {
    fn drop(&mut self) {
        // If it stays, the next command reuses it.
        let _ = std::fs::remove_file(&self.path);
    }
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |found: std::fs::Metadata| (found.dev(), found.ino());
    file.metadata().ok().map(id) == std::fs::metadata(path).ok().map(id)
}

#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

/// Remove partial files of these frames left by killed commands, including frames that need no rendering.
pub fn clear(names: &Names, frames: &[i64]) {
    let report = names.report();
    let file_name = |path: &Path| Some(path.file_name()?.to_string_lossy().into_owned());
    let images = frames.iter().flat_map(|frame| names.images(*frame));
    let endings = ["exr", "png", "csv", "denoised.exr", "denoised.png"];
    let ours: BTreeSet<String> = images
        .flat_map(|image| endings.map(|ending| image.with_extension(ending)))
        .chain([report.clone()])
        .filter_map(|path| file_name(&path))
        .collect();
    // If they stay, they only take disk space.
    let _ = remove_leftovers_of(folder_of(&report), |name| ours.contains(name));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_is_refused_and_the_third_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let report = folder.path().join("f.report.json");
        let lock = folder.path().join(".beamfarm-f.report.json-lock");
        let first = Alone::at(&report).unwrap();
        let refused = Alone::at(&report).err().unwrap().to_string();
        assert!(
            refused.ends_with(
                "f.report.json: another command renders frames of this name into this folder: wait for it, or name \
                 others with -o"
            ),
            "{refused}"
        );
        // Frames of other names have another report.
        assert!(Alone::at(&folder.path().join("g.report.json")).unwrap().is_some());
        drop(first);
        assert!(!lock.exists());
        // The lock file of a killed command blocks nobody.
        std::fs::write(&lock, "").unwrap();
        assert!(Alone::at(&report).unwrap().is_some());
    }
}
