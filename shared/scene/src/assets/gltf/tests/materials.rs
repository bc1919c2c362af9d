//! Tests of materials and lights.

use super::{file, load, load_with, material, of_material, png, says, uri};
use beamfarm_render::math::{Rgb, Vec2};
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::bsdf::{Interface, MaterialKind, NormalPerturbation};
use beamfarm_render::world::light::LightKind;
use beamfarm_render::world::medium::Medium;
use beamfarm_render::world::texture::Texture;
use serde_json::{Value, json};

/// Glass of a given roughness and thickness, red after one unit.
pub fn glass(roughness: f64, thickness: f64) -> Value {
    json!({
        "name": "glass",
        "pbrMetallicRoughness": {
            "metallicFactor": 0, "roughnessFactor": roughness, "baseColorFactor": [0.5, 1, 1, 1]
        },
        "extensions": {
            "KHR_materials_transmission": { "transmissionFactor": 1 },
            "KHR_materials_ior": { "ior": 1.75 },
            "KHR_materials_volume": {
                "thicknessFactor": thickness, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0.25]
            }
        }
    })
}

fn interior(description: &SceneDescription) -> Option<Rgb> {
    let interior = description.objects[0].boundary?.interior?;
    match &description.media[usize::from(interior)] {
        Medium::Homogeneous(medium) => {
            assert_eq!(medium.sigma_s, Rgb::ZERO);
            Some(medium.sigma_a)
        }
        Medium::Heterogeneous(_) => None,
    }
}

fn assert_near(found: Rgb, expected: [f64; 3]) {
    let expected = Rgb::from_array(expected.map(|x| x as f32));
    assert!((found - expected).abs().max_element() < 1e-5, "{found}, {expected}");
}

#[test]
fn transmission_is_glass_and_its_volume_absorbs() {
    let smooth = of_material(glass(0.0, 1.0), json!({}));
    let MaterialKind::Dielectric { eta, tint } = &material(&smooth).kind else {
        panic!("{:?}", material(&smooth));
    };
    assert_eq!(*eta, 1.75);
    assert!(matches!(tint.transmittance, Texture::Constant(c) if c == Rgb::new(0.5, 1.0, 1.0)));
    let ln2 = std::f64::consts::LN_2;
    assert_near(interior(&smooth).unwrap(), [0.0, ln2 / 2.0, ln2]);

    let rough = of_material(glass(0.5, 1.0), json!({}));
    assert!(
        matches!(&material(&rough).kind, MaterialKind::RoughDielectric { alpha, eta, .. }
            if alpha.range() == [0.25; 2] && *eta == 1.75)
    );
    assert!(interior(&rough).is_some());

    // Without thickness it is a thin pane without an inside.
    let pane = of_material(glass(0.5, 0.0), json!({}));
    assert!(matches!(material(&pane).kind, MaterialKind::ThinDielectric { eta, .. } if eta == 1.75));
    assert!(interior(&pane).is_none() && says(&pane, "panes (transmission without thickness) are smooth"));

    // The attenuation distance is in the file's units.
    let twice = load_with(
        &file(json!({ "materials": [glass(0.0, 1.0)] })),
        "transform = [{ scale = 2 }]",
    );
    assert_near(interior(&twice.unwrap()).unwrap(), [0.0, ln2 / 4.0, ln2 / 2.0]);
}

#[test]
fn an_open_mesh_has_no_inside() {
    // Three of the four triangles.
    let mut open = file(json!({ "materials": [glass(0.0, 1.0)] }));
    open["accessors"][2]["count"] = json!(9);
    let description = load(&open);
    assert!(matches!(material(&description).kind, MaterialKind::Dielectric { .. }));
    assert!(interior(&description).is_none());
    assert!(says(
        &description,
        "a.gltf: the attenuation of KHR_materials_volume is left out"
    ));
}

