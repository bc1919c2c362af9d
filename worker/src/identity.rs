//! The file with a worker's secret.

use beamfarm_image::atomic::folder_of;
use beamfarm_image::input;
use beamfarm_proto::Identity;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;
use tracing::{info, warn};

/// Characters of the worker's name that its file name keeps.
const NAME: usize = 64;
/// More than any secret's file has.
const MOST_BYTES: u64 = 256;

/// The secret of a worker with this name, kept in a folder and made at the first start. A worker that cannot keep one
/// is a stranger each time.
///
/// # Errors
/// There are no random numbers, or the file has other content.
pub fn of(folder: Option<&Path>, name: &str) -> Result<Identity, String> {
    let Some(folder) = folder else {
        return Identity::random();
    };
    let path = folder.join(file_name(name));
    if let Some(known) = read(&path)? {
        return Ok(known);
    }
    let own = Identity::random()?;
    match keep(&path, &own) {
        Ok(()) => info!(
            "{} is made: it is what the worker is known by, {}",
            path.display(),
            own.fingerprint()
        ),
        Err(error) => {
            warn!(
                "{}: {error}; the worker will be a stranger at its next start",
                path.display()
            );
            return Ok(own);
        }
    }
    // If several start at the same time, one of them has made it.
    Ok(read(&path)?.unwrap_or(own))
}

/// `beamfarm` in the user's state folder, if there is one.
pub fn default_folder() -> Option<PathBuf> {
    let set = |name| std::env::var_os(name).filter(|value| !value.is_empty());
    let state = set("XDG_STATE_HOME").map(PathBuf::from);
    let state = state.or_else(|| set("HOME").map(|home| PathBuf::from(home).join(".local/state")));
    state.map(|state| state.join("beamfarm"))
}

/// Machines share users' folders: the name tells them apart.
fn file_name(name: &str) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() || "-_.".contains(c) {
            c
        } else {
            '_'
        }
    };
    let text: String = name.chars().take(NAME).map(plain).collect();
    // Distinguishes names that look alike after this.
    let hash = blake3::hash(name.as_bytes()).to_hex();
    format!("worker-{text}-{}.key", &hash[..8])
}

fn read(path: &Path) -> Result<Option<Identity>, String> {
    let bytes = match input::read(path, MOST_BYTES) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        // As without a usable folder.
        Err(error) if [io::ErrorKind::PermissionDenied, io::ErrorKind::NotADirectory].contains(&error.kind()) => {
            return Ok(None);
        }
        Err(error) => return Err(format!("{}: {error}", path.display())),
    };
    let wrong = || {
        format!(
            "{}: expected 64 hexadecimal digits; delete it for a new one",
            path.display()
        )
    };
    let hash = blake3::Hash::from_hex(bytes.trim_ascii()).map_err(|_| wrong())?;
    Identity::from_bytes(hash.as_bytes()).map(Some).ok_or_else(wrong)
}

fn keep(path: &Path, identity: &Identity) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let text: String = identity.reveal().iter().map(|byte| format!("{byte:02x}")).collect();
    // Readable by its owner only.
    let mut file = NamedTempFile::new_in(folder_of(path))?;
    writeln!(file, "{text}")?;
    file.as_file().sync_all()?;
    match file.persist_noclobber(path) {
        Ok(_) => Ok(()),
        Err(error) if error.error.kind() == io::ErrorKind::AlreadyExists => Ok(()),
        Err(error) => Err(error.error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_worker_is_the_same_at_its_next_start() {
        let folder = tempfile::tempdir().unwrap();
        let state = folder.path().join("new");
        let own = of(Some(&state), "node7").unwrap();
        assert_eq!(of(Some(&state), "node7").unwrap(), own);
        for other in ["node8", "node7/", "node7_", "../node7"] {
            assert_ne!(of(Some(&state), other).unwrap(), own);
        }
        assert_eq!(state.read_dir().unwrap().count(), 5);
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
        assert_ne!(of(None, "node7").unwrap(), own);
        #[cfg(unix)]
        for file in state.read_dir().unwrap() {
            use std::os::unix::fs::PermissionsExt;
            assert_eq!(file.unwrap().metadata().unwrap().permissions().mode() & 0o77, 0);
        }
    }

    #[test]
    fn files_that_hold_no_secret_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(file_name("desk"));
        for wrong in ["", "12", &"z".repeat(64), &"0".repeat(200)] {
            fs::write(&path, wrong).unwrap();
            let error = of(Some(folder.path()), "desk").unwrap_err();
            assert!(
                error.contains("worker-desk-") && error.contains("64 hexadecimal digits"),
                "{error}"
            );
        }
        fs::write(&path, "0".repeat(10_000)).unwrap();
        assert!(
            of(Some(folder.path()), "desk")
                .unwrap_err()
                .contains("more than 256 bytes")
        );
        fs::remove_file(&path).unwrap();
        fs::create_dir(&path).unwrap();
        assert!(of(Some(folder.path()), "desk").unwrap_err().contains("regular file"));
    }

    /// A worker that cannot keep a secret works as a stranger.
    #[test]
    fn a_worker_needs_no_folder() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        assert_ne!(of(Some(&file), "desk").ok(), of(Some(&file), "desk").ok());
    }
}
