//! Properties checked on all scenes of the repository, and on one in another notation.

mod fields;
mod moves;

use crate::{ImportOptions, SceneError, SceneFile, load, meaning};
use beamfarm_render::world::SceneDescription;
use std::path::{Path, PathBuf};

const SCENE: &str = "\
# A room.
[image]
width = 64
height = 48
[camera]
origin = [0, 1, 5] # at the door
target = [0, 1, 0]
fov = 40
[materials.\"old glass\"]
type = \"dielectric\" # thick
ior = 1.5 # crown
[materials.ball]
type = \"plastic\"
[media.fog]
type = \"homogeneous\"
sigma_a = 0.1
sigma_s = [0.4, 0.4, 0.5]
phase = { type = \"hg\", g = 0.3 }
[[shapes]]
type = \"sphere\"
center = [0, 1.0, 0] # middle
[[shapes]]
name = \"lamp\"
type = \"rectangle\"
emission = { power = 10 }
transform = [
    { scale = 2 }, # large
    { rotate = { axis = [0, 1, 0], angle = 30 } },
    { translate = [1, 2, 3] }, # up there
]
[[shapes]]
type = \"cube\"
[[shapes.transform]]
scale = 0.5
[[shapes.transform]]
[shapes.transform.rotate]
axis = [1, 0, 0]
angle = 10
[[shapes]]
type = \"cylinder\"
p0 = [1, 0, 0]
p1 = [1, 2, 0]
[[shapes]]
name = \"row\"
type = \"instances\"
shape = { type = \"cube\" }
transforms = [
    [{ scale = 0.1 }, { translate = [1, 0, 0] }], # first
    [], # second
]
[[shapes]]
type = \"disc\"
transform = [{ look_at = { origin = [1, 2, 3], target = [0, 0, 0] } }]
[[lights]]
type = \"spot\"
position = [0, 3, 0]
target = [0, 0, 0]
power = [10, 20.5, 30]
[[lights]]
type = \"directional\"
direction = [0, -1, 0]
irradiance = 1
[[lights]]
type = \"environment\"
radiance = 1
";

fn scenes() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let folders = [root.clone(), root.join("peers")];
    let files = folders.iter().flat_map(|folder| std::fs::read_dir(folder).unwrap());
    let paths = files.map(|entry| entry.unwrap().path());
    let is_scene = |path: &PathBuf| {
        let is_toml = path.extension().is_some_and(|ending| ending == "toml");
        is_toml && std::fs::read_to_string(path).unwrap().contains("[camera]")
    };
    let mut scenes: Vec<PathBuf> = paths.filter(is_scene).collect();
    scenes.sort();
    assert!(scenes.len() > 10);
    scenes
}

/// The scenes of the repository with their files.
fn read() -> impl Iterator<Item = (SceneFile, String)> {
    scenes().into_iter().map(|path| {
        let file = SceneFile::read(&path, &ImportOptions::default()).unwrap();
        let text = String::from_utf8(file.text().to_vec()).unwrap();
        (file, text)
    })
}

fn texts() -> Vec<String> {
    let files = scenes().into_iter().map(|path| std::fs::read_to_string(path).unwrap());
    files.chain([SCENE.to_owned()]).collect()
}

fn canonical(text: &str) -> String {
    meaning::canonical(text).unwrap_or_else(|| panic!("no TOML: {text}"))
}

fn comments(text: &str) -> Vec<&str> {
    text.lines().filter_map(|line| Some(&line[line.find('#')?..])).collect()
}

/// All comments are kept, in order.
fn assert_comments(before: &str, after: &str) {
    assert_eq!(comments(before), comments(after), "{after}");
}

fn reloaded(file: &SceneFile, text: &str) -> Result<SceneDescription, SceneError> {
    let mut bundle = file.bundle.clone();
    bundle.files.insert(bundle.scene.clone(), text.as_bytes().to_vec());
    load(&bundle)
}
