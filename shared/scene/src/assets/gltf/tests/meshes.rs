//! Tests of accessors and poses.

use super::{bytes, file, load, load_with, material, png, says, uri};
use beamfarm_render::math::{Rgb, Vec2, Vec3};
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::bsdf::{BsdfFlags, MaterialKind};
use beamfarm_render::world::geometry::{Mesh, Shape};
use beamfarm_render::world::texture::TexturePoint;
use serde_json::json;

fn mesh(description: &SceneDescription) -> &Mesh {
    match &description.objects[0].shape {
        Shape::Mesh { mesh, .. } => mesh,
        other => panic!("{other:?}"),
    }
}

/// World positions; the camera is at (0, 0, 9).
fn positions(description: &SceneDescription) -> Vec<[f32; 3]> {
    let camera = Vec3::new(0.0, 0.0, 9.0);
    mesh(description)
        .positions
        .iter()
        .map(|p| (*p + camera).to_array())
        .collect()
}

/// Add a second buffer and a view of all of it.
fn with_bytes(file: &mut serde_json::Value, more: &[u8]) {
    let buffer = json!({ "byteLength": more.len(), "uri": uri("application/octet-stream", more) });
    file["buffers"].as_array_mut().unwrap().push(buffer);
    let view = json!({ "buffer": 1, "byteLength": more.len() });
    file["bufferViews"].as_array_mut().unwrap().push(view);
}

#[test]
fn sparse_accessors_change_some_elements_of_a_view_or_of_zeros() {
    let mut more = vec![1, 3, 0, 0];
    more.extend([5.0f32, 6.0, 7.0, 8.0, 9.0, 10.0].iter().flat_map(|x| x.to_le_bytes()));
    let sparse = json!({
        "count": 2,
        "indices": { "bufferView": 3, "componentType": 5121 },
        "values": { "bufferView": 3, "byteOffset": 4 },
    });
    let mut changed = file(json!({}));
    with_bytes(&mut changed, &more);
    changed["accessors"][0]["sparse"] = sparse;
    let expected = [[0.0; 3], [5.0, 6.0, 7.0], [0.0, 1.0, 0.0], [8.0, 9.0, 10.0]];
    assert_eq!(positions(&load(&changed)), expected);

    changed["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    // Two coincident vertices leave degenerate triangles, which are dropped with their unused vertices.
    let found = positions(&load(&changed));
    assert!(
        found.contains(&[5.0, 6.0, 7.0]) && !found.contains(&[0.0, 1.0, 0.0]),
        "{found:?}"
    );

    // Without bytes all positions are zero, so that there is no area.
    let mut zeros = file(json!({}));
    zeros["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    let notes = load(&zeros).notes.join("\n");
    assert!(notes.contains("no triangle of the mesh has an area"), "{notes}");
    assert!(notes.contains("a.gltf"), "{notes}");

    changed["accessors"][0]["count"] = json!(100_000_000);
    let error = load_with(&changed, "").unwrap_err();
    assert!(
        error.contains("100000000 elements are claimed without a buffer view"),
        "{error}"
    );
}

#[test]
fn quantized_positions_are_numbers() {
    let mut small = file(json!({ "extensionsRequired": ["KHR_mesh_quantization"] }));
    with_bytes(&mut small, &[0, 0, 0, 0, 127, 0, 0, 0, 0, 64, 0, 0, 0, 0, 0x81, 0]);
    small["bufferViews"][3]["byteStride"] = json!(4);
    small["accessors"][0] = json!({
        "bufferView": 3, "componentType": 5120, "count": 4, "type": "VEC3", "normalized": true,
        "min": [0, 0, -127], "max": [127, 64, 0]
    });
    let expected = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 64.0 / 127.0, 0.0], [0.0, 0.0, -1.0]];
    assert_eq!(positions(&load(&small)), expected);
}

