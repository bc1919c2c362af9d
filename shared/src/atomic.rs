//! Files that appear whole or not at all.

use crate::error::ImageError;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

/// Write `bytes` to `path` such that whoever looks, even after a loss of power, finds the old file or the new one.
///
/// A temporary file in the same folder is written and synced, renamed over `path`, and the folder is synced.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    write(path, bytes).map_err(|source| ImageError::Io {
        path: path.to_owned(),
        source,
    })
}

fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".beamfarm-");
    #[cfg(unix)]
    {
        // As a file made without the detour would have; the process's mask still applies.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(path).map_err(|error| error.error)?;
    sync_folder(folder)
}

#[cfg(unix)]
fn sync_folder(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}

/// Other systems cannot open a folder as a file.
#[cfg(not(unix))]
fn sync_folder(_folder: &Path) -> io::Result<()> {
    Ok(())
}
