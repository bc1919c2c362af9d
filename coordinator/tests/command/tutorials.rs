//! The scenes of docs/tutorials, as a reader types them in, step by step.

use crate::setup::succeed;
use std::fs;
use std::path::Path;

/// The blocks of code of a tutorial in this language.
fn blocks(tutorial: &str, language: &str) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../docs/tutorials")
        .join(tutorial);
    let text = fs::read_to_string(path).unwrap();
    let fence = format!("```{language}\n");
    let parts = text.split(&fence).skip(1);
    parts.map(|part| part.split("```").next().unwrap().to_owned()).collect()
}

const QUICK: [&str; 7] = ["--passes", "1", "--paths", "300", "--scale", "10%", "--restart"];

#[test]
fn glass_in_fog() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let steps = blocks("glass-in-fog.md", "toml");
    assert_eq!(steps.len(), 4);
    let mut text = String::new();
    for step in steps {
        text += &step;
        fs::write(path.join("glass.toml"), &text).unwrap();
        succeed(path, &[&["render", "glass.toml", "--strict"], &QUICK[..]].concat());
    }
    // As it says: photons are traced for the ball, and beams for the fog.
    let explained = succeed(path, &["explain", "glass.toml"]);
    let has = |stage: &str| {
        explained
            .lines()
            .any(|line| line.starts_with("uses") && line.contains(stage))
    };
    assert!(has("photon beams") && has("surface photons"), "{explained}");
}

#[test]
fn mitsuba() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let [scene] = &blocks("mitsuba.md", "xml")[..] else {
        panic!("one scene");
    };
    let [fog] = &blocks("mitsuba.md", "toml")[..] else {
        panic!("one medium");
    };
    fs::write(path.join("caustic.xml"), scene).unwrap();
    let quick = |scene: &str| succeed(path, &[&["render", scene], &QUICK[..]].concat());
    quick("caustic.xml");
    succeed(
        path,
        &[
            "render",
            "caustic.xml",
            "-D",
            "spp=64",
            "--passes",
            "1",
            "--scale",
            "5%",
            "--restart",
        ],
    );
    succeed(path, &["convert", "caustic.xml", "caustic.toml"]);
    let file = path.join("caustic.toml");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, text + fog).unwrap();
    quick("caustic.toml");
}
