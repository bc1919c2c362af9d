//! Objects in another medium than their `exterior` says are reported, and no others.

use beamfarm_harness::random_scene::RandomScene;
use beamfarm_harness::render::scene;
use std::path::Path;

fn misplaced(shapes: &str) -> Vec<String> {
    let text = format!(
        r#"
[image]
width = 1
height = 1
[camera]
origin = [0, 0, 9]
target = [0, 0, 0]
fov = 30
[[lights]]
type = "point"
position = [0, 5, 0]
power = 1
[media.fog]
type = "homogeneous"
sigma_a = 0
sigma_s = 1
[media.milk]
type = "homogeneous"
sigma_a = 0
sigma_s = 9
[materials.none]
type = "null"
[materials.glass]
type = "dielectric"
ior = 1.5
{shapes}"#
    );
    scene(&text).misplaced()
}

const FOG: &str = "[[shapes]]\ntype = \"cube\"\nname = \"fog\"\nmaterial = \"none\"\ninterior = \"fog\"\n";

fn ball(more: &str) -> String {
    format!("[[shapes]]\ntype = \"sphere\"\nname = \"ball\"\nradius = 0.4\nmaterial = \"glass\"\n{more}\n")
}

#[test]
fn what_lies_in_fog_says_so() {
    assert_eq!(misplaced(&(FOG.to_owned() + &ball(""))), ["ball"]);
    assert_eq!(misplaced(&(FOG.to_owned() + &ball("exterior = \"milk\""))), ["ball"]);
    for right in ["exterior = \"fog\"", "boundary = false"] {
        assert!(misplaced(&(FOG.to_owned() + &ball(right))).is_empty(), "{right}");
    }
}

#[test]
fn what_touches_or_stands_beside_is_right() {
    let beside = FOG.replace("\"fog\"", "\"milk\"") + "transform = [{ translate = [2, 0, 0] }]\n";
    assert!(misplaced(&(FOG.to_owned() + &beside)).is_empty());
    let outside = ball("center = [0, 3, 0]");
    assert!(misplaced(&(FOG.to_owned() + &outside)).is_empty());
    let nested = ball("exterior = \"fog\"\ninterior = \"milk\"")
        + &ball("exterior = \"milk\"")
            .replace("0.4", "0.2")
            .replace("ball", "bubble");
    assert!(misplaced(&(FOG.to_owned() + &nested)).is_empty());
}

/// Scenes that caused other trouble, but do not have this mistake.
#[test]
fn faults_were_not_these() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/faults");
    for entry in folder.read_dir().unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|end| end == "toml") {
            let scene = RandomScene::read(&path).unwrap().load().unwrap();
            assert_eq!(scene.misplaced(), [""; 0], "{}", path.display());
        }
    }
}
