//! The scene bundle: the scene file and every asset that it names, as bytes addressed by their content.

use crate::job::SceneHash;
use std::collections::BTreeMap;

/// Most files in a bundle.
pub const MAX_FILES: usize = 1 << 14;
/// Most bytes in all files of a bundle together.
pub const MAX_BYTES: u64 = 1 << 36;
/// Longest key, bytes of UTF-8.
pub const MAX_KEY_BYTES: usize = 1024;

/// A scene and its assets. Keys are made by [`key`] from the paths in the scene file, relative to the scene's folder,
/// so that unpacking a bundle never leaves a folder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bundle {
    /// Key of the scene file.
    pub scene: String,
    /// Contents of every file, including the scene file.
    pub files: BTreeMap<String, Vec<u8>>,
}

impl Bundle {
    /// BLAKE3 over the scene's key, and every file's key and BLAKE3 in the order of keys.
    pub fn hash(&self) -> SceneHash {
        let hashed = |(path, bytes): (_, &Vec<u8>)| (path, *blake3::hash(bytes).as_bytes());
        let files = self.files.iter().map(|(path, bytes)| (path.as_str(), bytes));
        hash_of(&self.scene, files.map(hashed))
    }
}

/// The hash of the bundle with this scene and these files: key and BLAKE3 of each, in the order of keys.
pub fn hash_of<'a>(scene: &str, files: impl IntoIterator<Item = (&'a str, [u8; 32])>) -> SceneHash {
    let mut hasher = blake3::Hasher::new();
    let mut field = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    field(scene.as_bytes());
    for (path, hash) in files {
        field(path.as_bytes());
        field(&hash);
    }
    SceneHash(*hasher.finalize().as_bytes())
}

/// The key of a file that a scene names by this path: a relative path that stays below the scene's folder on every
/// system.
///
/// Plain paths are their own keys. `.` and doubled slashes are dropped; `..` becomes `%2E%2E`, and a root in front
/// `%2F`. Characters that some systems do not read as part of a name (`\\`, `:`, control characters), and `%` itself,
/// are escaped as in URLs. Paths of different files have different keys.
pub fn key(path: &str) -> String {
    let mut key = String::new();
    let mut push = |part: &str| {
        if !key.is_empty() {
            key.push('/');
        }
        key.push_str(part);
    };
    if path.starts_with('/') {
        push("%2F");
    }
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => push("%2E%2E"),
            _ => push(&escaped(part)),
        }
    }
    match key.is_empty() {
        // The folder itself, which is not a file.
        true => "%2E".to_string(),
        false => key,
    }
}

fn escaped(part: &str) -> String {
    let mut name = String::with_capacity(part.len());
    for c in part.chars() {
        match is_plain(c) && c != '%' {
            true => name.push(c),
            false => {
                let mut utf8 = [0; 4];
                for byte in c.encode_utf8(&mut utf8).bytes() {
                    name.push_str(&format!("%{byte:02X}"));
                }
            }
        }
    }
    name
}

fn is_plain(c: char) -> bool {
    !c.is_control() && c != '\\' && c != ':'
}

/// Checks that a foreign key is a relative path that stays below its folder on every system; the error says what is
/// wrong.
pub fn check_key(key: &str) -> Result<(), String> {
    let wrong = |what: &str| {
        let shown: String = key.chars().take(100).collect();
        Err(format!("the path {shown:?} {what}"))
    };
    if key.len() > MAX_KEY_BYTES {
        return wrong(&format!("is longer than {MAX_KEY_BYTES} bytes"));
    }
    if key.starts_with('/') {
        return wrong("is absolute");
    }
    for part in key.split('/') {
        match part {
            "" => return wrong("has an empty component"),
            "." | ".." => return wrong(&format!("has the component `{part}`")),
            _ if !part.chars().all(is_plain) => {
                return wrong("has a backslash, a colon or a control character");
            }
            _ => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    #[test]
    fn keys_stay_below_their_folder() {
        for (path, expected) in [
            ("a.png", "a.png"),
            ("tex/wood oak.png", "tex/wood oak.png"),
            ("./tex//./a.png", "tex/a.png"),
            ("../tex/a.png", "%2E%2E/tex/a.png"),
            ("tex/../../a.png", "tex/%2E%2E/%2E%2E/a.png"),
            ("/etc/passwd", "%2F/etc/passwd"),
            ("//host/a", "%2F/host/a"),
            ("C:\\tex\\a.png", "C%3A%5Ctex%5Ca.png"),
            ("..\\a.png", "..%5Ca.png"),
            ("100%.png", "100%25.png"),
            ("%2E%2E/a.png", "%252E%252E/a.png"),
            ("a\0b\u{85}", "a%00b%C2%85"),
            ("...", "..."),
            ("größe.png", "größe.png"),
            ("", "%2E"),
            ("./", "%2E"),
        ] {
            assert_eq!(key(path), expected);
            assert_eq!(check_key(expected), Ok(()));
        }
    }

    #[test]
    fn keys_from_elsewhere_are_checked() {
        for (key, reason) in [
            ("", "has an empty component"),
            ("/a", "is absolute"),
            ("a//b", "has an empty component"),
            ("a/", "has an empty component"),
            ("../a", "has the component `..`"),
            ("a/./b", "has the component `.`"),
            ("a/..", "has the component `..`"),
            ("C:a", "has a backslash, a colon or a control character"),
            ("..\\a", "has a backslash, a colon or a control character"),
            ("a\0", "has a backslash, a colon or a control character"),
        ] {
            assert_eq!(check_key(key), Err(format!("the path {key:?} {reason}")));
        }
        let long = "ab/".repeat(MAX_KEY_BYTES);
        assert_eq!(check_key(&long[..MAX_KEY_BYTES]), Ok(()));
        let error = check_key(&long[..MAX_KEY_BYTES + 1]).unwrap_err();
        assert!(error.ends_with("is longer than 1024 bytes") && error.len() < 200);
    }

    /// The path without what does not affect which file it names.
    fn normal(path: &str) -> (bool, Vec<&str>) {
        let parts = path.split('/').filter(|part| !matches!(*part, "" | "."));
        (path.starts_with('/'), parts.collect())
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(20), ..ProptestConfig::default() })]
        #[test]
        fn keys_are_confined_and_tell_files_apart(
            a in "[/.%2EFab:\\\\\0]{0,8}",
            b in "[/.%2EFab:\\\\\0]{0,8}",
        ) {
            prop_assert_eq!(check_key(&key(&a)), Ok(()));
            prop_assert_eq!(key(&a) == key(&b), normal(&a) == normal(&b), "{:?}, {:?}", key(&a), key(&b));
        }
    }
}
