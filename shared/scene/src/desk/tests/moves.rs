//! Tests of moving and turning the camera and things.

use super::{SCENE, assert_comments, canonical, read, reloaded};
use crate::desk::{CameraMove, camera, eye, object_ids, set, things, translate, turn};
use crate::load;
use beamfarm_image::bundle::Bundle;
use proptest::prelude::*;
use serde_json::json;

/// All numbers of a text's canonical form, and the remaining text.
fn numbers(text: &str) -> (Vec<f64>, String) {
    let canonical = canonical(text);
    let is_number = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+' | 'e');
    let words: Vec<&str> = canonical.split(|c| !is_number(c)).collect();
    let found = words.iter().filter_map(|word| word.parse().ok()).collect();
    let rest = words.iter().filter(|word| word.parse::<f64>().is_err());
    (found, rest.copied().collect::<String>())
}

#[test]
fn what_is_moved_and_moved_back_is_where_it_was() {
    for (file, text) in read() {
        let text = &*text;
        let description = file.load().unwrap();
        let camera = eye(&file.bundle.clone().into()).unwrap().origin;
        let things = things(text, &description, camera);
        assert!(!things.is_empty());
        let by = [0.125, -0.3141592653589793, 1.0 / 3.0];
        let mut all = text.to_owned();
        let step = things.len().div_ceil(12);
        for thing in things.iter().step_by(step) {
            let there = translate(text, &thing.id, by);
            assert_eq!(there.is_ok(), thing.moves, "{thing:?} {there:?}");
            let turned = turn(&all, &thing.id, [0.0, 1.0, 0.5], 12.5);
            assert_eq!(turned.is_ok(), thing.turns, "{thing:?} {turned:?}");
            all = turned.unwrap_or(all);
            let Ok(there) = there else { continue };
            assert_comments(text, &there);
            assert_ne!(canonical(&there), canonical(text), "{thing:?}");
            let back = translate(&there, &thing.id, by.map(|x| -x)).unwrap();
            let (before, after) = (numbers(text), numbers(&back));
            if before.1 == after.1 {
                let off = before.0.iter().zip(&after.0).map(|(a, b)| (a - b).abs());
                assert!(off.fold(0.0, f64::max) < 1e-9, "{thing:?}");
            } else {
                // A thing without a place now has one at the origin.
                assert!(
                    back.contains("translate = [0.0, 0.0, 0.0]") || back.contains("center"),
                    "{thing:?}: {back}"
                );
            }
            all = translate(&all, &thing.id, by).unwrap();
        }
        let moved = reloaded(&file, &all).unwrap_or_else(|error| panic!("{error}\n{all}"));
        assert_comments(text, &all);
        assert_eq!(moved.objects.len(), description.objects.len());
    }
}

/// Checks a moved and turned thing by its bounding box.
#[test]
fn things_are_where_they_were_moved_to() {
    let bundle = |text: &str| {
        let mut bundle = Bundle {
            scene: "room.toml".into(),
            ..Default::default()
        };
        bundle.files.insert("room.toml".into(), text.into());
        bundle
    };
    let all = |text: &str| {
        things(
            text,
            &load(&bundle(text)).unwrap(),
            eye(&bundle(text).into()).unwrap().origin,
        )
    };
    let before = all(SCENE);
    let ids: Vec<&str> = before.iter().map(|thing| &*thing.id).collect();
    let expected = "lights.0 lights.1 lights.2 shapes.0 shapes.1 shapes.2 shapes.3 shapes.4.0 shapes.4.1 shapes.5";
    assert_eq!(ids.join(" "), expected);
    assert_eq!(object_ids(SCENE), ids[3..]);
    let emit = before.iter().filter(|thing| thing.emits).map(|thing| &*thing.id);
    let emit: Vec<&str> = emit.collect();
    assert_eq!(emit.join(" "), "lights.0 lights.1 lights.2 shapes.1");
    for (i, thing) in before.iter().enumerate() {
        let by = [0.5, -1.25, 2.0];
        let Some(at) = thing.at else { continue };
        let place = |text: &str| all(text)[i].at.unwrap();
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
        let moved = translate(SCENE, &thing.id, by).unwrap();
        let there = [at[0] + by[0], at[1] + by[1], at[2] + by[2]];
        assert!(near(place(&moved), there), "{thing:?} {moved}");
        assert_comments(SCENE, &moved);
        // Turning it twice, also after a move, keeps its place and adds no further steps.
        let turned = turn(&moved, &thing.id, [0.3, 0.5, -0.8], 70.123456789).unwrap();
        assert!(near(place(&turned), there), "{thing:?} {turned}");
        assert_comments(SCENE, &turned);
        let again = turn(&turned, &thing.id, [0.3, 0.5, -0.8], -30.0).unwrap();
        assert_eq!(
            again.matches("rotate").count(),
            turned.matches("rotate").count(),
            "{again}"
        );
        let again = translate(&again, &thing.id, by).unwrap();
        assert_eq!(
            again.matches("translate").count(),
            turned.matches("translate").count(),
            "{again}"
        );
        let further = [there[0] + by[0], there[1] + by[1], there[2] + by[2]];
        assert!(near(place(&again), further), "{thing:?} {again}");
    }
}

