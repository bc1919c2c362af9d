//! A glTF file in place of a scene.

use crate::setup::{fail, folder_with, line, run, scene, succeed, text};

/// A triangle with positions only.
const MODEL: &str = r#"{ "asset": { "version": "2.0" }, "scenes": [{ "nodes": [0] }],
"nodes": [{ "name": "sail", "mesh": 0 }], "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
"accessors": [{
    "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]
}],
"bufferViews": [{ "buffer": 0, "byteLength": 36 }], "buffers": [{ "byteLength": 36, "uri": "sail.bin" }] }"#;

#[test]
fn a_gltf_file_renders_as_its_conversion_does() {
    let folder = folder_with(&scene([8, 8], 1, 10));
    let folder = folder.path();
    std::fs::write(folder.join("sail.gltf"), MODEL).unwrap();
    let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    std::fs::write(folder.join("sail.bin"), corners.map(f32::to_le_bytes).concat()).unwrap();
    std::fs::create_dir(folder.join("out")).unwrap();
    let sizes = ["--width", "24", "-D", "camera.fov=20", "--paths", "100", "--seed", "3"];
    let passes = ["--passes", "2", "--workers", "1"];
    let direct = run(folder, &[&["render", "sail.gltf"], &sizes[..], &passes[..]].concat());
    let notes = text(&direct.stderr);
    assert!(direct.status.success(), "{notes}");
    assert!(notes.contains("note: sail.gltf: it has no lights"), "{notes}");
    let direct = text(&direct.stdout).to_owned();
    assert!(line(&direct, "2 passes").starts_with("2 passes"));
    succeed(folder, &["convert", "sail.gltf", "out/boat.toml"]);
    let written = std::fs::read_to_string(folder.join("out/boat.toml")).unwrap();
    assert!(written.contains("file = \"../sail.gltf\""), "{written}");
    let native = succeed(
        folder,
        &[
            &["render", "out/boat.toml"],
            &sizes[..],
            &passes[..],
            &["-o", "boat.exr"],
        ]
        .concat(),
    );
    assert_eq!(line(&direct, "pixels"), line(&native, "pixels"));
    let explained = succeed(folder, &[&["explain", "sail.gltf"], &sizes[..]].concat());
    assert!(explained.contains("sail"), "{explained}");
    let replayed = succeed(folder, &[&["replay", "sail.gltf", "--pass", "0"], &sizes[..]].concat());
    line(&replayed, "pass 0 pixels");
    succeed(
        folder,
        &["reference", "sail.gltf", "--width", "24", "--samples", "1", "--quiet"],
    );

    for (args, words) in [
        (
            &["render", "sail.gltf", "-D", "camera.fov=400"][..],
            "sail.gltf: -D camera.fov=400: camera.fov: expected",
        ),
        (
            &["render", "sail.gltf", "-D", "lights.7.power=4"],
            "-D lights.7.power=4: lights.7: there are 2",
        ),
        (&["render", "sail.gltf", "--skip-unsupported"], ".xml"),
        (&["explain", "none.glb"], "none.glb: "),
    ] {
        let (code, message) = fail(folder, args);
        assert!(code == 2 && message.contains(words), "{args:?}: {message}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
}
