//! Reads regular files only, up to a given size.
//!
//! A pipe has no end until somebody writes it, a device has none at all, and reading a terminal consumes its input.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{self, ErrorKind, Read};
use std::path::Path;

/// The error for a pipe, a device, a socket or a folder.
pub const NOT_A_FILE: &str = "not a regular file";

/// Open a file to read. Fails unless it is a regular file, and never waits for a writer.
pub fn open(path: &Path) -> io::Result<File> {
    open_as(path, OpenOptions::new().read(true), true)
}

/// Open a file with these options. Fails unless it is a regular file; fails on a link unless `follows` is set.
pub fn open_as(path: &Path, options: &mut OpenOptions, follows: bool) -> io::Result<File> {
    // Merely opening a device may have effects.
    let there = if follows {
        path.metadata()
    } else {
        path.symlink_metadata()
    };
    match there {
        Ok(there) => is_regular(&there)?,
        Err(error) if error.kind() == ErrorKind::NotFound => {}
        Err(error) => return Err(error),
    }
    #[cfg(unix)]
    {
        use rustix::fs::OFlags;
        use std::os::unix::fs::OpenOptionsExt;
        // Something else may have taken its place in between.
        let mut flags = OFlags::NONBLOCK | OFlags::NOCTTY;
        flags.set(OFlags::NOFOLLOW, !follows);
        options.custom_flags(flags.bits().cast_signed());
    }
    let file = options.open(path)?;
    is_regular(&file.metadata()?)?;
    Ok(file)
}

/// All bytes of a file that has at most this many.
pub fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    read_all(open(path)?, most)
}

/// The remaining bytes of an open file that has at most this many.
pub fn read_all(file: File, most: u64) -> io::Result<Vec<u8>> {
    let said = file.metadata()?.len();
    let too_large = || {
        let message = format!("it has more than {most} bytes, the most that are expected");
        io::Error::new(ErrorKind::FileTooLarge, message)
    };
    if said > most {
        return Err(too_large());
    }
    let mut bytes = Vec::with_capacity(usize::try_from(said).unwrap_or(0));
    // The file may grow meanwhile, and some files report a size of zero but are not empty.
    file.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    match bytes.len() as u64 > most {
        true => Err(too_large()),
        false => Ok(bytes),
    }
}

/// All bytes of a file that its user named, to be read once. It may be a pipe, as a shell may put in a file's place.
pub fn read_given(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    read_all(File::open(path)?, most)
}

fn is_regular(there: &Metadata) -> io::Result<()> {
    if there.is_file() {
        return Ok(());
    }
    let link = there.is_symlink();
    let message = if link {
        "it is a link to another file"
    } else {
        NOT_A_FILE
    };
    Err(io::Error::new(ErrorKind::InvalidInput, message))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_up_to_its_bound() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        for bytes in [&b""[..], b"four"] {
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(read(&path, 4).unwrap(), bytes);
        }
        let error = read(&path, 3).unwrap_err().to_string();
        assert_eq!(error, "it has more than 3 bytes, the most that are expected");
        assert_eq!(
            read(&folder.path().join("b"), 3).unwrap_err().kind(),
            ErrorKind::NotFound
        );
        assert_eq!(read(folder.path(), 3).unwrap_err().to_string(), NOT_A_FILE);
    }

    /// None of these is waited for, and none is read.
    #[cfg(target_os = "linux")]
    #[test]
    fn what_is_no_regular_file_is_refused() {
        use rustix::fs::{CWD, FileType, Mode, mknodat};
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        mknodat(CWD, at("pipe"), FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(at("socket")).unwrap();
        symlink("/dev/zero", at("zero")).unwrap();
        symlink("pipe", at("linked")).unwrap();
        for name in ["pipe", "socket", "zero", "linked", "/dev/zero", "/dev/null", "."] {
            let error = read(&at(name), 1 << 20).unwrap_err();
            assert_eq!(error.to_string(), NOT_A_FILE, "{name}");
        }
        std::fs::write(at("a"), "bytes").unwrap();
        symlink("a", at("link")).unwrap();
        symlink("nowhere", at("lost")).unwrap();
        assert_eq!(read(&at("link"), 9).unwrap(), b"bytes");
        for name in ["link", "lost"] {
            let mut append = OpenOptions::new();
            append.append(true).create(true);
            let error = open_as(&at(name), &mut append, false).unwrap_err();
            assert_eq!(error.to_string(), "it is a link to another file");
        }
        assert!(!at("nowhere").exists());
    }
}
