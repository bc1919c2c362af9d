//! The commit for `--version`: that of BEAMFARM_COMMIT, or of git, or none.
//!
//! It is asked for again where there is another commit or other sources, which are compiled then in any case. Programs
//! of the development profile do not name it: tests would be built anew for each commit.

mod commit;

use std::env::{var, var_os};
use std::path::PathBuf;

/// What the programs are made of.
const SOURCES: [&str; 6] = ["Cargo.lock", "Cargo.toml", "coordinator", "proto", "shared", "worker"];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=commit.rs");
    println!("cargo::rerun-if-env-changed=BEAMFARM_COMMIT");
    let name = match var("BEAMFARM_COMMIT").ok().filter(|name| !name.is_empty()) {
        Some(name) => match commit::told(&name) {
            Ok(name) => name.to_owned(),
            Err(error) => {
                println!("cargo::error={error}");
                return;
            }
        },
        None if var("PROFILE").as_deref() == Ok("debug") => "not told in development builds".into(),
        None => asked(),
    };
    println!("cargo::rustc-env=BEAMFARM_COMMIT={name}");
}

fn asked() -> String {
    let root = PathBuf::from(var_os("CARGO_MANIFEST_DIR").unwrap_or_default()).join("..");
    let commit = commit::ask(&root, &SOURCES);
    if commit.name.is_some() {
        let sources = SOURCES.map(|source| root.join(source));
        for file in commit.files.iter().chain(&sources).filter(|file| file.exists()) {
            println!("cargo::rerun-if-changed={}", file.display());
        }
    }
    commit.name.unwrap_or_else(|| "unknown".into())
}
