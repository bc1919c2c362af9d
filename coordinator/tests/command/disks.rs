//! Disks that fill up, turn read-only or disappear, and come back: everything that was to be written exists in the end.

#![cfg(target_os = "linux")]

use crate::frames;
use crate::setup::{beamfarm, folder_with, line, scene, spawn, succeed, text, wait_until};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread::scope;
use tempfile::TempDir;

/// What happens to a disk.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ill {
    Full,
    ReadOnly,
    /// It cannot be found at all.
    Gone,
}

const ALL: [Ill; 3] = [Ill::Full, Ill::ReadOnly, Ill::Gone];

/// A file system of its own.
struct Disk {
    at: PathBuf,
    /// Mounts at this place, stacked.
    mounts: u32,
}

fn mount(args: &[&str], at: &Path) {
    let output = Command::new("mount").args(args).arg(at).output().unwrap();
    assert!(output.status.success(), "{args:?}: {}", text(&output.stderr));
}

impl Disk {
    fn new(at: PathBuf) -> Self {
        std::fs::create_dir(&at).unwrap();
        mount(&["-t", "tmpfs", "-o", "size=4m", "none"], &at);
        Self { at, mounts: 1 }
    }

    fn fall(&mut self, ill: Ill) {
        match ill {
            Ill::Full => {
                let mut ballast = std::fs::File::create(self.at.join("ballast")).unwrap();
                // Fills the remaining space, finally byte by byte.
                for size in [4096, 1] {
                    while std::io::Write::write_all(&mut ballast, &vec![0; size]).is_ok() {}
                }
                return;
            }
            Ill::ReadOnly => {
                let itself = self.at.to_str().unwrap();
                mount(&["--bind", itself], &self.at);
                mount(&["-o", "remount,bind,ro"], &self.at);
            }
            Ill::Gone => mount(&["-t", "tmpfs", "-o", "ro", "none"], &self.at),
        }
        self.mounts += 1;
    }

    fn recover(&mut self, ill: Ill) {
        match ill {
            Ill::Full => std::fs::remove_file(self.at.join("ballast")).unwrap(),
            Ill::ReadOnly | Ill::Gone => self.take_off(),
        }
    }

    fn take_off(&mut self) {
        self.mounts -= 1;
        // Something may still be open there.
        let status = Command::new("umount").arg("-l").arg(&self.at).status();
        assert!(status.unwrap().success());
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        while self.mounts > 0 {
            self.take_off();
        }
    }
}

/// A command whose folder is on `disk`, which fails.
struct Trial {
    folder: TempDir,
    disk: Disk,
    ill: Ill,
    args: Vec<&'static str>,
}

