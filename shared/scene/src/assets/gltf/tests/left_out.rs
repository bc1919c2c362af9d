//! Tests of what a file has that cannot be rendered.

use super::*;
use beamfarm_render::math::Rgb;
use beamfarm_render::world::bsdf::MaterialKind;
use beamfarm_render::world::texture::{Image, Texture};
use std::sync::Arc;

const WHITE: [u8; 4] = [255; 4];

fn base_color(description: &SceneDescription) -> &Texture {
    match &material(description).kind {
        MaterialKind::Principled { base_color, .. } => base_color,
        other => panic!("{other:?}"),
    }
}

#[test]
fn textures_without_an_image_are_left_out_and_told() {
    let named = json!({
        "name": "leaf",
        "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1.0], "baseColorTexture": { "index": 1 } },
        "normalTexture": { "index": 0 },
        "extensions": { "KHR_materials_clearcoat": {
            "clearcoatFactor": 1.0, "clearcoatTexture": { "index": 2 }, "clearcoatNormalTexture": { "index": 1 },
        } },
    });
    let textures = json!([
        { "source": 0 },
        { "extensions": { "EXT_texture_avif": { "source": 0 } } },
        { "extensions": { "VENDOR_texture": {} } },
    ]);
    let images = json!([{ "uri": png([WHITE, WHITE]) }]);
    let found = of_material(named.clone(), json!({ "textures": textures.clone(), "images": images }));
    assert!(says(
        &found,
        "texture 1 has no image, but for one by EXT_texture_avif, and is left out: of materials: \"leaf\""
    ));
    assert!(says(
        &found,
        "texture 2 has no image, but for one by VENDOR_texture, and is left out: of materials: \"leaf\""
    ));
    assert!(matches!(base_color(&found), Texture::Constant(color) if (color.x - 0.5).abs() < 1e-6));
    assert!(material(&found).normal_perturbation.is_some());
    // With no image at all there is no substitute.
    let bare = of_material(
        json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }),
        json!({ "textures": [{}] }),
    );
    assert!(says(&bare, "texture 0 has no image and is left out: of materials: 0"));
    assert!(matches!(base_color(&bare), Texture::Constant(color) if *color == Rgb::ONE));
    // An image in an extension is ignored if a standard one is there too.
    let both = json!({
        "textures": [{ "source": 0, "extensions": { "MSFT_texture_dds": { "source": 1 } } }],
        "images": [{ "uri": png([WHITE, WHITE]) }, { "uri": "a.dds" }],
    });
    let both = of_material(
        json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }),
        both,
    );
    assert!(!says(&both, "has no image"));
    assert!(matches!(base_color(&both), Texture::Image { .. }));
}

#[test]
fn primitives_without_positions_are_skipped_and_told() {
    let whole = json!({ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "indices": 2 });
    let bare = json!({ "attributes": { "TEXCOORD_0": 1 }, "indices": 2 });
    let found = load(&file(
        json!({ "meshes": [{ "name": "rock", "primitives": [bare.clone(), whole] }] }),
    ));
    assert_eq!(found.objects.len(), 1);
    assert!(says(
        &found,
        "primitives without POSITION are left out: of meshes: \"rock\""
    ));
    // A mesh may be left empty.
    let two = json!({
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [{ "mesh": 0 }, { "mesh": 1 }],
        "meshes": [
            { "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 2 }] },
            { "primitives": [bare] },
        ],
    });
    let found = load(&file(two));
    assert_eq!(found.objects.len(), 1);
    assert!(says(&found, "primitives without POSITION are left out: of meshes: 1"));
}

/// Images that materials share are converted once.
#[test]
fn materials_share_pictures() {
    let with = |roughness: f64| {
        json!({
            "pbrMetallicRoughness": {
                "baseColorTexture": { "index": 0 }, "baseColorFactor": [0.5, 0.5, 0.5, 1.0],
                "metallicRoughnessTexture": { "index": 0 }, "roughnessFactor": roughness,
            },
            "normalTexture": { "index": 0, "scale": 0.5 },
        })
    };
    let primitive =
        |material: u32| json!({ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "indices": 2, "material": material });
    let found = load(&file(json!({
        "meshes": [{ "primitives": [primitive(0), primitive(1), primitive(2)] }],
        "materials": [with(1.0), with(1.0), with(0.5)],
        "textures": [{ "source": 0 }],
        "images": [{ "uri": png([WHITE, [100, 50, 20, 255]]) }],
    })));
    let pictures = |object: usize| -> [Arc<Image>; 3] {
        let material = &found.materials[found.objects[object].material as usize];
        let MaterialKind::Principled {
            base_color, roughness, ..
        } = &material.kind
        else {
            panic!("{material:?}");
        };
        let map = material.normal_perturbation.as_ref().unwrap().textures()[0];
        [base_color, roughness.texture(), map].map(|texture| match texture {
            Texture::Image { image, .. } => image.clone(),
            other => panic!("{other:?}"),
        })
    };
    let [first, second, third] = [0, 1, 2].map(pictures);
    for (i, (a, b)) in first.iter().zip(&second).enumerate() {
        assert!(Arc::ptr_eq(a, b), "{i}");
    }
    assert!(Arc::ptr_eq(&first[0], &third[0]) && !Arc::ptr_eq(&first[1], &third[1]));
}