/// By a number or a texture: a blend of glass with the rest of the material.
#[test]
fn partial_transmission_is_a_blend_with_glass() {
    let mut half = glass(0.0, 1.0);
    half["extensions"]["KHR_materials_transmission"]["transmissionFactor"] = json!(0.25);
    let weight_of = |description: &SceneDescription| match &material(description).kind {
        MaterialKind::Blend { parts, weight } => {
            assert!(matches!(parts[0].kind, MaterialKind::Principled { .. }));
            assert!(matches!(parts[1].kind, MaterialKind::Dielectric { .. }));
            weight.clone()
        }
        other => panic!("{other:?}"),
    };
    let description = of_material(half.clone(), json!({}));
    assert!(matches!(weight_of(&description), Texture::Constant(c) if c == Rgb::splat(0.25)));
    assert!(interior(&description).is_some());
    half["extensions"]["KHR_materials_transmission"]["transmissionTexture"] = json!({ "index": 0 });
    let pictures = json!({
        "textures": [{ "source": 0 }],
        "images": [{ "uri": png([[0, 9, 9, 255], [255, 9, 9, 255]]) }],
    });
    let Texture::Image { image, .. } = weight_of(&of_material(half, pictures)) else {
        panic!();
    };
    assert_eq!(image.pixels, [Rgb::ZERO, Rgb::splat(0.25)]);
}

#[test]
fn metals_transmit_nothing() {
    let mut metal = glass(0.0, 1.0);
    metal["pbrMetallicRoughness"]["metallicFactor"] = json!(1);
    let description = of_material(metal, json!({}));
    assert!(matches!(material(&description).kind, MaterialKind::Principled { .. }));
}

#[test]
fn specular_scales_the_reflectance_at_normal_incidence() {
    let specular = |factor: f64, color: f64| {
        let material = json!({ "extensions": { "KHR_materials_specular": {
            "specularFactor": factor, "specularColorFactor": [color, color, color]
        } } });
        let description = of_material(material, json!({}));
        match &super::material(&description).kind {
            MaterialKind::Principled {
                interface: Interface::Eta(eta),
                ..
            } => {
                let amplitude = f64::from((eta - 1.0) / (eta + 1.0));
                amplitude * amplitude
            }
            // The default reflectance.
            MaterialKind::Principled { .. } => 0.04,
            other => panic!("{other:?}"),
        }
    };
    for (factor, color) in [(1.0, 1.0), (0.5, 1.0), (0.5, 3.0), (0.0, 1.0)] {
        let expected = 0.04 * factor * color;
        let found = specular(factor, color);
        assert!((found - expected).abs() < 1e-6, "{found}, {expected}");
    }
}

#[test]
fn specular_factors_may_be_alpha_of_textures() {
    let pictures = json!({
        "textures": [{ "source": 0 }],
        "images": [{ "uri": png([[255, 255, 255, 51], [255, 255, 255, 204]]) }],
    });
    let specular = json!({ "specularFactor": 0.5, "specularTexture": { "index": 0 } });
    let shiny = json!({ "extensions": { "KHR_materials_specular": specular } });
    let description = of_material(shiny, pictures.clone());
    match &material(&description).kind {
        MaterialKind::Principled { interface, .. } => {
            let said = format!("{interface:?}");
            assert!(said.contains("Specular"), "{said}");
        }
        other => panic!("{other:?}"),
    }
    // Values beyond the range of `specular` count by their mean.
    let specular = json!({ "specularColorFactor": [9, 9, 9], "specularTexture": { "index": 0 } });
    let bright = json!({ "extensions": { "KHR_materials_specular": specular } });
    let description = of_material(bright, pictures);
    assert!(says(
        &description,
        "textures of KHR_materials_specular count by their mean"
    ));
}