#[test]
fn steps_look_as_those_beside_them() {
    let moved = |id: &str| translate(SCENE, id, [0.1, 0.2, 0.0]).unwrap();
    let turned = |id: &str| turn(SCENE, id, [0.0, 0.0, 2.0], 45.0).unwrap();
    for (text, expected) in [
        (moved("shapes.0"), "center = [0.1, 1.2, 0] # middle"),
        (moved("shapes.1"), "    { translate = [1.1, 2.2, 3] }, # up there\n]"),
        (
            moved("shapes.2"),
            "angle = 10\n[[shapes.transform]]\ntranslate = [0.1, 0.2, 0]\n[[shapes]]",
        ),
        (moved("shapes.3"), "p0 = [1.1, 0.2, 0]\np1 = [1.1, 2.2, 0]"),
        (
            moved("shapes.4.0"),
            "    [{ scale = 0.1 }, { translate = [1.1, 0.2, 0] }], # first",
        ),
        (moved("shapes.4.1"), "    [{ translate = [0.1, 0.2, 0] }], # second"),
        (moved("shapes.4"), "    [{ translate = [0.1, 0.2, 0] }], # second"),
        (
            moved("shapes.5"),
            "target = [0, 0, 0] } }, { translate = [0.1, 0.2, 0] }]",
        ),
        (moved("lights.0"), "position = [0.1, 3.2, 0]\ntarget = [0.1, 0.2, 0]"),
        (moved("lights.0.target"), "position = [0, 3, 0]\ntarget = [0.1, 0.2, 0]"),
        (
            turned("shapes.1"),
            "angle = 30 } },\n    { rotate = { axis = [0, 0, 1], angle = 45 } },\n    { translate = [1, 2, 3] }, # up there\n]",
        ),
        (
            turn(SCENE, "shapes.1", [0.0, -2.0, 0.0], 10.0).unwrap(),
            "angle = 20 } },\n    { translate",
        ),
        (
            turned("shapes.2"),
            "angle = 10\n[[shapes.transform]]\nrotate = { axis = [0, 0, 1], angle = 45 }\n",
        ),
        (turned("lights.1"), "direction = [0.70711, -0.70711, 0]"),
        (
            turn(SCENE, "lights.2", [0.0, 1.0, 0.0], 33.3333333333).unwrap(),
            "rotate_y = 33.333",
        ),
        (
            turned("lights.2"),
            "transform = [{ rotate = { axis = [0, 0, 1], angle = 45 } }]",
        ),
    ] {
        assert!(text.contains(expected), "expected\n{expected}\nin\n{text}");
    }
    for (id, words) in [
        ("lights.1", "infinitely far"),
        ("lights.1.target", "only spots"),
        ("lights.7", "no light 7"),
        ("shapes.4.2", "no copy 2"),
        ("shapes.0.0", "no copies"),
        ("gltf.0", "glTF"),
        ("camera", "nothing"),
    ] {
        let said = translate(SCENE, id, [1.0, 0.0, 0.0]).unwrap_err();
        assert!(said.contains(words), "{id}: {said}");
    }
}

