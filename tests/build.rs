//! Ignores the tests that need something this machine lacks, and says so.

use std::env::{split_paths, var_os};
use std::path::PathBuf;

/// Usual names of the browser for the test in `tests/farm/browser.rs`.
const CHROMIUM: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

fn main() {
    for name in ["BEAMFARM_CHROMIUM", "PATH"] {
        println!("cargo::rerun-if-env-changed={name}");
    }
    println!("cargo::rustc-check-cfg=cfg(has_chromium)");
    let folders: Vec<PathBuf> = var_os("PATH").map_or_else(Vec::new, |path| split_paths(&path).collect());
    let find = |program: PathBuf| {
        let places = folders.iter().map(|folder| folder.join(&program));
        places.chain([program.clone()]).find(|place| place.is_file())
    };
    let named = var_os("BEAMFARM_CHROMIUM").map(PathBuf::from);
    let mut programs = named.into_iter().chain(CHROMIUM.map(PathBuf::from));
    match programs.find_map(find) {
        Some(program) => {
            println!("cargo::rerun-if-changed={}", program.display());
            println!("cargo::rustc-cfg=has_chromium");
        }
        // Installing one later changes the folder.
        None => {
            for folder in folders.iter().filter(|folder| folder.is_dir()) {
                println!("cargo::rerun-if-changed={}", folder.display());
            }
        }
    }
}