/// A metal with the specular colour, or a dielectric with the diffuse colour.
#[test]
fn specular_and_gloss_are_converted() {
    let of_gloss = |diffuse: Value, specular: Value| {
        let material = json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": {
            "diffuseFactor": diffuse, "specularFactor": specular, "glossinessFactor": 0.75
        } } });
        let description = of_material(material, json!({}));
        assert!(says(&description, "KHR_materials_pbrSpecularGlossiness is converted"));
        match &super::material(&description).kind {
            MaterialKind::Principled {
                base_color: Texture::Constant(color),
                metallic,
                roughness,
                ..
            } => (*color, metallic.range()[0], roughness.range()[0]),
            other => panic!("{other:?}"),
        }
    };
    let (color, metallic, roughness) = of_gloss(json!([0.5, 0.25, 0.125, 1]), json!([0.04, 0.04, 0.04]));
    assert_near(color, [0.5, 0.25, 0.125]);
    assert_eq!((metallic, roughness), (0.0, 0.25));
    let (color, metallic, _) = of_gloss(json!([0, 0, 0, 1]), json!([1.0, 0.75, 0.5]));
    assert_near(color, [1.0, 0.75, 0.5]);
    assert!(metallic > 0.999);
}

#[test]
fn alpha_is_opacity_by_its_mode() {
    let pictures = json!({
        "textures": [{ "source": 0 }],
        "images": [{ "uri": png([[255, 255, 255, 51], [255, 255, 255, 204]]) }],
    });
    let opacity = |mode: &str, cutoff: Value| {
        let mut leaf = json!({
            "alphaMode": mode,
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 }, "baseColorFactor": [1, 1, 1, 0.5] }
        });
        if !cutoff.is_null() {
            leaf["alphaCutoff"] = cutoff;
        }
        let description = of_material(leaf, pictures.clone());
        match &material(&description).opacity {
            Some(Texture::Image { image, .. }) => image.pixels.iter().map(|p| p.x).collect::<Vec<f32>>(),
            None => Vec::new(),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(opacity("OPAQUE", Value::Null), [0.0f32; 0]);
    assert_eq!(opacity("BLEND", Value::Null), [0.1, 0.4]);
    assert_eq!(opacity("MASK", Value::Null), [0.0, 0.0]);
    assert_eq!(opacity("MASK", json!(0.25)), [0.0, 1.0]);
    assert_eq!(opacity("MASK", json!(0.1)), [0.0f32; 0]);
    // Without a texture.
    let pane = json!({ "alphaMode": "BLEND", "pbrMetallicRoughness": { "baseColorFactor": [1, 1, 1, 0.25] } });
    let description = of_material(pane, json!({}));
    assert!(matches!(material(&description).opacity, Some(Texture::Constant(c)) if c == Rgb::splat(0.25)));
}

#[test]
fn normals_are_mapped_and_scaled() {
    // (0.6, 0, 0.8) up to rounding.
    let pictures = json!({
        "textures": [{ "source": 0 }],
        "images": [{ "uri": png([[204, 127, 230, 255], [204, 127, 230, 255]]) }],
    });
    let steepness = |scale: f64| {
        let bumpy = json!({ "normalTexture": { "index": 0, "scale": scale } });
        let description = of_material(bumpy, pictures.clone());
        match &material(&description).normal_perturbation {
            Some(NormalPerturbation::NormalMap(Texture::Image { image, .. })) => {
                let n = image.pixels[0] * 2.0 - Rgb::ONE;
                n.x / n.z
            }
            other => panic!("{other:?}"),
        }
    };
    assert!((steepness(1.0) - 0.75).abs() < 0.01);
    assert!((steepness(2.0) - 2.0 * steepness(1.0)).abs() < 1e-5);
}

