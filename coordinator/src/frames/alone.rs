//! One command at a time fills a folder with frames of one name, and clears what those before it left there.

use super::names::Names;
use crate::failure::Failure;
use beamfarm_image::atomic::{folder_of, remove_leftovers_of};
use beamfarm_image::input;
use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use tracing::warn;

/// Held while frames of one name are rendered. The lock goes with its process, and its file at the end.
pub struct Alone {
    path: PathBuf,
    _lock: File,
}

impl Alone {
    /// Refuses when another command writes this report, and so frames of the same names. Nothing where there are no
    /// locks, or where nothing can be written: what cannot be written says so itself.
    pub fn at(report: &Path) -> Result<Option<Self>, Failure> {
        // As temporary files are called, so that one that was left is cleared as they are.
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
            // Whoever held it before may have removed it in between.
            if is_at(&lock, &path) {
                return Ok(Some(Self { path, _lock: lock }));
            }
        }
    }
}

impl Drop for Alone {
    fn drop(&mut self) {
        // One that stays is taken by the next.
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

/// Remove what commands that were killed were writing of these frames, also of those that need no rendering.
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
    // If they stay, they only take room.
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
        // That of a command that was killed is in nobody's way.
        std::fs::write(&lock, "").unwrap();
        assert!(Alone::at(&report).unwrap().is_some());
    }
}
