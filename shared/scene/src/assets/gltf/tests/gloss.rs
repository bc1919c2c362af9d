//! KHR_materials_pbrSpecularGlossiness with textures.

use super::{material, of_material, png, says};
use beamfarm_render::math::Rgb;
use beamfarm_render::world::bsdf::MaterialKind;
use beamfarm_render::world::texture::Texture;
use serde_json::{Value, json};

/// Each texel is converted as a material of its own would be.
#[test]
fn specular_and_gloss_are_converted_texel_by_texel() {
    // A rough red dielectric (4 % is 56 in sRGB) next to smooth gold.
    let diffuse = png([[200, 40, 40, 255], [0, 0, 0, 255]]);
    let specular = png([[56, 56, 56, 51], [255, 226, 155, 204]]);
    let of = |transform: Value| {
        let mut textured = json!({ "index": 1 });
        textured["extensions"] = json!({ "KHR_texture_transform": transform });
        let material = json!({ "name": "both", "extensions": { "KHR_materials_pbrSpecularGlossiness": {
            "diffuseTexture": { "index": 0 }, "specularGlossinessTexture": textured,
        } } });
        let pictures = json!({
            "extensionsUsed": ["KHR_texture_transform"],
            "textures": [{ "source": 0 }, { "source": 1 }],
            "images": [{ "uri": diffuse }, { "uri": specular }],
        });
        of_material(material, pictures)
    };
    let description = of(json!({}));
    let MaterialKind::Principled {
        base_color: Texture::Image { image, .. },
        metallic,
        roughness,
        ..
    } = &material(&description).kind
    else {
        panic!("{:?}", material(&description));
    };
    let near = |a: Rgb, b: [f64; 3]| (a - Rgb::from_array(b.map(|x| x as f32))).abs().max_element() < 0.01;
    assert!(near(image.pixels[0], [0.578, 0.021, 0.021]), "{}", image.pixels[0]);
    assert!(near(image.pixels[1], [1.0, 0.761, 0.328]), "{}", image.pixels[1]);
    let [low, high] = metallic.range();
    assert!(low < 0.02 && high > 0.99, "{low} {high}");
    let [low, high] = roughness.range();
    assert!((low - 0.2).abs() < 0.01 && (high - 0.8).abs() < 0.01, "{low} {high}");
    assert!(!says(&description, "by their mean"), "{:?}", description.notes);
    // Textures placed differently count by their mean.
    let description = of(json!({ "offset": [0.25, 0.0] }));
    assert!(
        says(&description, "do not lie as the diffuse ones do"),
        "{:?}",
        description.notes
    );
    let MaterialKind::Principled { roughness, .. } = &material(&description).kind else {
        panic!("{:?}", material(&description));
    };
    let [low, high] = roughness.range();
    assert!(low == high && (low - 0.5).abs() < 0.01, "{low} {high}");
}
