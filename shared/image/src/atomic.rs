//! Files that appear whole or not at all.

use crate::error::ImageError;
use crate::input;
use std::ffi::{OsStr, OsString};
use std::io::{self, Write};
use std::path::Path;

/// Write `bytes` to `path` so that readers find either the old file or the new one, even after a power loss.
///
/// Writes and syncs a temporary file in the same folder, renames it to `path`, and syncs the folder.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    write(path, bytes).map_err(|source| ImageError::Io {
        path: path.to_owned(),
        source,
    })
}

/// Remove temporary files that processes left next to this file when they were killed while writing it. A file that
/// another process is writing now stays.
pub fn remove_leftovers(path: &Path) -> io::Result<()> {
    let prefix = prefix(path);
    remove_unlocked(folder_of(path), |name| {
        name.as_encoded_bytes().starts_with(prefix.as_encoded_bytes())
    })
}

/// The same for all files of a folder whose names satisfy `is_ours`, in one pass over the folder.
pub fn remove_leftovers_of(folder: &Path, is_ours: impl Fn(&str) -> bool) -> io::Result<()> {
    remove_unlocked(folder, |name| {
        let told = name.to_str().and_then(|name| name.strip_prefix(PREFIX));
        told.and_then(|told| told.rsplit_once('-'))
            .is_some_and(|(name, _)| is_ours(name))
    })
}

fn remove_unlocked(folder: &Path, is_leftover: impl Fn(&OsStr) -> bool) -> io::Result<()> {
    for entry in folder.read_dir()? {
        let entry = entry?;
        if !is_leftover(&entry.file_name()) {
            continue;
        }
        // Whoever writes the file holds its lock.
        if let Ok(file) = input::open(&entry.path())
            && file.try_lock().is_ok()
        {
            std::fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

/// The folder that a file is in.
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Prefix of the names of temporary files.
const PREFIX: &str = ".beamfarm-";

/// The name of a temporary file for this one, up to the random part.
fn prefix(path: &Path) -> OsString {
    let mut prefix = OsString::from(PREFIX);
    // Leaves out a long name, so that the whole stays short enough.
    let name = path.file_name().filter(|name| name.len() <= LONGEST);
    prefix.push(name.unwrap_or_default());
    prefix.push("-");
    prefix
}

/// Longest name that its temporary file's name repeats, bytes.
const LONGEST: usize = 200;

fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = folder_of(path);
    let prefix = prefix(path);
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix);
    #[cfg(unix)]
    {
        // The permissions of a file made directly; the process's mask still applies.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = loop {
        let file = builder.tempfile_in(folder)?;
        // Locking fails where there are no locks. Before it was locked, the file may have been removed as a leftover.
        let _ = file.as_file().try_lock();
        if file.path().try_exists()? {
            break file;
        }
    };
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(path).map_err(|error| error.error)?;
    sync_folder(folder)
}

/// Wait until the names of a folder's files are on the disk.
#[cfg(unix)]
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    std::fs::File::open(folder)?.sync_all()
}

/// Other systems cannot open a folder as a file.
#[cfg(not(unix))]
pub fn sync_folder(_folder: &Path) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::File;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect()
    }

    #[test]
    fn a_file_is_replaced_and_nothing_left_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        for bytes in [&b"first"[..], b"second, longer", b""] {
            write_file(&path, bytes).unwrap();
            assert_eq!(std::fs::read(&path).unwrap(), bytes);
            assert_eq!(names(folder.path()), ["file"]);
        }
    }

    #[test]
    fn leftovers_of_those_that_are_gone_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let temporary = |name: &str| File::create(folder.path().join(name)).unwrap();
        let busy = temporary(".beamfarm-a.exr-busy");
        busy.try_lock().unwrap();
        for name in [".beamfarm-a.exr-left", ".beamfarm-b.exr-other", "a.exr"] {
            temporary(name);
        }
        remove_leftovers(&path).unwrap();
        let mut left = names(folder.path());
        left.sort();
        assert_eq!(left, [".beamfarm-a.exr-busy", ".beamfarm-b.exr-other", "a.exr"]);
    }

    #[test]
    fn leftovers_of_many_files_are_told_by_the_names_of_these() {
        let folder = tempfile::tempdir().unwrap();
        let temporary = |name: &str| File::create(folder.path().join(name)).unwrap();
        let busy = temporary(".beamfarm-a-1.exr-busy");
        busy.try_lock().unwrap();
        for name in [
            ".beamfarm-a-1.exr-left",
            ".beamfarm-a-1.png-left",
            ".beamfarm-a-2.exr-left",
            ".beamfarm-a-1.exr",
            ".beamfarm-left",
            "a-1.exr-left",
        ] {
            temporary(name);
        }
        remove_leftovers_of(folder.path(), |name| ["a-1.exr", "a-1.png"].contains(&name)).unwrap();
        let mut left = names(folder.path());
        left.sort();
        let stay = [
            ".beamfarm-a-1.exr",
            ".beamfarm-a-1.exr-busy",
            ".beamfarm-a-2.exr-left",
            ".beamfarm-left",
            "a-1.exr-left",
        ];
        assert_eq!(left, stay);
    }

    /// Whoever made the folder may have put something there that no program can read.
    #[cfg(unix)]
    #[test]
    fn what_is_no_file_is_no_leftover() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join(".beamfarm-a.exr-pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        remove_leftovers(&folder.path().join("a.exr")).unwrap();
        assert_eq!(names(folder.path()), [".beamfarm-a.exr-pipe"]);
    }

    #[test]
    fn a_failure_names_the_file_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let error = write_file(&folder.path().join("missing").join("file"), b"")
            .unwrap_err()
            .to_string();
        assert!(error.contains("missing"), "{error}");
        // A folder is in the way: the rename fails.
        let taken = folder.path().join("taken");
        std::fs::create_dir_all(taken.join("inside")).unwrap();
        assert!(write_file(&taken, b"bytes").is_err());
        assert_eq!(names(folder.path()), ["taken"]);
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_what_the_mask_lets_them() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (path, plain) = (folder.path().join("file"), folder.path().join("plain"));
        write_file(&path, b"").unwrap();
        std::fs::write(&plain, b"").unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&path), mode(&plain));
    }
}
