//! Tests of factors beyond the range of glTF.

use super::{material, of_material, png, says};
use beamfarm_render::math::Rgb;
use beamfarm_render::world::bsdf::MaterialKind;
use beamfarm_render::world::texture::Texture;
use serde_json::{Value, json};

const NOTE: &str = "beyond those that glTF allows";

/// Rounding-sized deviations are not noted, for numbers and with textures.
#[test]
fn factors_that_rounding_has_put_beyond_1_are_1() {
    let pictures = json!({
        "textures": [{ "source": 0 }],
        "images": [{ "uri": png([[255, 255, 255, 255], [255, 255, 255, 255]]) }],
    });
    let plain = json!({ "baseColorFactor": [1.00000012, 0.5, 0.25, 1.0], "metallicFactor": 1.0000002 });
    let mut textured = plain.clone();
    textured["baseColorTexture"] = json!({ "index": 0 });
    for (pbr, more) in [(plain, json!({})), (textured, pictures)] {
        let description = of_material(json!({ "pbrMetallicRoughness": pbr }), more);
        assert!(!says(&description, NOTE), "{:?}", description.notes);
        let MaterialKind::Principled {
            base_color, metallic, ..
        } = &material(&description).kind
        else {
            panic!("{:?}", material(&description));
        };
        assert_eq!(metallic.range(), [1.0; 2]);
        let color = match base_color {
            Texture::Constant(color) => *color,
            Texture::Image { image, .. } => image.pixels[0],
            _ => panic!("{base_color:?}"),
        };
        assert_eq!(color, Rgb::new(1.0, 0.5, 0.25));
    }
}

/// Each is noted, and none is an error.
#[test]
fn factors_that_are_far_beyond_are_told_of() {
    let with = |name: &str, extension: Value| json!({ "name": "odd", "extensions": { name: extension } });
    let cases = [
        json!({ "name": "odd", "pbrMetallicRoughness": { "baseColorFactor": [2.0, -1.0, 0.5, 1.0] } }),
        json!({ "name": "odd", "pbrMetallicRoughness": { "roughnessFactor": 1.5 } }),
        json!({ "name": "odd", "emissiveFactor": [-1.0, 0.0, 0.0] }),
        with("KHR_materials_anisotropy", json!({ "anisotropyStrength": 2.0 })),
        with("KHR_materials_clearcoat", json!({ "clearcoatFactor": 2.0 })),
        with(
            "KHR_materials_diffuse_transmission",
            json!({ "diffuseTransmissionFactor": 0.5, "diffuseTransmissionColorFactor": [3.0, 1.0, 1.0] }),
        ),
        with("KHR_materials_iridescence", json!({ "iridescenceFactor": 2.0 })),
        with(
            "KHR_materials_pbrSpecularGlossiness",
            json!({ "diffuseFactor": [2.0, 1.0, 1.0, 1.0] }),
        ),
        with(
            "KHR_materials_sheen",
            json!({ "sheenColorFactor": [2.0, 1.0, 1.0], "sheenRoughnessFactor": 0.5 }),
        ),
        with("KHR_materials_specular", json!({ "specularFactor": 2.0 })),
        with("KHR_materials_transmission", json!({ "transmissionFactor": 2.0 })),
        json!({ "name": "odd", "extensions": {
            "KHR_materials_transmission": { "transmissionFactor": 1.0 },
            "KHR_materials_volume": {
                "thicknessFactor": 1.0, "attenuationDistance": 1.0, "attenuationColor": [2.0, 1.0, 1.0],
            },
        } }),
    ];
    for case in cases {
        let description = of_material(case.clone(), json!({}));
        let told = format!("{NOTE} count as the nearest allowed: materials: \"odd\"");
        assert!(says(&description, &told), "{case}: {:?}", description.notes);
    }
}

/// Emission may be brighter than 1 without an extension.
#[test]
fn emission_has_no_upper_bound() {
    let description = of_material(json!({ "emissiveFactor": [4.0, 2.0, 1.0] }), json!({}));
    assert!(!says(&description, NOTE), "{:?}", description.notes);
}
