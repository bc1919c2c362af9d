//! KHR_materials_anisotropy.

use super::materials::glass;
use super::{material, of_material, png};
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::bsdf::{MaterialKind, Stretch, Tangent};
use beamfarm_render::world::texture::{Texture, TextureFilter};
use serde_json::{Value, json};

/// By numbers, and by a texture whose red and green give the direction.
#[test]
fn brushed_metal_has_its_tangent() {
    let brushed = |more: Value| {
        let mut extension = json!({ "anisotropyStrength": 0.5, "anisotropyRotation": std::f64::consts::FRAC_PI_2 });
        extension
            .as_object_mut()
            .unwrap()
            .extend(more.as_object().unwrap().clone());
        json!({ "name": "pan", "pbrMetallicRoughness": { "metallicFactor": 1, "roughnessFactor": 0.5 },
            "extensions": { "KHR_materials_anisotropy": extension } })
    };
    let of = |description: &SceneDescription| *material(description).anisotropy.clone().unwrap();
    let plain = of(&of_material(brushed(json!({})), json!({})));
    assert!(matches!(&plain.stretch, Stretch::Strength(strength) if strength.range() == [0.5; 2]));
    assert_eq!(plain.rotation.range(), [0.25; 2]);
    assert_eq!(plain.tangent, Tangent::U);
    let pictures = json!({
        "textures": [{ "source": 0 }],
        // Along u, and against the image's v.
        "images": [{ "uri": png([[255, 128, 255, 255], [128, 255, 102, 255]]) }],
    });
    let described = of_material(brushed(json!({ "anisotropyTexture": { "index": 0 } })), pictures);
    let varies = of(&described);
    let near = |found: [f32; 2], expected: [f32; 2]| {
        assert!(
            (0..2).all(|i| (found[i] - expected[i]).abs() < 2e-3),
            "{found:?} {expected:?}"
        );
    };
    let Stretch::Strength(strength) = &varies.stretch else {
        panic!("{varies:?}");
    };
    near(strength.range(), [0.2, 0.5]);
    // A quarter turn and none; half a turn is equivalent to none.
    let Texture::Image { image, filter, .. } = varies.rotation.texture() else {
        panic!("{varies:?}");
    };
    assert_eq!(*filter, TextureFilter::Nearest);
    let turns: Vec<f32> = image.pixels.iter().map(|p| p.x).collect();
    assert!((turns[0] - 0.25).abs() < 2e-3, "{turns:?}");
    assert!(turns[1].min(0.5 - turns[1]) < 2e-3, "{turns:?}");
    let none = json!({ "extensions": { "KHR_materials_anisotropy": {} } });
    assert!(material(&of_material(none, json!({}))).anisotropy.is_none());
    let mut solid = glass(0.5, 1.0);
    solid["extensions"]["KHR_materials_anisotropy"] = json!({ "anisotropyStrength": 0.5 });
    let solid = of_material(solid, json!({}));
    let MaterialKind::RoughDielectric { alpha, .. } = &material(&solid).kind else {
        panic!("{:?}", material(&solid));
    };
    assert_eq!(alpha.range(), [0.4375; 2]);
    assert!(matches!(of(&solid).stretch, Stretch::Across(across) if across.range() == [0.25; 2]));
}
