//! Which files a scene may read: those in its folder, those that its user names, and no others.

use crate::disk::read_file;
use crate::paths::plain;
use beamfarm_image::atomic::folder_of;
use beamfarm_image::input;
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What a web page is told about every file it may not read, whether it exists or not.
const NOT_THERE: &str = "there is no such file in the scene's folder";
const HELP: &str = "`--allow-outside DIR` lets the scene read all that is in DIR";
/// Extensions of files that name other files.
const KINDS: [&str; 4] = ["glb", "gltf", "obj", "xml"];
/// How many outside files a note names.
const NAMED: usize = 5;

/// Where a path was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Written {
    /// In the file that the user gave, or on the command line: it may name any file.
    ByUser,
    /// In a file that another file names.
    Elsewhere,
    /// By someone with access to a live view's web page.
    ByPage,
}

/// The readable files: those in the scene file's folder, in folders that the user allows, and the files elsewhere that
/// the scene file itself names, including the folders of such files that name others. Links count as their targets.
#[derive(Debug)]
pub struct Reach {
    /// As written, absolute.
    folder: PathBuf,
    /// The folder with links resolved.
    root: Option<PathBuf>,
    /// Other allowed folders, links resolved.
    allowed: Vec<PathBuf>,
    named: Mutex<Named>,
}

/// What the scene file itself names elsewhere.
#[derive(Debug, Default)]
struct Named {
    /// As written, absolute.
    paths: BTreeSet<PathBuf>,
    /// Folders with links resolved.
    folders: BTreeSet<PathBuf>,
    /// Files elsewhere that were read, links resolved.
    in_use: BTreeSet<PathBuf>,
    /// Those allowed by the scene file alone, as named.
    asked: Vec<PathBuf>,
}

impl Reach {
    /// The reach of a scene file, plus everything below the folders in `allowed`.
    pub fn new(scene: &Path, allowed: &[PathBuf]) -> Self {
        let folder = folder_of(scene);
        Self {
            folder: absolute(folder),
            // A missing folder contains no files.
            root: folder.canonicalize().ok(),
            allowed: allowed.iter().filter_map(|folder| folder.canonicalize().ok()).collect(),
            named: Mutex::default(),
        }
    }

    /// The bytes of a file, at most `most`. The error does not name the file.
    pub fn read(&self, path: &Path, most: u64, written: Written) -> Result<Vec<u8>, String> {
        let path = self.find(path, written)?;
        read_file(&path, most).map_err(|reason| match written {
            Written::ByPage if !path.is_file() => NOT_THERE.to_owned(),
            _ => reason,
        })
    }

    /// The first bytes of a file, at most `bytes`.
    pub fn start(&self, path: &Path, bytes: usize, written: Written) -> Result<Vec<u8>, String> {
        let path = self.find(path, written)?;
        let file = input::open(&path).map_err(|error| error.to_string())?;
        let mut start = Vec::new();
        let read = file.take(bytes as u64).read_to_end(&mut start);
        read.map(|_| start).map_err(|error| error.to_string())
    }

    /// Record that the user's file names this one.
    pub fn named_by_user(&self, path: &Path) {
        self.named().paths.insert(absolute(path));
    }

    /// Allow everything below a folder that the user's file names.
    pub fn allow(&self, folder: &Path) {
        if let Ok(folder) = folder.canonicalize() {
            self.named().folders.insert(folder);
        }
    }

    /// A one-line note on the files outside the folder that the scene file names.
    pub fn note(&self) -> Option<String> {
        let named = self.named();
        let asked = &named.asked;
        let mut names: Vec<String> = asked
            .iter()
            .take(NAMED)
            .map(|path| path.display().to_string())
            .collect();
        if asked.len() > NAMED {
            names.push(format!("{} more", asked.len() - NAMED));
        }
        (!names.is_empty()).then(|| {
            format!(
                "it names files outside of its folder, which are read: {}",
                names.join(", ")
            )
        })
    }

    fn named(&self) -> MutexGuard<'_, Named> {
        self.named.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The file with links resolved, if it may be read.
    fn find(&self, path: &Path, written: Written) -> Result<PathBuf, String> {
        let found = path.canonicalize();
        let mut named = self.named();
        if let Ok(found) = &found {
            let is_below = |folder: &PathBuf| found.starts_with(folder);
            if self.root.as_ref().is_some_and(is_below) || named.in_use.contains(found) {
                return Ok(found.clone());
            }
            let is_allowed = self.allowed.iter().any(is_below);
            if written != Written::ByPage && (is_allowed || named.folders.iter().any(is_below)) {
                named.in_use.insert(found.clone());
                if !is_allowed {
                    named.asked.push(path.to_owned());
                }
                return Ok(found.clone());
            }
        }
        if written == Written::ByPage {
            return Err(NOT_THERE.to_owned());
        }
        let way = absolute(path);
        let is_within = [&self.folder]
            .into_iter()
            .chain(&self.root)
            .any(|folder| way.starts_with(folder));
        let is_by_user = written == Written::ByUser || named.paths.contains(&way);
        match found {
            Ok(found) if is_by_user && !is_within => {
                named.in_use.insert(found.clone());
                named.asked.push(path.to_owned());
                if names_others(&found)
                    && let Some(folder) = found.parent()
                {
                    named.folders.insert(folder.to_owned());
                }
                Ok(found)
            }
            Err(error) if is_by_user || is_within => Err(error.to_string()),
            Ok(_) if is_within => Err(format!("a link leads out of the scene's folder; {HELP}")),
            // A file must not learn whether the files it names exist.
            _ => Err(format!(
                "it lies outside of the scene's folder, where only the scene file itself may name files; {HELP}"
            )),
        }
    }
}

