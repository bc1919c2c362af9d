//! The Python package as it would be installed: its Python files, the freshly built module, and the command.
//!
//! `BEAMFARM_PYTHON` may name a Python with numpy. Tests that need more (mypy, nbclient) are skipped with a message
//! where that is missing.

#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::Command;

/// The build folder, above this test's own.
fn built() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.parent().and_then(Path::parent).unwrap().to_path_buf()
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let ending = path.extension().and_then(|ending| ending.to_str());
        if matches!(ending, Some("py" | "pyi" | "typed")) {
            std::fs::copy(&path, to.join(path.file_name().unwrap())).unwrap();
        }
    }
}

/// A Python with numpy, if there is one.
fn python() -> Option<String> {
    let python = std::env::var("BEAMFARM_PYTHON").unwrap_or_else(|_| "python3".into());
    let has_numpy = Command::new(&python).args(["-c", "import numpy"]).output();
    has_numpy.is_ok_and(|done| done.status.success()).then_some(python)
}

/// Puts the package together in this folder.
fn install(site: &Path) {
    let package = site.join("beamfarm");
    copy(&here().join("package/beamfarm"), &package);
    let module = match std::env::consts::OS {
        "windows" => "_native.dll",
        "macos" => "lib_native.dylib",
        _ => "lib_native.so",
    };
    // The module from this test's own build; one further up may be older.
    let module = built().join("deps").join(module);
    let extension = if cfg!(windows) {
        "_native.pyd"
    } else {
        "_native.abi3.so"
    };
    std::fs::copy(&module, package.join(extension)).unwrap();
}

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Runs the tests of a file. A test that hangs prints where, and fails.
const TESTS: &str = "import faulthandler, sys, unittest
faulthandler.dump_traceback_later(600, exit=True, file=sys.__stderr__)
unittest.main(module=None, buffer=True)";

/// Runs the tests of a file.
fn run(tests: &str) {
    let Some(python) = python() else {
        eprintln!("SKIPPED: the Python package: there is no Python with numpy; BEAMFARM_PYTHON may name one");
        return;
    };
    let site = tempfile::tempdir().unwrap();
    install(site.path());
    let command = if cfg!(windows) { "beamfarm.exe" } else { "beamfarm" };
    let done = Command::new(&python)
        .args(["-c", TESTS, tests])
        .current_dir(here().join("tests"))
        .env("PYTHONPATH", site.path())
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .env("BEAMFARM_PROGRAM", built().join(command))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&done.stderr);
    eprintln!("{said}");
    assert!(done.status.success(), "{said}");
}

#[test]
fn arrays() {
    run("test_arrays");
}

#[test]
fn documents() {
    run("test_docs");
}

#[test]
fn farms() {
    run("test_farm");
}

#[test]
fn notebooks() {
    run("test_notebooks");
}

#[test]
fn renders() {
    run("test_render");
}

#[test]
fn scenes() {
    run("test_scene");
}

#[test]
fn types() {
    run("test_types");
}
