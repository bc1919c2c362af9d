//! Tests of glTF files used as scene files.

use super::{bytes, file, load_with};
use crate::{Edits, ImportOptions, SceneFile};
use beamfarm_render::math::Vec3;
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::camera::Projection;
use beamfarm_render::world::light::LightKind;
use serde_json::{Value, json};
use std::path::Path;

fn read(file: &Value, edits: Edits) -> Result<(SceneFile, SceneDescription), String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.gltf");
    std::fs::write(&path, file.to_string()).unwrap();
    let options = ImportOptions {
        edits,
        ..ImportOptions::default()
    };
    let here = |error: String| error.replace(&format!("{}/", folder.path().display()), "");
    let read = SceneFile::read(&path, &options).map_err(|e| here(e.to_string()))?;
    let description = read.load().map_err(|e| here(e.to_string()))?;
    Ok((read, description))
}

fn says(file: &SceneFile, words: &str) -> bool {
    file.notes.iter().any(|note| note.contains(words))
}

/// A file without a camera and lights: all of it is in view and lit.
#[test]
fn all_of_a_model_is_seen_and_lit() {
    let (file, description) = read(
        &file(json!({ "nodes": [{ "mesh": 0, "scale": [30, 20, 1], "translation": [500, 0, -7] }] })),
        Edits::default(),
    )
    .unwrap();
    let camera = &description.camera;
    assert_eq!((camera.width, camera.height), (960, 720));
    let beamfarm_render::world::geometry::Shape::Mesh { mesh, .. } = &description.objects[0].shape else {
        panic!();
    };
    let mut fullest = 0.0f32;
    for corner in &mesh.positions {
        let at = |axis: Vec3| corner.dot(axis) / corner.dot(camera.frame.n);
        let [x, y] = [
            at(camera.frame.s) / camera.half_width,
            at(camera.frame.t) / camera.half_width,
        ];
        fullest = fullest.max(x.abs()).max(y.abs() * 4.0 / 3.0);
    }
    assert!(fullest > 0.6 && fullest < 1.0, "{fullest}");
    let kinds: Vec<&LightKind> = description.lights.iter().map(|light| &light.kind).collect();
    assert!(
        matches!(
            kinds[..],
            [LightKind::Environment { .. }, LightKind::Directional { .. }]
        ) || matches!(
            kinds[..],
            [LightKind::Directional { .. }, LightKind::Environment { .. }]
        ),
        "{kinds:?}"
    );
    assert!(says(&file, "it has no lights") && says(&file, "no camera"));
}

#[test]
fn its_own_camera_and_lights_are_taken() {
    let mut own = file(json!({
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 3 }] } },
        "cameras": [
            { "type": "orthographic", "orthographic": { "xmag": 3, "ymag": 1, "zfar": 10, "znear": 0.1 } },
            { "type": "perspective", "perspective": { "yfov": 0.8, "aspectRatio": 0.5, "znear": 0.1 } },
        ],
        "nodes": [
            { "mesh": 0 },
            { "camera": 1, "translation": [0, 0, 5] },
            { "name": "flat", "camera": 0 },
            { "translation": [0, 3, 0], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        ],
        "scenes": [{ "nodes": [0, 1, 2, 3] }],
    }));
    let (read_as, description) = read(&own, Edits::default()).unwrap();
    let camera = &description.camera;
    assert_eq!((camera.width, camera.height), (480, 960));
    assert!((f64::from(camera.half_width) - 0.5 * libm::tan(0.4)).abs() < 1e-6);
    assert!(matches!(description.lights[..], [ref l] if matches!(l.kind, LightKind::Point { .. })));
    assert!(says(&read_as, "it has 2 cameras, of which the first is taken"));
    assert!(!says(&read_as, "it has no lights"));

    let mut flat = own.clone();
    flat["scenes"][0]["nodes"] = json!([0, 2, 3]);
    let camera = read(&flat, Edits::default()).unwrap().1.camera;
    assert_eq!((camera.width, camera.height), (960, 320));
    assert_eq!((camera.projection, camera.half_width), (Projection::Orthographic, 3.0));

    // Fields and size can be edited as in any scene.
    let edits = Edits {
        fields: vec![
            ("camera.fov".into(), "90".into()),
            ("camera.fov_axis".into(), "x".into()),
        ],
        width: Some(100),
        ..Edits::default()
    };
    let (_, description) = read(&own, edits).unwrap();
    assert_eq!((description.camera.width, description.camera.height), (100, 200));
    assert!((description.camera.half_width - 1.0).abs() < 1e-6);
    let wrong = Edits {
        fields: vec![("camera.fov".into(), "400".into())],
        ..Edits::default()
    };
    let error = read(&own, wrong).unwrap_err();
    assert!(error.starts_with("model.gltf: camera.fov: expected"), "{error}");

    // A surface of uniform radiance is a light; a file whose parts only glow by a texture still gets light.
    own["extensions"] = json!({});
    own["nodes"].as_array_mut().unwrap().truncate(3);
    own["scenes"][0]["nodes"] = json!([0, 1, 2]);
    own["materials"] = json!([{ "emissiveFactor": [1, 1, 1] }]);
    let (glowing, _) = read(&own, Edits::default()).unwrap();
    assert!(!says(&glowing, "it has no lights:"));
    assert!(says(&glowing, "no lights but surfaces that emit"));
    own["materials"] = json!([{}]);
    assert!(says(&read(&own, Edits::default()).unwrap().0, "it has no lights:"));
}

/// A scene in another folder names the file by its relative path and is otherwise the same.
#[test]
fn the_scene_may_stand_in_another_folder() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for name in ["models", "out"] {
        std::fs::create_dir(at(name)).unwrap();
    }
    let mut beside = file(json!({}));
    beside["buffers"][0]["uri"] = json!("a%20b.bin");
    std::fs::write(at("models/a.gltf"), beside.to_string()).unwrap();
    std::fs::write(at("models/a b.bin"), bytes()).unwrap();
    let read = SceneFile::read_for(&at("models/a.gltf"), &at("out"), &Default::default()).unwrap();
    std::fs::write(at("out/a.toml"), read.text()).unwrap();
    let written = SceneFile::read(&at("out/a.toml"), &Default::default()).unwrap();
    assert_eq!(written.text(), read.text());
    assert_eq!(written.bundle.files.len(), 3);
    assert_eq!(written.load().unwrap().objects.len(), 1);

    std::fs::remove_file(at("models/a b.bin")).unwrap();
    for path in ["models/a.gltf", "models/none.glb"] {
        let error = SceneFile::read(&at(path), &Default::default()).unwrap_err();
        assert_eq!(error.file, at(path));
        assert!(error.message.contains("No such file"), "{error}");
    }
    assert!(crate::is_gltf(Path::new("a.GLB")) && !crate::is_gltf(Path::new("glb.toml")));
    assert!(load_with(&json!({}), "").is_err());
}
