//! Passes against the path tracer on random scenes.
//!
//! 8 scenes by default; with BEAMFARM_LONG=1 2,000, rendered longer. BEAMFARM_SCENES and BEAMFARM_FIRST_SEED set the
//! number and the first seed; each scene then prints a line as soon as its result is known. BEAMFARM_SECONDS limits a
//! single render (default in the short test: half a minute, or one scene would take as long as all others); a scene
//! that would need longer is counted as "too long" and not judged. Scenes with a fault, and those that differed without
//! a verdict, are written to BEAMFARM_FAULTS (target/random-scenes by default).

use beamfarm_harness::differential::Effort;
use beamfarm_harness::differential::many::examine_seeds;
use beamfarm_harness::render::is_long;
use beamfarm_harness::suite::sidak;
use std::collections::BTreeMap;
use std::path::PathBuf;

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().unwrap())
}

/// All together at a significance of 1e-2.
#[test]
fn passes_are_right_on_random_scenes() {
    let is_long = is_long();
    let (scenes, images, samples, seconds) = match is_long {
        true => (2000, 64, 8, f64::INFINITY),
        false => (8, 32, 4, 20.0),
    };
    let scenes = number("BEAMFARM_SCENES").unwrap_or(scenes);
    let first = number("BEAMFARM_FIRST_SEED").unwrap_or(0);
    let folder = std::env::var_os("BEAMFARM_FAULTS").map(PathBuf::from);
    let folder = folder.unwrap_or(PathBuf::from(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../target/random-scenes"
    )));
    let significance = sidak(1e-2, usize::try_from(scenes).unwrap());
    let effort = Effort {
        images,
        samples,
        significance,
        seconds: number("BEAMFARM_SECONDS").map_or(seconds, |seconds| seconds as f64),
    };
    let mut counts = BTreeMap::new();
    let mut faults = Vec::new();
    let seeds: Vec<u64> = (first..first + scenes).collect();
    examine_seeds(&seeds, &effort, |outcome| {
        println!("{}", outcome.line());
        let word = outcome.verdict.as_ref().map_or("panic", |v| v.word());
        *counts.entry(word).or_insert(0) += 1;
        let path = match &outcome.verdict {
            Ok(verdict) if verdict.is_settled() => return,
            _ => outcome.scene.write(&folder, &format!("seed-{}", outcome.seed)).unwrap(),
        };
        if outcome.is_fault() {
            faults.push(format!("{}\n    {}", outcome.line(), path.display()));
        }
    });
    println!("{counts:?}");
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}