#[test]
fn the_camera_goes_elsewhere() {
    let to = CameraMove {
        origin: [0.123456789012, 1.0, 5.0],
        target: [0.0, 1.0, 0.30000000000000004],
        up: None,
        fov: None,
    };
    let there = camera(SCENE, to).unwrap();
    assert!(
        there.contains("origin = [0.12346, 1, 5] # at the door\ntarget = [0, 1, 0.3]\nfov = 40\n"),
        "{there}"
    );
    let tilted = CameraMove {
        up: Some([0.1, 1.0, 0.0]),
        fov: Some(55.5),
        ..to
    };
    assert!(
        camera(SCENE, tilted)
            .unwrap()
            .contains("fov = 55.5\nup = [0.1, 1, 0]\n")
    );
    let of_file = "# From elsewhere.\ncamera = { gltf = \"a.glb\", gltf_camera = \"front\" } # of a file\n";
    assert!(camera(of_file, to).is_err());
    let own = camera(of_file, tilted).unwrap();
    let table: toml::Table = own.parse().unwrap();
    let names: Vec<&str> = table["camera"].as_table().unwrap().keys().map(String::as_str).collect();
    assert_eq!(names, ["fov", "fov_axis", "origin", "target", "up"]);
    assert_eq!(table["camera"]["fov_axis"].as_str(), Some("y"));
    assert_comments(of_file, &own);
    let commented = "[camera]\n# The file's own.\ngltf = \"a.glb\" # good\naperture = 1\n";
    assert_comments(commented, &camera(commented, tilted).unwrap());
    let parallel = "[camera]\nprojection = \"orthographic\"\nview_width = 2\norigin = [0, 0, 1]\ntarget = [0, 0, 0]\n";
    assert!(
        camera(parallel, to)
            .unwrap()
            .contains("view_width = 2\norigin = [0.12346, 1, 5]\n")
    );
    assert!(camera(parallel, tilted).unwrap_err().contains("no field of view"));
    let nowhere = CameraMove {
        target: to.origin,
        ..to
    };
    assert!(camera(SCENE, nowhere).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Any request gives a text or a reason, never a panic.
    #[test]
    fn nothing_that_is_asked_for_is_fatal(
        path in "[a-z0-9.\"]{0,3}((lights|shapes|materials|camera|image)(\\.([0-9]|[a-z]{1,4}|target|transform|type))){0,3}",
        numbers in prop::array::uniform4(prop::num::f64::ANY),
    ) {
        let [x, y, z, angle] = numbers;
        for changed in [
            set(SCENE, &path, Some(json!([x, y, z]))),
            set(SCENE, &path, Some(json!(angle))),
            set(SCENE, &path, None),
            translate(SCENE, &path, [x, y, z]),
            translate(SCENE, "shapes.1", [x, y, z]),
            turn(SCENE, &path, [x, y, z], angle),
            turn(SCENE, "shapes.5", [x, y, z], angle),
            camera(SCENE, CameraMove { origin: [x, y, z], target: [z, x, y], up: Some([y, z, x]), fov: Some(angle) }),
        ]
        .into_iter()
        .flatten()
        {
            prop_assert!(changed.parse::<toml::Table>().is_ok(), "{}: {}", path, changed);
        }
    }
}

/// Keyframes are not overwritten by the value at one frame.
#[test]
fn what_moves_by_keys_stays() {
    let text = "\
[image]
width = 8
height = 8
[animation]
frames = [1, 9]
[camera]
origin = { keys = [[1, [0, 0, 5]], [9, [1, 0, 5]]] }
target = [0, 0, 0]
fov = 40
[[shapes]]
type = \"sphere\"
transform = [{ translate = { keys = [[1, [0, 0, 0]], [9, [1, 0, 0]]] } }]
[[lights]]
type = \"point\"
position = { keys = [[1, [0, 3, 0]], [9, [1, 3, 0]]] }
power = { keys = [[1, 3], [9, 4]] }
[[lights]]
type = \"point\"
position = [0, 1, 0]
power = { keys = [[1, 3], [9, 4]] }
";
    for thing in ["lights.0", "shapes.0"] {
        let said = translate(text, thing, [1.0, 0.0, 0.0]).unwrap_err();
        assert!(said.contains("moves by keys"), "{said}");
    }
    let moved = translate(text, "lights.1", [1.0, 0.0, 0.0]).unwrap();
    assert_eq!(moved, text.replace("position = [0, 1, 0]", "position = [1, 1, 0]"));
    let to = CameraMove {
        origin: [0.0, 0.0, 4.0],
        target: [0.0; 3],
        up: None,
        fov: None,
    };
    assert!(camera(text, to).unwrap_err().contains("`origin` moves by keys"));
}
