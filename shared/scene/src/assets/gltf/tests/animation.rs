//! Tests of animations.

use super::{bytes, file, load_with, says, uri};
use beamfarm_render::math::Vec3;
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::geometry::Shape;
use serde_json::{Value, json};

/// A channel: node, path, interpolation, times of keys, and the numbers of all keys.
type Channel<'a> = (usize, &'a str, &'a str, &'a [f32], &'a [f32]);

/// Add animations to a file.
fn animate(mut file: Value, animations: &[&[Channel<'_>]]) -> Value {
    let mut data = bytes();
    let mut accessor = |file: &mut Value, numbers: &[f32], count: usize| {
        let kind = match numbers.len() / count {
            1 => "SCALAR",
            3 => "VEC3",
            _ => "VEC4",
        };
        let view = file["bufferViews"].as_array_mut().unwrap();
        view.push(json!({ "buffer": 0, "byteOffset": data.len(), "byteLength": 4 * numbers.len() }));
        let view = view.len() - 1;
        data.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        let (low, high) = (
            numbers.iter().copied().fold(f32::MAX, f32::min),
            numbers.iter().copied().fold(f32::MIN, f32::max),
        );
        let accessors = file["accessors"].as_array_mut().unwrap();
        let mut new = json!({ "bufferView": view, "componentType": 5126, "count": count, "type": kind });
        if kind == "SCALAR" {
            new["min"] = json!([low]);
            new["max"] = json!([high]);
        }
        accessors.push(new);
        accessors.len() - 1
    };
    let mut list = Vec::new();
    for (number, channels) in animations.iter().enumerate() {
        let (mut samplers, mut targets) = (Vec::new(), Vec::new());
        for (i, (node, path, kind, times, numbers)) in channels.iter().enumerate() {
            let count = match *path {
                "translation" | "scale" => numbers.len() / 3,
                "rotation" => numbers.len() / 4,
                _ => numbers.len(),
            };
            let input = accessor(&mut file, times, times.len());
            let output = accessor(&mut file, numbers, count);
            samplers.push(json!({ "input": input, "output": output, "interpolation": kind }));
            targets.push(json!({ "sampler": i, "target": { "node": node, "path": path } }));
        }
        list.push(json!({ "name": format!("a{number}"), "samplers": samplers, "channels": targets }));
    }
    file["animations"] = json!(list);
    file["buffers"] = json!([{ "byteLength": data.len(), "uri": uri("application/octet-stream", &data) }]);
    file
}

/// The scene at a frame, at 24 frames a second.
fn at(file: &Value, frame: f64) -> SceneDescription {
    load_with(file, &format!("[animation]\nframe = {frame}\n")).unwrap()
}

/// The four corners of an object in world space; the camera is at (0, 0, 9).
fn corners(description: &SceneDescription, object: usize) -> Vec<Vec3> {
    let Shape::Mesh { mesh, placement } = &description.objects[object].shape else {
        panic!();
    };
    let place =
        |p: &Vec3| Vec3::from(placement.render_from_object.transform_point3a((*p).into())) + Vec3::new(0.0, 0.0, 9.0);
    mesh.positions.iter().map(place).collect()
}

#[track_caller]
fn is_near(found: Vec3, expected: [f32; 3]) {
    let expected = Vec3::from_array(expected);
    assert!((found - expected).length() < 1e-5, "{found} for {expected}");
}

const HALF: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// The frame rate converts frames to seconds; values are held before the first key and after the last. A quarter turn
/// is half done in half the time.
#[test]
fn nodes_move() {
    let file = animate(
        file(json!({})),
        &[&[
            (
                0,
                "translation",
                "LINEAR",
                &[0.0, 1.0],
                &[1.0, 0.0, 0.0, 3.0, 0.0, -4.0],
            ),
            (
                0,
                "rotation",
                "LINEAR",
                &[0.0, 2.0],
                &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, HALF, HALF],
            ),
            (0, "scale", "STEP", &[0.0, 0.5], &[1.0, 1.0, 1.0, 2.0, 2.0, 2.0]),
        ]],
    );
    for (frame, origin) in [
        (-24.0, [1.0, 0.0, 0.0]),
        (12.0, [2.0, 0.0, -2.0]),
        (99.0, [3.0, 0.0, -4.0]),
    ] {
        is_near(corners(&at(&file, frame), 0)[0], origin);
    }
    let after_one_second = corners(&at(&file, 24.0), 0);
    is_near(after_one_second[1], [3.0 + 2.0 * HALF, 2.0 * HALF, -4.0]);
    let before_the_step = corners(&at(&file, 11.9), 0);
    assert!(((before_the_step[1] - before_the_step[0]).length() - 1.0).abs() < 1e-5);
    let at_half_speed = load_with(&file, "[animation]\nframe = 6\nfps = 12\n").unwrap();
    is_near(corners(&at_half_speed, 0)[0], [2.0, 0.0, -2.0]);
    let still = load_with(&file, "").unwrap();
    is_near(corners(&still, 0)[0], [0.0; 3]);
    assert!(says(&still, "do not play"));
}

/// Children follow their parents; lights and cameras are nodes too.
#[test]
fn lights_and_the_camera_move() {
    let with = json!({
        "scenes": [{ "nodes": [0] }],
        "nodes": [
            { "name": "arm", "children": [1, 2, 3] },
            { "name": "thing", "mesh": 0 },
            { "name": "lamp", "translation": [0, 1, 0], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
            { "name": "eye", "camera": 0 },
        ],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }],
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 2 }] } },
    });
    let keys: Channel<'_> = (0, "translation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 0.0, 8.0, 0.0]);
    let file = animate(file(with), &[&[keys]]);
    let description = at(&file, 6.0);
    is_near(corners(&description, 0)[0], [0.0, 2.0, 0.0]);
    let beamfarm_render::world::light::LightKind::Point { position, .. } = description.lights[0].kind else {
        panic!();
    };
    is_near(position + Vec3::new(0.0, 0.0, 9.0), [0.0, 3.0, 0.0]);
    let text = "image = { width = 12, height = 8 }\ncamera = { gltf = \"a.gltf\" }\n\
                [animation]\nframe = 12\nshutter = [0, 1]\n[[gltf]]\nfile = \"a.gltf\"\n";
    let mut bundle = beamfarm_image::bundle::Bundle {
        scene: "scene.toml".into(),
        ..Default::default()
    };
    bundle.files.insert("a.gltf".into(), file.to_string().into());
    bundle.files.insert("scene.toml".into(), text.into());
    let description = crate::load(&bundle).unwrap();
    // Everything follows the camera except the origin of render space, which is fixed during an exposure.
    let motion = description.motion.as_ref().unwrap();
    let [first, last] = [12.0, 13.0].map(|time| motion.at(time).unwrap().camera.position.y);
    assert!((last - first - 8.0 / 24.0).abs() < 1e-5, "{first} {last}");
}

