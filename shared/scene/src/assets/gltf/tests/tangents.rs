//! TANGENT: `bitangent = cross(normal, tangent.xyz) * tangent.w` (glTF 2.0, 3.7.2.1).

use super::*;
use beamfarm_render::math::{Ray, Vec3};
use beamfarm_render::world::Scene;
use beamfarm_render::world::geometry::{Mesh, SurfaceHit};
use glam::Mat3;

/// A pixel of the normal map, as (x + 1) / 2.
const NORMAL: [u8; 4] = [217, 166, 230, 255];

/// The direction it encodes.
fn direction() -> Vec3 {
    Vec3::new(217.0, 166.0, 230.0) / 255.0 * 2.0 - 1.0
}

/// A triangle with normals, texture coordinates along x and y, and tangents.
fn triangle(tangents: [[f32; 4]; 3], material: Value) -> Value {
    let mut bytes = Vec::new();
    let mut put = |values: &[f32]| bytes.extend(values.iter().flat_map(|x| x.to_le_bytes()));
    put(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    put(&[0.0, 0.0, 1.0].repeat(3));
    put(&[0.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
    put(tangents.as_flattened());
    let of = |view: u32, kind: &str| json!({ "bufferView": view, "componentType": 5126, "count": 3, "type": kind });
    let view = |offset: u32, length: u32| json!({ "buffer": 0, "byteOffset": offset, "byteLength": length });
    file(json!({
        "meshes": [{ "primitives": [{
            "attributes": { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "TANGENT": 3 }, "material": 0
        }] }],
        "materials": [material],
        "textures": [{ "source": 0 }],
        "images": [{ "uri": png([NORMAL, NORMAL]) }],
        "buffers": [{ "byteLength": bytes.len(), "uri": uri("application/octet-stream", &bytes) }],
        "bufferViews": [view(0, 36), view(36, 36), view(72, 24), view(96, 48)],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
            of(1, "VEC3"), of(2, "VEC2"), of(3, "VEC4"),
        ],
    }))
}

fn mapped() -> Value {
    json!({ "normalTexture": { "index": 0 }, "doubleSided": true })
}

fn mesh(description: &SceneDescription) -> &Mesh {
    description.objects[0].shape.mesh().unwrap()
}

/// The hit of a ray from above at a world position.
fn hit(scene: &Scene, x: f32, y: f32) -> (SurfaceHit, Vec3) {
    let from_camera = |p: Vec3| p - Vec3::new(0.0, 0.0, 9.0);
    let ray = Ray {
        origin: from_camera(Vec3::new(x, y, 5.0)),
        dir: Vec3::NEG_Z,
    };
    let mut hit = scene.first_hit(&ray, |_| false).expect("the triangle");
    let material = scene.material(&hit);
    let frame = scene.interaction(material, &mut hit, ray.dir, None).frame;
    (hit, frame.s)
}

/// The shading normal at a place.
fn turned(file: &Value, [x, y]: [f32; 2]) -> Vec3 {
    hit(&Scene::new(load(file)), x, y).0.ns
}

/// The expected normal: the map's, in the frame of tangent, bitangent and normal, under a linear map.
fn expected(t: Vec3, w: f32, map: Mat3) -> Vec3 {
    let (n, d) = (Vec3::Z, direction());
    let along = map * t;
    let up = map.inverse().transpose() * n;
    (along.normalize() * d.x + (map * n.cross(t) * w).normalize() * d.y + up.normalize() * d.z).normalize()
}

#[track_caller]
fn near(found: Vec3, expected: Vec3) {
    assert!((found - expected).length() < 1e-5, "{found} {expected}");
}

#[test]
fn bitangents_are_on_the_side_that_the_file_says() {
    let t = Vec3::new(0.6, 0.8, 0.0);
    for w in [1.0, -1.0] {
        let of = |with: Value| {
            let mut file = triangle([[0.6, 0.8, 0.0, w]; 3], mapped());
            for (name, value) in with.as_object().unwrap() {
                file[name] = value.clone();
            }
            file
        };
        near(turned(&of(json!({})), [0.2, 0.3]), expected(t, w, Mat3::IDENTITY));
        // A mirrored node, alone and as one of several.
        let mirror = Mat3::from_diagonal(Vec3::new(-2.0, 2.0, 2.0));
        let node = json!({ "mesh": 0, "scale": [-2, 2, 2] });
        let alone = of(json!({ "nodes": [node] }));
        near(turned(&alone, [-0.4, 0.6]), expected(t, w, mirror));
        let several = of(json!({
            "scenes": [{ "nodes": [0, 1] }], "nodes": [{ "mesh": 0, "translation": [5, 0, 0] }, node],
        }));
        near(turned(&several, [-0.4, 0.6]), expected(t, w, mirror));
        near(turned(&several, [5.2, 0.3]), expected(t, w, Mat3::IDENTITY));
    }
}

#[test]
fn tangents_lie_between_those_of_the_corners_and_may_be_quantized() {
    let corners = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]];
    let file = triangle(corners, mapped());
    let between = Vec3::new(0.75, 0.25, 0.0).normalize();
    near(turned(&file, [0.25, 0.5]), expected(between, 1.0, Mat3::IDENTITY));
    // As bytes: (127, 0, 0, -127) each.
    let mut small = file.clone();
    let bytes = [127u8, 0, 0, 129].repeat(3);
    let buffer = json!({ "byteLength": 12, "uri": uri("application/octet-stream", &bytes) });
    small["buffers"].as_array_mut().unwrap().push(buffer);
    let view = json!({ "buffer": 1, "byteLength": 12 });
    small["bufferViews"].as_array_mut().unwrap().push(view);
    small["accessors"][3] =
        json!({ "bufferView": 4, "componentType": 5120, "normalized": true, "count": 3, "type": "VEC4" });
    near(turned(&small, [0.25, 0.5]), expected(Vec3::X, -1.0, Mat3::IDENTITY));
}

