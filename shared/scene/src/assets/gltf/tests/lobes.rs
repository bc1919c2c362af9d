//! Tests of coats, films, sheen and coloured reflections.

use super::{material, of_material, png, says};
use beamfarm_render::math::Rgb;
use beamfarm_render::world::bsdf::{CoatFacing, MaterialKind, NormalPerturbation};
use beamfarm_render::world::texture::{Texture, TexturePoint};
use serde_json::{Value, json};

#[test]
fn coats_and_sheen_are_lobes_of_principled() {
    let coated = json!({
        "name": "car",
        "extensions": {
            "KHR_materials_clearcoat": { "clearcoatFactor": 0.75, "clearcoatRoughnessFactor": 0.2 },
            "KHR_materials_sheen": { "sheenColorFactor": [0.5, 0.25, 0.125], "sheenRoughnessFactor": 0.75 },
        }
    });
    let description = of_material(coated, json!({}));
    let MaterialKind::Principled {
        extras: Some(extras), ..
    } = &material(&description).kind
    else {
        panic!("{:?}", material(&description));
    };
    let coat = extras.coat.as_ref().unwrap();
    assert_eq!(
        (coat.weight.range(), coat.roughness.range(), coat.eta),
        ([0.75; 2], [0.2; 2], 1.5)
    );
    let fuzz = extras.fuzz.as_ref().unwrap();
    assert_eq!((fuzz.weight.range(), fuzz.roughness.range()), ([1.0; 2], [0.75; 2]));
    assert!(matches!(&fuzz.color, Texture::Constant(color) if *color == Rgb::new(0.5, 0.25, 0.125)));
    assert!(!says(&description, "KHR_materials_sheen"), "{:?}", description.notes);
    let none = json!({ "extensions": { "KHR_materials_clearcoat": { "clearcoatFactor": 0 } } });
    let description = of_material(none, json!({}));
    assert!(matches!(
        &material(&description).kind,
        MaterialKind::Principled { extras: None, .. }
    ));
}

/// A coat without its own map has the shape's normal, whatever map the base has.
#[test]
fn coats_have_normals_of_their_own() {
    let facing = |base: bool, own: bool| {
        let mut coat = json!({ "clearcoatFactor": 1.0 });
        let mut coated = json!({});
        if own {
            coat["clearcoatNormalTexture"] = json!({ "index": 0, "scale": 2.0 });
        }
        if base {
            coated["normalTexture"] = json!({ "index": 0 });
        }
        coated["extensions"] = json!({ "KHR_materials_clearcoat": coat });
        let pictures = json!({
            "textures": [{ "source": 0 }],
            "images": [{ "uri": png([[204, 127, 230, 255], [204, 127, 230, 255]]) }],
        });
        let description = of_material(coated, pictures);
        assert!(!says(&description, "clearcoat"), "{:?}", description.notes);
        let MaterialKind::Principled {
            extras: Some(extras), ..
        } = &material(&description).kind
        else {
            panic!("{:?}", material(&description));
        };
        extras.coat.as_ref().unwrap().facing.clone()
    };
    assert!(matches!(facing(false, false), CoatFacing::Below));
    assert!(matches!(facing(true, false), CoatFacing::Shape));
    for base in [false, true] {
        let CoatFacing::Own(NormalPerturbation::NormalMap(Texture::Image { image, .. })) = facing(base, true) else {
            panic!();
        };
        let n = image.pixels[0] * 2.0 - Rgb::ONE;
        assert!((n.x / n.z - 1.5).abs() < 0.02, "{n}");
    }
}

/// Solid glass beneath a film is `principled`, whose base colour counts for two surfaces; panes are noted.
#[test]
fn glass_may_have_a_film() {
    let of = |thickness: f64, texture: bool| {
        let mut pbr = json!({ "baseColorFactor": [0.5, 0.8, 1, 1], "metallicFactor": 0, "roughnessFactor": 0.2 });
        let mut rest = json!({});
        if texture {
            pbr["baseColorTexture"] = json!({ "index": 0 });
            rest = json!({
                "textures": [{ "source": 0 }],
                "images": [{ "uri": png([[255, 0, 255, 255], [255, 0, 255, 255]]) }],
            });
        }
        of_material(
            json!({ "pbrMetallicRoughness": pbr, "extensions": {
                "KHR_materials_transmission": { "transmissionFactor": 1.0 },
                "KHR_materials_volume": { "thicknessFactor": thickness },
                "KHR_materials_iridescence": { "iridescenceFactor": 1, "iridescenceThicknessMaximum": 300 },
            } }),
            rest,
        )
    };
    for (texture, expected) in [(false, [0.25, 0.64, 1.0]), (true, [0.25, 0.0, 1.0])] {
        let description = of(1.0, texture);
        let made = material(&description);
        let MaterialKind::Principled {
            base_color,
            roughness,
            interface,
            extras: Some(extras),
            ..
        } = &made.kind
        else {
            panic!("{made:?}");
        };
        let at = TexturePoint::default();
        let color = base_color.eval(&at);
        assert!(
            (color - Rgb::from_array(expected)).abs().max_element() < 1e-5,
            "{color}"
        );
        let film = extras.film.as_ref().unwrap();
        assert_eq!(
            (
                roughness.range(),
                interface.eta(&at),
                extras.spec_trans.range(),
                film.thickness.range()
            ),
            ([0.2; 2], 1.5, [1.0; 2], [0.3; 2])
        );
        assert!(
            !made.two_sided && !says(&description, "iridescence"),
            "{:?}",
            description.notes
        );
    }
    let description = of(0.0, false);
    assert!(matches!(
        material(&description).kind,
        MaterialKind::ThinDielectric { .. }
    ));
    assert!(says(
        &description,
        "KHR_materials_iridescence of glass without thickness"
    ));
}

#[test]
fn films_and_colours_of_reflections_are_those_of_principled() {
    let made = |extensions: Value| {
        let description = of_material(json!({ "name": "shell", "extensions": extensions }), json!({}));
        let MaterialKind::Principled {
            extras: Some(extras),
            interface,
            ..
        } = &material(&description).kind
        else {
            panic!("{:?}", material(&description));
        };
        (extras.clone(), interface.eta(&TexturePoint::default()))
    };
    let (extras, _) = made(json!({ "KHR_materials_iridescence": {
        "iridescenceFactor": 0.5, "iridescenceIor": 1.6, "iridescenceThicknessMaximum": 250,
    } }));
    let film = extras.film.unwrap();
    assert_eq!(
        (film.weight.range(), film.thickness.range(), film.eta),
        ([0.5; 2], [0.25; 2], 1.6)
    );
    // Three times as bright, in that hue: 0.12 at normal incidence.
    let (extras, eta) = made(json!({ "KHR_materials_specular": { "specularColorFactor": [3.0, 1.5, 0.0] } }));
    let color = extras.specular_color.eval(&TexturePoint::default());
    assert_eq!(color.to_array(), [1.0, 0.5, 0.0]);
    let root = (eta - 1.0) / (eta + 1.0);
    assert!((root * root - 0.12).abs() < 1e-5, "{eta}");
}