/// A cubic with given slopes: u^3 goes from 0 with slope 0 to 1 with slope 3. Over two seconds the slopes are half of
/// that.
#[test]
fn splines_have_the_slopes_of_their_keys() {
    let numbers = [
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, //
        1.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    ];
    let keys: Channel<'_> = (0, "translation", "CUBICSPLINE", &[0.0, 2.0], &numbers);
    let file = animate(file(json!({})), &[&[keys]]);
    for (frame, u) in [
        (0.0, 0.0),
        (12.0, 0.25f32),
        (24.0, 0.5),
        (36.0, 0.75),
        (48.0, 1.0),
        (60.0, 1.0),
    ] {
        is_near(corners(&at(&file, frame), 0)[0], [u * u * u, 0.0, 0.0]);
    }
}

/// Morph targets by weights, and vertices by joints.
#[test]
fn vertices_move() {
    let mut with = file(json!({}));
    with["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 0 }]);
    with["meshes"][0]["weights"] = json!([0.0]);
    let file = animate(with, &[&[(0, "weights", "LINEAR", &[0.0, 1.0], &[0.0, 2.0])]]);
    is_near(corners(&at(&file, 12.0), 0)[1], [2.0, 0.0, 0.0]);
    let blurred = load_with(&file, "[animation]\nframe = 12\nshutter = [0, 12]\n").unwrap();
    let end = blurred.motion.as_ref().unwrap().at(24.0).unwrap();
    is_near(corners(&end, 0)[1], [3.0, 0.0, 0.0]);
}

/// If two animations move the same thing, the first plays and the other is noted.
#[test]
fn what_moves_twice_moves_once() {
    let up: Channel<'_> = (0, "translation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let aside: Channel<'_> = (0, "translation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let larger: Channel<'_> = (0, "scale", "LINEAR", &[0.0, 1.0], &[1.0, 1.0, 1.0, 3.0, 3.0, 3.0]);
    let file = animate(file(json!({})), &[&[up], &[aside], &[larger]]);
    let description = at(&file, 24.0);
    is_near(corners(&description, 0)[1], [3.0, 1.0, 0.0]);
    assert!(says(&description, "do not play: \"a1\""), "{:?}", description.notes);
}

/// Channels of pointers have no node.
#[test]
fn pointers_are_told_of() {
    let keys: Channel<'_> = (0, "scale", "STEP", &[0.0, 1.0], &[1.0, 1.0, 1.0, 2.0, 2.0, 2.0]);
    let mut file = animate(file(json!({})), &[&[keys]]);
    let told = |file: &Value| says(&at(file, 24.0), "KHR_animation_pointer");
    assert!(!told(&file));
    file["animations"][0]["channels"][0]["target"] = json!({ "path": "pointer", "extensions": {
        "KHR_animation_pointer": { "pointer": "/nodes/0/scale" }
    } });
    assert!(told(&file));
}

/// A lone file has the frames of its animations and shows the first.
#[test]
fn files_by_themselves_have_frames() {
    let keys: Channel<'_> = (
        0,
        "translation",
        "LINEAR",
        &[0.5, 2.02],
        &[1.0, 0.0, 0.0, 4.0, 0.0, 0.0],
    );
    let file = animate(file(json!({})), &[&[keys]]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.gltf");
    std::fs::write(&path, file.to_string()).unwrap();
    let options = crate::ImportOptions::default();
    assert_eq!(crate::frames(&path, &options).unwrap(), Some([12, 49]));
    let read = crate::SceneFile::read(&path, &options).unwrap();
    let said = read
        .notes
        .iter()
        .any(|note| note.contains("it moves, in frames 12 to 49"));
    assert!(said, "{:?}", read.notes);
    std::fs::write(&path, super::file(json!({})).to_string()).unwrap();
    assert_eq!(crate::frames(&path, &options).unwrap(), None);
}

/// Things at rest are not blurred.
#[test]
fn only_what_moves_is_blurred() {
    let open = "[animation]\nshutter = [0, 0.5]\n";
    let blurs = |file: &Value, fields: &str| load_with(file, fields).unwrap().motion.map(|motion| motion.blurs());
    assert_eq!(blurs(&file(json!({})), open), None);
    let keys: Channel<'_> = (0, "scale", "STEP", &[0.0, 1.0], &[1.0, 1.0, 1.0, 2.0, 2.0, 2.0]);
    let moving = animate(file(json!({})), &[&[keys]]);
    assert_eq!(blurs(&moving, open), Some(true));
    assert_eq!(blurs(&moving, "[animation]\n"), Some(false));
    assert_eq!(blurs(&moving, ""), None);
}

#[test]
fn keys_that_cannot_be_are_errors() {
    let error = |channel: Channel<'_>| {
        let file = animate(file(json!({})), &[&[channel]]);
        load_with(&file, "[animation]\n").unwrap_err()
    };
    let late = error((0, "scale", "LINEAR", &[1.0, 0.0], &[1.0, 1.0, 1.0, 2.0, 2.0, 2.0]));
    assert!(
        late.contains("a.gltf") && late.contains("channel 0 of the animation \"a0\"") && late.contains("in order"),
        "{late}"
    );
    let few = error((0, "scale", "CUBICSPLINE", &[0.0, 1.0], &[1.0, 1.0, 1.0, 2.0, 2.0, 2.0]));
    assert!(few.contains("2 keys, and 6 numbers"), "{few}");
    let no_turn = error((0, "rotation", "LINEAR", &[0.0], &[0.0; 4]));
    assert!(no_turn.contains("quaternion"), "{no_turn}");
}