/// Each texture has its own transform; those on another UV set than the first count by their mean.
#[test]
fn textures_have_their_own_places() {
    let turned = json!({ "index": 0, "extensions": { "KHR_texture_transform": {
        "offset": [0.25, 0.5], "rotation": std::f64::consts::FRAC_PI_2, "scale": [2, 4]
    } } });
    let pictures = json!({
        "textures": [{ "source": 0 }],
        "images": [{ "uri": png([[255, 0, 0, 255], [255, 0, 0, 255]]) }],
    });
    let both = json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } }, "normalTexture": turned });
    let description = of_material(both, pictures.clone());
    let MaterialKind::Principled {
        base_color: Texture::Image { image_from_uv, .. },
        ..
    } = &material(&description).kind
    else {
        panic!();
    };
    assert_eq!(image_from_uv.transform_point2(Vec2::new(0.3, 0.7)), Vec2::new(0.3, 0.7));
    let Some(NormalPerturbation::NormalMap(Texture::Image { image_from_uv, .. })) =
        &material(&description).normal_perturbation
    else {
        panic!();
    };
    // With v downwards: (u, v) = (0.25, 0.5) is scaled to (0.5, 2), turned to (2, -0.5), moved to (2.25, 0).
    let found = image_from_uv.transform_point2(Vec2::new(0.25, 0.5));
    assert!((found - Vec2::new(2.25, 1.0)).length() < 1e-6, "{found}");

    let apart = json!({
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "texCoord": 1 } },
        "normalTexture": { "index": 0 },
    });
    let description = of_material(apart, pictures);
    assert!(material(&description).normal_perturbation.is_none());
    assert!(says(&description, "several sets of texture coordinates"));
}

#[test]
fn what_does_not_count_is_said() {
    let odd = json!({
        "name": "odd",
        "occlusionTexture": { "index": 0 },
        "extensions": {
            "VENDOR_materials_odd": {},
        }
    });
    let more = json!({
        "extensionsUsed": ["EXT_lights_image_based"],
        "animations": [{ "channels": [], "samplers": [] }],
        "textures": [{ "source": 0 }],
        "images": [{ "uri": png([[0; 4]; 2]) }],
    });
    let description = of_material(odd, more);
    for words in [
        "textures of occlusion do not count, since shadows are found by light: materials: \"odd\"",
        "VENDOR_materials_odd is not supported and does not count: materials: \"odd\"",
        "EXT_lights_image_based is not supported",
        "animations do not play",
    ] {
        assert!(says(&description, words), "{words}: {:?}", description.notes);
    }
}

#[test]
fn what_is_unlit_shines_for_those_who_look_alone() {
    let unlit = json!({
        "pbrMetallicRoughness": { "baseColorFactor": [0.25, 0.5, 1.0, 1.0] },
        "emissiveFactor": [1.0, 1.0, 1.0],
        "extensions": { "KHR_materials_unlit": {} },
    });
    let description = of_material(unlit, json!({ "extensionsUsed": ["KHR_materials_unlit"] }));
    let radiance = |light: &beamfarm_render::world::light::Light| match light.kind {
        LightKind::Area { radiance, .. } => radiance,
        ref other => panic!("{other:?}"),
    };
    let found: Vec<_> = description.lights.iter().map(radiance).collect();
    assert_eq!(found, [Rgb::new(0.25, 0.5, 1.0)]);
    assert!(
        says(&description, "light nothing and cast no shadow"),
        "{:?}",
        description.notes
    );
}

#[test]
fn what_a_file_cannot_do_without_is_an_error_by_its_name() {
    for name in ["EXT_texture_avif", "MSFT_texture_dds", "VENDOR_other"] {
        let error = load_with(&file(json!({ "extensionsRequired": [name] })), "").unwrap_err();
        assert!(
            error.starts_with(&format!("a.gltf: it says that it cannot do without {name}, which")),
            "{error}"
        );
    }
    let known = json!({ "extensionsRequired": ["KHR_materials_volume", "KHR_mesh_quantization"] });
    assert!(load_with(&file(known), "").is_ok());
    let avif = load_with(&file(json!({ "extensionsRequired": ["EXT_texture_avif"] })), "").unwrap_err();
    assert!(
        avif.contains("textures are in AVIF, which is not read. `gltf-transform png"),
        "{avif}"
    );
}

