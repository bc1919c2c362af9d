//! File paths as scene files write them.

use std::path::{Component, Path, PathBuf};

/// The relative path from a folder to a file, by names alone. Absolute paths stay absolute unless the file is in the
/// folder.
pub fn relative(file: &Path, folder: &Path) -> PathBuf {
    if let Ok(inner) = file.strip_prefix(folder) {
        return inner.to_path_buf();
    }
    let (Ok(file), Ok(folder)) = (std::path::absolute(file), std::path::absolute(folder)) else {
        return file.to_path_buf();
    };
    let (file, folder) = (plain(&file), plain(&folder));
    let (mut to, mut from) = (file.components().peekable(), folder.components().peekable());
    while let (Some(a), Some(b)) = (to.peek(), from.peek()) {
        if a != b {
            break;
        }
        to.next();
        from.next();
    }
    from.map(|_| Component::ParentDir).chain(to).collect()
}

/// A path with `.` removed and `..` resolved.
pub fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => {
                plain.pop();
            }
            other => plain.push(other),
        }
    }
    plain
}