#[test]
fn morph_targets_have_the_weights_that_the_file_begins_with() {
    let mut morphed = file(json!({}));
    morphed["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 0 }]);
    morphed["meshes"][0]["weights"] = json!([0.5]);
    let description = load(&morphed);
    let expected = [[0.0; 3], [1.5, 0.0, 0.0], [0.0, 1.5, 0.0], [0.0, 0.0, 1.5]];
    assert_eq!(positions(&description), expected);
    // A missing accessor.
    morphed["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 9 }]);
    assert!(load_with(&morphed, "").unwrap_err().contains("names accessor 9"));
}

/// Joints place a skinned mesh; its node does not.
#[test]
fn skins_stand_in_their_rest_pose() {
    let mut skinned = file(json!({
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [
            { "mesh": 0, "skin": 0, "translation": [100, 0, 0] },
            { "translation": [0, 2, 0], "children": [2] },
            { "scale": [2, 2, 2] },
        ],
        "skins": [{ "joints": [1, 2] }],
    }));
    // Joints, then weights of one half.
    with_bytes(&mut skinned, &[0, 1, 0, 0].repeat(4));
    skinned["buffers"][1]["uri"] = json!(uri(
        "application/octet-stream",
        &[[0, 1, 0, 0].repeat(4), [128, 128, 0, 0].repeat(4)].concat()
    ));
    skinned["buffers"][1]["byteLength"] = json!(32);
    skinned["bufferViews"][3]["byteLength"] = json!(32);
    let accessors = skinned["accessors"].as_array_mut().unwrap();
    accessors.push(json!({ "bufferView": 3, "componentType": 5121, "count": 4, "type": "VEC4" }));
    accessors.push(json!({
        "bufferView": 3, "byteOffset": 16, "componentType": 5121, "count": 4, "type": "VEC4", "normalized": true
    }));
    let attributes = json!({ "POSITION": 0, "JOINTS_0": 3, "WEIGHTS_0": 4 });
    skinned["meshes"][0]["primitives"][0]["attributes"] = attributes;
    // The mean of p + (0, 2, 0) and 2 p + (0, 2, 0).
    let expected = [[0.0, 2.0, 0.0], [1.5, 2.0, 0.0], [0.0, 3.5, 0.0], [0.0, 2.0, 1.5]];
    let description = load(&skinned);
    assert_eq!(positions(&description), expected);
    // `[[gltf]]` still moves it.
    let moved = load_with(&skinned, "transform = [{ translate = [1, 0, 0] }]").unwrap();
    assert_eq!(positions(&moved)[0], [1.0, 2.0, 0.0]);

    skinned["skins"] = json!([{ "joints": [1] }]);
    assert!(
        load_with(&skinned, "")
            .unwrap_err()
            .contains("vertex 0 names joint 1, but there are 1")
    );
}

#[test]
fn points_and_lines_are_said_to_be_left_out() {
    let mut mixed = file(json!({}));
    let primitives = mixed["meshes"][0]["primitives"].as_array_mut().unwrap();
    primitives.push(json!({ "attributes": { "POSITION": 0 }, "mode": 0 }));
    let description = load(&mixed);
    assert_eq!(description.objects.len(), 1);
    assert!(says(&description, "points and lines are left out: of nodes: \"thing\""));
    assert_eq!(bytes().len(), 92);
}

/// Damaged files are read or refused, without a panic.
#[test]
fn damaged_files_are_refused_or_read() {
    let mut good = file(json!({
        "nodes": [{ "mesh": 0, "skin": 0, "weights": [0.5] }],
        "skins": [{ "joints": [0], "inverseBindMatrices": 0 }],
        "materials": [{ "alphaMode": "MASK", "extensions": {
            "KHR_materials_transmission": { "transmissionFactor": 1 },
            "KHR_materials_volume": { "thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0, 0] },
        } }],
    }));
    let primitive = &mut good["meshes"][0]["primitives"][0];
    primitive["attributes"]["JOINTS_0"] = json!(0);
    primitive["attributes"]["WEIGHTS_0"] = json!(0);
    primitive["targets"] = json!([{ "POSITION": 0 }]);
    let still = json!({ "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
        "samplers": [{ "input": 2, "output": 0, "interpolation": "CUBICSPLINE" }] });
    good["animations"] = json!([still]);
    crate::assets::damage::damage(&[good.to_string().into()], |bytes| {
        let choice = super::super::Choice {
            materials: true,
            lights: true,
            light_unit: None,
        };
        let beside = |_: &str| None;
        let there = super::super::There {
            world_from_file: &glam::DAffine3::IDENTITY,
            seconds: Some(0.3),
        };
        let _ = super::super::read("a.gltf", bytes, &beside, there, choice);
        let _ = super::super::scene("a.gltf", bytes, &beside);
        let _ = super::super::files(bytes);
    });
}

/// Bytes are linear in [0, 1] and multiply the base colour or its texture. White ones are dropped.
#[test]
fn colours_of_vertices_are_multiplied_by_the_base_colour() {
    let colored = |alpha: u8, material: serde_json::Value| {
        let mut colored = file(json!({ "materials": [material] }));
        with_bytes(&mut colored, &[255, 0, 51, alpha].repeat(4));
        let accessor =
            json!({ "bufferView": 3, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC4" });
        colored["accessors"].as_array_mut().unwrap().push(accessor);
        colored["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(3);
        colored
    };
    let color_of = |description: &SceneDescription| {
        let MaterialKind::Principled { base_color, .. } = &material(description).kind else {
            panic!();
        };
        assert_eq!(mesh(description).colors, [Rgb::new(1.0, 0.0, 0.2); 4]);
        let at = TexturePoint {
            uv: Vec2::new(0.25, 0.5),
            color: mesh(description).colors[0],
            ..TexturePoint::default()
        };
        base_color.eval(&at)
    };
    let plain = load(&colored(255, json!({})));
    assert_eq!(color_of(&plain), Rgb::new(1.0, 0.0, 0.2));
    assert!(material(&plain).has(BsdfFlags::READS_COLORS));
    let factor = json!({ "pbrMetallicRoughness": { "baseColorFactor": [0.5, 1, 0.5, 1] } });
    assert_eq!(color_of(&load(&colored(255, factor.clone()))), Rgb::new(0.5, 0.0, 0.1));
    let mut textured = colored(0, factor);
    textured["images"] = json!([{ "uri": png([[255, 255, 255, 255], [0, 0, 0, 255]]) }]);
    textured["samplers"] = json!([{ "magFilter": 9728 }]);
    textured["textures"] = json!([{ "source": 0, "sampler": 0 }]);
    textured["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
    assert_eq!(color_of(&load(&textured)), Rgb::new(0.5, 0.0, 0.1));
    assert!(!says(&load(&textured), "the opacity of colours"));
    textured["materials"][0]["alphaMode"] = json!("BLEND");
    assert!(says(
        &load(&textured),
        "the opacity of colours of vertices does not count: of nodes: \"thing\""
    ));

    // Nothing reads them without materials; white ones change nothing.
    assert!(
        mesh(&load_with(&textured, "materials = false").unwrap())
            .colors
            .is_empty()
    );
    textured["buffers"][1] = json!({ "byteLength": 16, "uri": uri("application/octet-stream", &[255; 16]) });
    let white = load(&textured);
    assert!(mesh(&white).colors.is_empty() && !material(&white).has(BsdfFlags::READS_COLORS));
    textured["accessors"][3]["count"] = json!(3);
    let error = load_with(&textured, "").unwrap_err();
    assert!(
        error.contains("it has 4 positions and 3 colours of vertices"),
        "{error}"
    );
}

/// Hidden nodes and their descendants are left out.
#[test]
fn nodes_may_be_hidden() {
    let hidden = |value: bool| json!({ "KHR_node_visibility": { "visible": value } });
    let nodes = json!([
        { "name": "group", "children": [1, 2] },
        { "name": "one", "mesh": 0 },
        { "name": "other", "mesh": 0, "translation": [3, 0, 0] },
    ]);
    let count = |group: bool, one: bool| {
        let mut file = file(json!({ "nodes": nodes, "extensionsUsed": ["KHR_node_visibility"] }));
        file["nodes"][0]["extensions"] = hidden(group);
        file["nodes"][1]["extensions"] = hidden(one);
        load(&file).objects.len()
    };
    assert_eq!([count(true, true), count(true, false), count(false, true)], [2, 1, 0]);
}

/// A node with instances appears once per instance.
#[test]
fn instances_are_where_they_say() {
    let mut more = Vec::new();
    let numbers = [[1.0f32, 0.0, 0.0], [0.0, 2.0, 0.0], [2.0, 2.0, 2.0], [1.0, 1.0, 3.0]];
    more.extend(numbers.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
    let mut made = file(json!({ "extensionsUsed": ["EXT_mesh_gpu_instancing"] }));
    with_bytes(&mut made, &more);
    let accessor = |offset: u32, count: u32| json!({ "bufferView": 3, "byteOffset": offset, "componentType": 5126, "count": count, "type": "VEC3" });
    let accessors = made["accessors"].as_array_mut().unwrap();
    accessors.extend([accessor(0, 2), accessor(24, 2), accessor(0, 1)]);
    let attributes = json!({ "TRANSLATION": 3, "SCALE": 4 });
    made["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
    let found = load(&made);
    let names: Vec<&str> = found.objects.iter().map(|object| &object.name[..]).collect();
    assert_eq!(names, ["thing[0]", "thing[1]"]);
    let mut highest: Vec<Vec3> = Vec::new();
    for object in &found.objects {
        let (_, high) = beamfarm_render::world::geometry::bounds(&object.shape);
        highest.push(high + Vec3::new(0.0, 0.0, 9.0));
    }
    assert!((highest[0] - Vec3::new(3.0, 2.0, 2.0)).length() < 1e-4, "{highest:?}");
    assert!((highest[1] - Vec3::new(1.0, 3.0, 3.0)).length() < 1e-4, "{highest:?}");
    made["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["SCALE"] = 5.into();
    assert!(
        load_with(&made, "")
            .unwrap_err()
            .contains("as many translations as rotations and scales")
    );
}