/// Unknown extensions that only change a material's look are noted, even if the file requires them.
#[test]
fn looks_can_be_done_without() {
    for name in ["VENDOR_materials_odd", "VENDOR_materials_other"] {
        let required = json!({ "extensionsUsed": [name], "extensionsRequired": [name] });
        let odd = json!({ "name": "odd", "extensions": { name: {} } });
        let description = of_material(odd, required);
        assert!(
            says(&description, &format!("{name} is not supported")),
            "{name}: {:?}",
            description.notes
        );
    }
}

/// A version 1 file, one whose buffers are only fallbacks, and an image of another format.
#[test]
fn what_a_file_is_is_said() {
    let old = json!({ "asset": { "version": "1.0" }, "buffers": {}, "meshes": {}, "nodes": {}, "scene": "s" });
    let error = load_with(&old, "").unwrap_err();
    assert!(
        error.starts_with("a.gltf: it is glTF 1.0, which is not read; expected 2.0. `gltf-pipeline"),
        "{error}"
    );
    let mut binary = b"glTF\x01\0\0\0".to_vec();
    binary.extend([64, 0, 0, 0, 40, 0, 0, 0, 0, 0, 0, 0]);
    binary.extend([b' '; 44]);
    let error = crate::assets::gltf::files(&binary).unwrap_err().message;
    assert!(error.starts_with("it is glTF 1.0"), "{error}");

    let name = "EXT_meshopt_compression";
    let mut packed = file(json!({ "extensionsUsed": [name] }));
    packed["buffers"] = json!([{ "byteLength": 92, "extensions": { name: { "fallback": true } } }]);
    let error = load_with(&packed, "").unwrap_err();
    assert!(
        error.contains("it reads a buffer that is there for packed views alone"),
        "{error}"
    );

    let texture = json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } });
    let ktx = file(json!({
        "materials": [texture],
        "extensionsUsed": ["KHR_texture_basisu"],
        "textures": [{ "extensions": { "KHR_texture_basisu": { "source": 0 } } }],
        "images": [{ "uri": uri("image/ktx2", b"\xabKTX 20\xbb\r\n\x1a\n") }],
    }));
    let error = load_with(&ktx, "").unwrap_err();
    assert!(
        error.contains("image 0: not a sound KTX2 texture of Basis Universal: its header"),
        "{error}"
    );
}

/// Blender writes candela, 683 per W/sr.
#[test]
fn lights_have_the_unit_of_the_program_that_wrote_them() {
    let intensity = |generator: &str, fields: &str| {
        let mut lit = file(json!({
            "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 1366 }] } },
            "nodes": [{ "name": "lamp", "extensions": { "KHR_lights_punctual": { "light": 0 } } }],
        }));
        lit["asset"]["generator"] = json!(generator);
        let description = load_with(&lit, fields).unwrap();
        match description.lights[0].kind {
            LightKind::Point { intensity, .. } => (intensity.x, says(&description, "683 to the watt")),
            ref other => panic!("{other:?}"),
        }
    };
    let blender = "Khronos glTF Blender I/O v4.5.51";
    assert_eq!(intensity(blender, ""), (2.0, true));
    assert_eq!(intensity(blender, "light_unit = \"watt\""), (1366.0, false));
    assert_eq!(intensity("by hand", ""), (1366.0, false));
    assert_eq!(intensity("by hand", "light_unit = \"lumen\""), (2.0, false));
}

/// Solid glass disperses by the file's Abbe number.
#[test]
fn glass_may_disperse() {
    let of = |dispersion: f64| {
        let made = file(json!({
            "materials": [{ "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 0.0 }, "extensions": {
                "KHR_materials_transmission": { "transmissionFactor": 1.0 },
                "KHR_materials_volume": { "thicknessFactor": 1.0 },
                "KHR_materials_dispersion": { "dispersion": dispersion },
            } }],
            "extensionsUsed": ["KHR_materials_dispersion"],
        }));
        let found = load(&made);
        assert!(
            found.notes.iter().all(|note| !note.contains("dispersion")),
            "{:?}",
            found.notes
        );
        material(&found).dispersion.is_some()
    };
    assert_eq!([of(0.0), of(0.4)], [false, true]);
}