impl Trial {
    fn new(folder: TempDir, ill: Ill, args: &[&'static str]) -> Self {
        let disk = Disk::new(folder.path().join("disk"));
        let args = args.to_vec();
        Self {
            folder,
            disk,
            ill,
            args,
        }
    }

    /// Runs it. The disk fails when the command has begun, and recovers when the command reports a new attempt. Returns
    /// what it prints.
    fn run(&mut self) -> String {
        // Commands remove this once they have checked that they can write there.
        let leftover = self.disk.at.join(".beamfarm-a.exr-left");
        std::fs::write(&leftover, "").unwrap();
        let mut process = spawn(beamfarm(self.folder.path(), &self.args));
        match self.args.contains(&"disk/a.exr") {
            true => wait_until("beginning", || {
                (!leftover.exists()).then_some(()).ok_or_else(String::new)
            }),
            false => process.log.wait_for("page: ").truncate(0),
        }
        // Nothing happens in between.
        process.signal("-STOP");
        self.disk.fall(self.ill);
        process.signal("-CONT");
        process.log.wait_for("another attempt follows in 5s");
        self.disk.recover(self.ill);
        let output = process.finish();
        assert!(output.status.success(), "{}: {}", self.name(), text(&output.stderr));
        text(&output.stdout).to_owned()
    }

    fn name(&self) -> String {
        format!("{:?} for {:?}", self.ill, self.args)
    }

    fn has(&self, names: &[&str]) {
        let mut found: Vec<String> = std::fs::read_dir(&self.disk.at)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        found.sort();
        assert_eq!(found, names, "{}", self.name());
    }
}

fn still() -> TempDir {
    folder_with(&scene([24, 16], 40, 400))
}

fn pixels(stdout: &str) -> &str {
    line(stdout, "pixels ")
}

/// After an afternoon's work, only the image is left to tell of it.
fn an_image(ill: Ill) {
    let folder = still();
    let undisturbed = succeed(folder.path(), &["render", "scene.toml"]);
    let mut trial = Trial::new(folder, ill, &["render", "scene.toml", "-o", "disk/a.exr"]);
    let stdout = trial.run();
    assert_eq!(pixels(&stdout), pixels(&undisturbed), "{}", trial.name());
    trial.has(&["a.csv", "a.exr", "a.png"]);
}

fn a_reference(ill: Ill) {
    let args = ["reference", "scene.toml", "--samples", "100", "-o"];
    let undisturbed = still();
    succeed(undisturbed.path(), &[&args[..], &["a.exr"]].concat());
    let mut trial = Trial::new(still(), ill, &[&args[..], &["disk/a.exr"]].concat());
    trial.run();
    trial.has(&["a.exr", "a.png"]);
    let image = |path: PathBuf| beamfarm_image::exr::read_rgb(&path).unwrap();
    let [found, expected] = [trial.disk.at.join("a.exr"), undisturbed.path().join("a.exr")].map(image);
    assert!(found == expected, "{}", trial.name());
}

/// The folder holds everything that the image holds.
fn a_job(ill: Ill) {
    let folder = still();
    let undisturbed = succeed(folder.path(), &["render", "scene.toml"]);
    let mut trial = Trial::new(
        folder,
        ill,
        &["render", "scene.toml", "-o", "a.exr", "--job", "disk/a.job"],
    );
    let stdout = trial.run();
    assert_eq!(pixels(&stdout), pixels(&undisturbed), "{}", trial.name());
    let report = frames::report(&trial.disk.at.join("a.job/report.json"));
    assert_eq!(
        (&report["stopped"], &report["passes"]),
        (&"complete".into(), &40.into())
    );
    let again = succeed(trial.folder.path(), &trial.args);
    assert!(again.contains("resuming disk/a.job with 40 passes"), "{again}");
    assert_eq!(pixels(&again), pixels(&undisturbed), "{}", trial.name());
}

/// Later frames wait as well, and none is left out. `args`: what is on the disk.
fn all_frames(ill: Ill, args: &[&'static str]) {
    let folder = frames::folder(3);
    let path = folder.path();
    let expected = frames::alone(path, 3, &[]);
    let args = [&["render", "--frames", "1-3"], args].concat();
    let mut trial = Trial::new(folder, ill, &args);
    for file in ["scene.toml", "floor.obj"] {
        std::fs::copy(trial.folder.path().join(file), trial.disk.at.join(file)).unwrap();
    }
    let stdout = trial.run();
    assert!(stdout.contains("3 of 3 frames are there"), "{}: {stdout}", trial.name());
    let named = trial.args.iter().find(|arg| arg.ends_with("f.#.exr")).unwrap();
    let report = trial.folder.path().join(named.replace("#.exr", "report.json"));
    assert_eq!(
        frames::of_frame(&frames::report(&report), 3)["pixels"],
        expected,
        "{}",
        trial.name()
    );
}

#[test]
#[cfg_attr(not(can_mount), ignore = "needs the right to mount file systems")]
fn what_a_disk_does_not_take_is_written_when_it_does() {
    // They spend most of their time waiting.
    scope(|scope| {
        for ill in ALL {
            scope.spawn(move || an_image(ill));
            scope.spawn(move || a_job(ill));
        }
        scope.spawn(|| a_reference(Ill::ReadOnly));
        for ill in [Ill::ReadOnly, Ill::Gone] {
            scope.spawn(move || all_frames(ill, &["scene.toml", "-o", "disk/f.#.exr", "--job", "disk/jobs"]));
        }
        scope.spawn(|| all_frames(Ill::Gone, &["disk/scene.toml", "-o", "f.#.exr"]));
    });
}