/// Whether a file is of a kind that names others, which may then be next to it.
fn names_others(path: &Path) -> bool {
    let is = |ending: &OsStr| KINDS.iter().any(|kind| ending.eq_ignore_ascii_case(kind));
    path.extension().is_some_and(is)
}

fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).map_or_else(|_| path.to_owned(), |path| plain(&path))
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::symlink;

    /// A scene's folder with a file, a neighbouring folder with one, and one elsewhere.
    struct Disk {
        folder: tempfile::TempDir,
    }

    impl Disk {
        fn new() -> Self {
            let folder = tempfile::tempdir().unwrap();
            for name in ["scene/in", "scene/deep/in", "beside/out", "beside/scene/out", "far/out"] {
                let path = folder.path().join(name);
                fs::create_dir_all(path.parent().unwrap()).unwrap();
                fs::write(path, "bytes").unwrap();
            }
            symlink("../beside/out", folder.path().join("scene/linked")).unwrap();
            symlink("../beside", folder.path().join("scene/way")).unwrap();
            symlink("in", folder.path().join("scene/same")).unwrap();
            symlink("scene", folder.path().join("alias")).unwrap();
            Self { folder }
        }

        fn path(&self, name: &str) -> PathBuf {
            self.folder.path().join(name)
        }

        fn reach(&self, allowed: &[&str]) -> Reach {
            let allowed: Vec<PathBuf> = allowed.iter().map(|name| self.path(name)).collect();
            Reach::new(&self.path("scene/a.toml"), &allowed)
        }
    }

    const INSIDE: [&str; 6] = [
        "scene/in",
        "scene/./deep/../in",
        "scene/same",
        "beside/../scene/deep/in",
        "alias/in",
        "scene/way/../scene/in",
    ];
    const OUTSIDE: [&str; 4] = [
        "scene/../beside/out",
        "beside/out",
        "beside/scene/out",
        "scene/../far/out",
    ];
    const LINKED: [&str; 2] = ["scene/linked", "scene/way/out"];
    const NOWHERE: [&str; 5] = [
        "beside/none",
        "scene/none",
        "scene/way/none",
        "scene/../none/none",
        "scene/in/none",
    ];

    /// Everyone may read the folder, only the user may name files outside, and links do not extend that.
    #[test]
    fn who_may_read_what() {
        let disk = Disk::new();
        for (names, by_user, by_others) in [
            (&INSIDE[..], true, true),
            (&OUTSIDE, true, false),
            (&LINKED, false, false),
            (&NOWHERE, false, false),
        ] {
            for name in names {
                for written in [Written::ByUser, Written::Elsewhere, Written::ByPage] {
                    let expected = if written == Written::ByUser { by_user } else { by_others };
                    let read = disk.reach(&[]).read(&disk.path(name), 9, written);
                    assert_eq!(read.is_ok(), expected, "{name}, {written:?}: {read:?}");
                }
            }
        }
        // Through a folder name that is itself a link.
        let by_alias = Reach::new(&disk.path("alias/a.toml"), &[]);
        for name in INSIDE {
            assert!(by_alias.read(&disk.path(name), 9, Written::ByPage).is_ok(), "{name}");
        }
    }

    #[test]
    fn folders_beside_are_allowed_by_name() {
        let disk = Disk::new();
        let reach = disk.reach(&["beside", "nowhere"]);
        for name in [&OUTSIDE[1..3]].concat() {
            let read = |written| reach.read(&disk.path(name), 9, written);
            assert!(read(Written::ByPage).is_err(), "{name}");
            assert!(read(Written::Elsewhere).is_ok(), "{name}");
            assert!(read(Written::ByPage).is_ok(), "{name}");
        }
        let far = |reach: &Reach, written| reach.read(&disk.path("far/out"), 9, written);
        assert!(far(&reach, Written::Elsewhere).is_err());
        assert_eq!(reach.note(), None);
        reach.allow(&disk.path("far"));
        assert!(far(&reach, Written::Elsewhere).is_ok());
    }

    #[test]
    fn what_the_user_has_named_stays_in_use() {
        let disk = Disk::new();
        let reach = disk.reach(&[]);
        let read = |name: &str, written| reach.read(&disk.path(name), 9, written);
        assert!(read("beside/out", Written::ByPage).is_err());
        assert!(read("beside/out", Written::ByUser).is_ok());
        assert!(read("scene/../beside/out", Written::ByPage).is_ok());
        assert!(read("far/out", Written::ByPage).is_err());
        let note = reach.note().unwrap();
        assert!(
            note.ends_with("beside/out") && note.matches("beside/out").count() == 1,
            "{note}"
        );
    }

    /// Errors do not reveal what else is on the disk.
    #[test]
    fn errors_do_not_tell_what_is_there() {
        let disk = Disk::new();
        let reach = disk.reach(&[]);
        let said = |name: &str, written| reach.read(&disk.path(name), 9, written).unwrap_err();
        let all = [
            &OUTSIDE[..],
            &LINKED,
            &NOWHERE,
            &["beside", "scene", "scene/deep", "/dev/zero"],
        ]
        .concat();
        for name in all {
            assert_eq!(said(name, Written::ByPage), NOT_THERE, "{name}");
        }
        for name in OUTSIDE {
            assert_eq!(said(name, Written::Elsewhere), said("beside/none", Written::Elsewhere));
            assert!(said(name, Written::Elsewhere).contains("`--allow-outside DIR`"));
        }
    }
}
