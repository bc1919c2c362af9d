//! The Python package, as it would be installed: its Python files, the module that was just built, and the command.
//!
//! `BEAMFARM_PYTHON` may name a Python with numpy. What needs more (mypy, nbclient) is left out, and said, where that
//! is not there.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Where what was built lies: this test is in a folder below.
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

#[test]
fn the_package_does_what_it_says() {
    let python = std::env::var("BEAMFARM_PYTHON").unwrap_or_else(|_| "python3".into());
    let has_numpy = Command::new(&python).args(["-c", "import numpy"]).output();
    if !has_numpy.is_ok_and(|done| done.status.success()) {
        eprintln!("SKIPPED: the Python package: {python} has no numpy");
        return;
    }
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let site = tempfile::tempdir().unwrap();
    let package = site.path().join("beamfarm");
    copy(&here.join("package/beamfarm"), &package);
    let (module, command) = match std::env::consts::OS {
        "windows" => ("_native.dll", "beamfarm.exe"),
        "macos" => ("lib_native.dylib", "beamfarm"),
        _ => ("lib_native.so", "beamfarm"),
    };
    let module = [built().join(module), built().join("deps").join(module)];
    let module = module.iter().find(|path| path.is_file()).expect("the module was built");
    let extension = if cfg!(windows) { "_native.pyd" } else { "_native.abi3.so" };
    std::fs::copy(module, package.join(extension)).unwrap();
    let done = Command::new(&python)
        .args(["-m", "unittest", "discover", "--buffer"])
        .current_dir(here.join("tests"))
        .env("PYTHONPATH", site.path())
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .env("BEAMFARM_PROGRAM", built().join(command))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&done.stderr);
    eprintln!("{said}");
    assert!(done.status.success(), "{said}");
}