/// Tangents that nothing needs, without normals, and without a direction.
#[test]
fn tangents_are_read_where_something_goes_by_them() {
    let along = [[0.6, 0.8, 0.0, -1.0]; 3];
    assert_eq!(mesh(&load(&triangle(along, mapped()))).given_tangents.len(), 3);
    assert!(mesh(&load(&triangle(along, json!({})))).given_tangents.is_empty());
    let mut faces = triangle(along, mapped());
    let attributes = &mut faces["meshes"][0]["primitives"][0]["attributes"];
    attributes.as_object_mut().unwrap().remove("NORMAL");
    assert!(mesh(&load(&faces)).given_tangents.is_empty());
    // Tangents follow the texture coordinates: x along u, y against the file's v.
    let nowhere = triangle([[0.0, 0.0, 1.0, -1.0], [0.0; 4], [f32::NAN, 0.0, 0.0, 1.0]], mapped());
    near(turned(&nowhere, [0.2, 0.3]), expected(Vec3::X, 1.0, Mat3::IDENTITY));
}

/// The rotation runs from the tangent towards the bitangent.
#[test]
fn brushed_metal_is_turned_to_the_bitangent() {
    for w in [1.0, -1.0] {
        let metal = json!({
            "pbrMetallicRoughness": { "metallicFactor": 1, "roughnessFactor": 0.5 },
            "extensions": { "KHR_materials_anisotropy": { "anisotropyStrength": 0.5, "anisotropyRotation": 0.3 } },
        });
        let scene = Scene::new(load(&triangle([[0.6, 0.8, 0.0, w]; 3], metal)));
        let (_, along) = hit(&scene, 0.2, 0.3);
        let (sin, cos) = libm::sincosf(0.3);
        let t = Vec3::new(0.6, 0.8, 0.0);
        let expected = t * cos + Vec3::Z.cross(t) * (w * sin);
        // Opposite directions are equivalent.
        near(along * along.dot(expected).signum(), expected);
    }
}
