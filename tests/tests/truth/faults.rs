//! Scenes whose pictures were once wrong: small, each with the cause in its first line. Passes against the path tracer.

use beamfarm_harness::differential::Effort;
use beamfarm_harness::differential::many::examine_alone;
use beamfarm_harness::random_scene::RandomScene;
use beamfarm_harness::render::is_long;
use beamfarm_harness::suite::sidak;
use std::path::Path;

/// All together at a significance of 1e-3.
#[test]
fn what_was_wrong_is_right() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/faults");
    let mut files: Vec<_> = (folder.read_dir().unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|end| end == "toml"))
        .collect();
    files.sort();
    let effort = Effort {
        images: if is_long() { 48 } else { 8 },
        samples: 16,
        significance: sidak(1e-3, files.len()),
        seconds: f64::INFINITY,
    };
    let mut wrong = Vec::new();
    for path in &files {
        let scene = RandomScene::read(path).unwrap();
        let verdict = examine_alone(&scene, &effort);
        let name = path.file_stem().unwrap().to_string_lossy();
        match &verdict {
            Ok(verdict) if !verdict.is_fault() => println!("{name}: {verdict}"),
            Ok(verdict) => wrong.push(format!("{name}: {verdict}")),
            Err(message) => wrong.push(format!("{name}: {message}")),
        }
    }
    assert!(files.len() >= 20 && wrong.is_empty(), "{}", wrong.join("\n"));
}
