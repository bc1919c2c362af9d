//! Reads files from the disk.

use crate::error::SceneError;
use beamfarm_image::{bundle, input};
use std::io::ErrorKind;
use std::path::Path;

/// The text of a scene file.
pub fn text_of<'a>(file: &Path, bytes: &'a [u8]) -> Result<&'a str, SceneError> {
    std::str::from_utf8(bytes).map_err(|e| SceneError {
        file: file.to_path_buf(),
        line: Some(beamfarm_assets::line_of(bytes, e.valid_up_to())),
        message: "the scene file is not UTF-8 text".to_string(),
    })
}

/// A regular file of at most `room` bytes.
pub fn read_file(path: &Path, room: u64) -> Result<Vec<u8>, String> {
    let bytes = input::read(path, room).map_err(|error| match error.kind() {
        ErrorKind::FileTooLarge => format!("with it the scene's files take more than {} bytes", bundle::MAX_BYTES),
        _ => error.to_string(),
    })?;
    match stand_in(&bytes) {
        Some(what) => Err(what.to_string()),
        None => Ok(bytes),
    }
}

/// Recognises a placeholder for a file that is elsewhere, and gives advice.
fn stand_in(bytes: &[u8]) -> Option<&'static str> {
    if bytes.starts_with(b"version https://git-lfs.github.com/spec/") {
        return Some("a pointer of Git LFS lies in the file's place; `git lfs pull` fetches the file");
    }
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let begins = |word: &[u8]| {
        text.get(..word.len())
            .is_some_and(|start| start.eq_ignore_ascii_case(word))
    };
    (begins(b"<!doctype html") || begins(b"<html"))
        .then_some("a web page (HTML) lies in the file's place; download the file itself, not the page that shows it")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_in_a_files_place_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        let read = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            read_file(&path, 1000)
        };
        let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 3\n";
        assert!(read(pointer.as_bytes()).unwrap_err().contains("`git lfs pull`"));
        for page in ["<!DOCTYPE html><title>404</title>", "\u{feff}\n <HTML lang=\"en\">"] {
            assert!(
                read(page.as_bytes()).unwrap_err().starts_with("a web page (HTML)"),
                "{page}"
            );
        }
        for other in [&b"<scene version=\"3.0.0\"/>"[..], b"", b"version = 1", b"# <html>"] {
            assert_eq!(read(other).unwrap(), other);
        }
    }
}
