use super::*;
use crate::live::messages::ToPage;
use beamfarm_image::view::ViewTransform;
use clap::Parser;
use serde_json::json;

const SCENE: &str = "\
# A ball.
image = { width = 8, height = 6 } # small
[camera]
origin = [0, 0, 3]
target = [0, 0, 0]
fov = 40
[[shapes]]
name = \"ball\"
type = \"sphere\"
radius = 1 # round
[[lights]]
type = \"point\"
position = [2, 2, 3]
power = 100
";

#[derive(Parser)]
struct Options {
    #[command(flatten)]
    scene: SceneArgs,
}

fn bench(more: &[&str]) -> (tempfile::TempDir, Bench) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    std::fs::write(&path, SCENE).unwrap();
    let args = [&["live", path.to_str().unwrap()], more].concat();
    let options = Options::parse_from(args);
    let bench = Bench::open(&options.scene);
    (folder, bench.unwrap_or_else(|failure| panic!("{failure}")))
}

fn set(path: &str, value: Value, gesture: &str) -> FromPage {
    FromPage::Set {
        seq: 1,
        gesture: gesture.into(),
        path: path.into(),
        value,
    }
}

#[test]
fn a_gesture_is_one_step_of_undo() {
    let (_folder, mut bench) = bench(&[]);
    for fov in [41, 42, 43] {
        assert_eq!(
            bench.change(&set("camera.fov", json!(fov), "a")).unwrap(),
            Changed::Picture
        );
    }
    bench.change(&set("lights.0.power", json!(50), "b")).unwrap();
    let drag = |x: f64| FromPage::Move {
        seq: 1,
        gesture: "c".into(),
        thing: "lights.0".into(),
        by: [x, 0.0, 0.0],
    };
    // Totals, not increments.
    for x in [0.25, 0.5, 1.0] {
        bench.change(&drag(x)).unwrap();
    }
    assert!(
        bench.text.contains("[3, 2, 3]") || bench.text.contains("[3.0, 2"),
        "{}",
        bench.text
    );
    let number = bench.number();
    for _ in 0..3 {
        assert_eq!(bench.change(&FromPage::Undo { seq: 1 }).unwrap(), Changed::Picture);
    }
    assert_eq!(bench.text, SCENE);
    assert!(bench.number() > number, "no state of the scene comes twice");
    assert_eq!(bench.change(&FromPage::Undo { seq: 1 }).unwrap(), Changed::Nothing);
    for _ in 0..3 {
        bench.change(&FromPage::Redo { seq: 1 }).unwrap();
    }
    assert!(bench.text.contains("fov = 43") && bench.text.contains("power = 50"));
    assert_eq!(bench.change(&FromPage::Redo { seq: 1 }).unwrap(), Changed::Nothing);
}

#[test]
fn looks_are_no_other_picture_and_what_is_wrong_leaves_nothing() {
    let (_folder, mut bench) = bench(&[]);
    let number = bench.number();
    assert_eq!(
        bench.change(&set("render.exposure", json!(2), "a")).unwrap(),
        Changed::Looks
    );
    assert_eq!((bench.view().exposure, bench.number()), (2.0, number));
    for (path, value) in [("render.view", json!("agx")), ("render.white_balance", json!(3000))] {
        assert_eq!(bench.change(&set(path, value, "b")).unwrap(), Changed::Looks, "{path}");
    }
    let view = View {
        transform: ViewTransform::Agx,
        exposure: 2.0,
        white_balance: 3000.0,
    };
    assert_eq!((bench.view(), bench.number()), (view, number));
    assert!(bench.change(&set("render.view", json!("aces"), "c")).is_err());
    let text = bench.text.clone();
    for (path, value) in [
        ("camera.fov", json!(200)),
        ("camera.nothing", json!(1)),
        ("lights.7.power", json!(1)),
        ("shapes.0.material", json!("no such")),
    ] {
        let refusal = bench.change(&set(path, value, "b")).unwrap_err();
        assert_eq!(refusal.path.as_deref(), Some(path), "{refusal:?}");
        assert_eq!((&bench.text, bench.number()), (&text, number));
    }
}

#[test]
fn only_what_was_changed_is_saved() {
    let (_folder, mut bench) = bench(&["--scale", "200%", "-D", "camera.fov=50"]);
    assert_eq!(bench.description().camera.width, 16);
    assert!(!bench.is_dirty());
    bench.change(&set("lights.0.power", json!(7.5), "a")).unwrap();
    assert!(bench.is_dirty());
    bench.save().unwrap();
    assert!(!bench.is_dirty());
    let saved = std::fs::read_to_string(bench.file()).unwrap();
    assert_eq!(saved, SCENE.replace("power = 100", "power = 7.5"));
    std::fs::write(bench.file(), SCENE.replace("radius = 1", "radius = -1")).unwrap();
    let refusal = bench.read_again().unwrap_err();
    assert_eq!(refusal.line, Some(10), "{refusal:?}");
    assert_eq!(refusal.path.as_deref(), Some("shapes.0.radius"));
}

#[test]
fn a_click_tells_what_is_there() {
    let (_folder, mut bench) = bench(&[]);
    let ToPage::Picked {
        thing, name, distance, ..
    } = bench.picked(0.5, 0.5)
    else {
        panic!("no answer");
    };
    assert_eq!((thing.as_deref(), name.as_deref()), (Some("shapes.0"), Some("ball")));
    assert!((distance.unwrap() - 2.0).abs() < 1e-5);
    let ToPage::Picked {
        thing: None,
        name: None,
        ..
    } = bench.picked(0.01, 0.01)
    else {
        panic!("something is there");
    };
    bench.change(&FromPage::Focus { seq: 1, x: 0.5, y: 0.5 }).unwrap();
    assert!(bench.text.contains("focus_distance = 2"), "{}", bench.text);
    assert!(
        bench
            .change(&FromPage::Focus {
                seq: 1,
                x: 0.01,
                y: 0.01
            })
            .is_err()
    );
}
