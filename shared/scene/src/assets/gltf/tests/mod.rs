//! Tests with small files.

mod animation;
mod anisotropy;
mod bounds;
mod gloss;
mod left_out;
mod lobes;
mod lone;
mod materials;
mod meshes;
mod packed;
mod tangents;

use base64::Engine;
use beamfarm_image::bundle::Bundle;
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::bsdf::Material;
use serde_json::{Value, json};

/// A closed tetrahedron: positions, then texture coordinates, then the indices of its four triangles as bytes.
fn bytes() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut put = |values: &[f32]| bytes.extend(values.iter().flat_map(|x| x.to_le_bytes()));
    put(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    put(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.5, 0.25]);
    bytes.extend([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]);
    bytes
}

fn uri(kind: &str, bytes: &[u8]) -> String {
    let encoded = base64::engine::general_purpose::STANDARD.encode(bytes);
    format!("data:{kind};base64,{encoded}")
}

/// A file of one node with the tetrahedron, and the fields of `with`.
fn file(with: Value) -> Value {
    let mut file = json!({
        "asset": { "version": "2.0" },
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "name": "thing", "mesh": 0 }],
        "meshes": [{ "primitives": [{
            "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "indices": 2, "material": 0
        }] }],
        "materials": [{}],
        "buffers": [{ "byteLength": bytes().len(), "uri": uri("application/octet-stream", &bytes()) }],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 32 },
            { "buffer": 0, "byteOffset": 80, "byteLength": 12 },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1] },
            { "bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2" },
            { "bufferView": 2, "componentType": 5121, "count": 12, "type": "SCALAR" },
        ],
    });
    for (name, value) in with.as_object().unwrap() {
        file[name] = value.clone();
    }
    file
}

/// A two-pixel PNG.
fn png(pixels: [[u8; 4]; 2]) -> String {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 2, 1);
    encoder.set_color(png::ColorType::Rgba);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&pixels.concat()).unwrap();
    writer.finish().unwrap();
    uri("image/png", &bytes)
}

/// A scene that names the file, with fields of its `[[gltf]]`.
fn load_with(file: &Value, fields: &str) -> Result<SceneDescription, String> {
    let text = format!(
        "image = {{ width = 12, height = 8 }}\ncamera = {{ origin = [0, 0, 9], target = [0, 0, 0], fov = 40 }}\n\
         [[gltf]]\nfile = \"a.gltf\"\n{fields}"
    );
    let mut bundle = Bundle {
        scene: "scene.toml".into(),
        ..Bundle::default()
    };
    bundle.files.insert("a.gltf".into(), file.to_string().into());
    bundle.files.insert("scene.toml".into(), text.into());
    crate::load(&bundle).map_err(|error| error.to_string())
}

fn load(file: &Value) -> SceneDescription {
    load_with(file, "").unwrap()
}

/// A scene whose only object has this material.
fn of_material(material: Value, more: Value) -> SceneDescription {
    let mut with = more;
    with["materials"] = json!([material]);
    load(&file(with))
}

/// The material of the first object.
fn material(description: &SceneDescription) -> &Material {
    &description.materials[description.objects[0].material as usize]
}

fn says(description: &SceneDescription, words: &str) -> bool {
    description.notes.iter().any(|note| note.contains(words))
}
