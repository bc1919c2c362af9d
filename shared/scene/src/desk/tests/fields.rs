//! Tests of fields and their values.

use super::{SCENE, assert_comments, canonical, read, reloaded, texts};
use crate::desk::{FieldKind, fields, set};
use serde_json::{Value as Json, json};

#[test]
fn a_field_set_to_itself_changes_nothing() {
    for text in texts() {
        let all = fields(&text);
        assert!(all.len() > 3);
        for field in all.iter().filter(|field| field.given) {
            let same = set(&text, &field.path, Some(field.value.clone()));
            let same = same.unwrap_or_else(|why| panic!("{}: {why}", field.path));
            assert_eq!(same, text, "{}", field.path);
            // An element of a list cannot be removed alone.
            if field.name.ends_with(|last: char| last.is_ascii_digit()) {
                continue;
            }
            let gone = set(&text, &field.path, None);
            let gone = gone.unwrap_or_else(|why| panic!("{}: {why}", field.path));
            let back = set(&gone, &field.path, Some(field.value.clone())).unwrap();
            assert_eq!(canonical(&back), canonical(&text), "{}", field.path);
        }
        for field in all.iter().filter(|field| !field.given) {
            let given = set(&text, &field.path, Some(field.value.clone())).unwrap();
            assert_comments(&text, &given);
            assert_ne!(
                canonical(&given) == canonical(&text),
                !["exposure", "white_balance", "view"].contains(&&*field.name),
                "{}",
                field.path
            );
            let gone = set(&given, &field.path, None).unwrap();
            assert_eq!(canonical(&gone), canonical(&text), "{}", field.path);
        }
    }
}

/// The scene loads with every default that a panel offers.
#[test]
fn defaults_may_be_written_down() {
    for (file, mut text) in read() {
        for field in fields(&text).iter().filter(|field| !field.given) {
            assert!(field.default.is_some(), "{field:?}");
            text = set(&text, &field.path, field.default.clone()).unwrap();
        }
        reloaded(&file, &text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    }
}

#[test]
fn fields_have_ranges_and_words() {
    let all = fields(SCENE);
    let paths: Vec<&str> = all.iter().map(|field| &*field.path).collect();
    assert_eq!(
        paths,
        [
            "camera.fov",
            "camera.aperture",
            "camera.focus_distance",
            "render.exposure",
            "render.view",
            "render.white_balance",
            "lights.0.position",
            "lights.0.target",
            "lights.0.power",
            "lights.1.direction",
            "lights.1.irradiance",
            "lights.2.radiance",
            "shapes.1.emission.power",
            "media.fog.sigma_a",
            "media.fog.sigma_s",
            "media.fog.phase.g",
            "materials.\"old glass\".ior",
            "materials.ball.ior",
            "materials.ball.reflectance",
        ]
    );
    let json = |path: &str| {
        let field = all.iter().find(|field| field.path == path);
        serde_json::to_value(field.unwrap()).unwrap()
    };
    assert_eq!(
        json("lights.0.power"),
        json!({
            "path": "lights.0.power", "group": "lights[0]", "group_kind": "light", "thing": "lights.0",
            "name": "power", "kind": "color", "value": [10, 20.5, 30], "default": null, "given": true,
            "min": 0.0, "max": null, "open_min": false, "open_max": false, "choices": [],
            "unit": "W", "help": "In all directions that it shines to.",
        })
    );
    let g = json("media.fog.phase.g");
    assert_eq!(
        (&g["min"], &g["open_max"], &g["name"]),
        (&json!(-1.0), &json!(true), &json!("phase.g"))
    );
    assert_eq!(json("camera.focus_distance")["default"], json!(5.0));
    assert_eq!(json("camera.aperture")["default"], json!(0.0));
    assert_eq!(json("materials.ball.ior")["value"], json!(1.49));
    assert_eq!(json("shapes.1.emission.power")["thing"], json!("shapes.1"));
    let scene = SCENE.replace(
        "type = \"plastic\"",
        "type = \"rough_conductor\"\ndistribution = \"ggx\"\ntwo_sided = true",
    );
    let of_scene = fields(&scene);
    let field = |path: &str| of_scene.iter().find(|field| field.path == path).unwrap();
    let lists = "[[lights]]\ntype = \"environment\"\nvisible = [\"camera\"]\ntransform = [{ matrix = [[1, 0, 0, 0], \
                 [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] }]\n[materials.floor]\ntype = \"diffuse\"\n\
                 reflectance = { checkerboard = [0.1, [0.2, 0.3, 0.4]] }\n";
    let paths: Vec<String> = fields(lists).into_iter().map(|field| field.path).collect();
    let of_materials = [
        "materials.floor.reflectance.checkerboard.0",
        "materials.floor.reflectance.checkerboard.1",
        "materials.floor.roughness",
    ];
    assert_eq!(paths[paths.len() - 3..], of_materials);
    assert!(!paths.iter().any(|path| path.starts_with("lights.")), "{paths:?}");
    let distribution = field("materials.ball.distribution");
    assert_eq!(distribution.choices, ["ggx", "beckmann"]);
    assert_eq!(distribution.default, Some(json!("ggx")));
    assert_eq!(field("materials.ball.two_sided").kind, FieldKind::Bool);
}

#[test]
fn values_are_written_short_and_beside_their_comments() {
    for (path, value, expected) in [
        ("camera.fov", json!(0.30000000000000004), "fov = 0.3\n"),
        ("camera.fov", json!(50.0), "fov = 50\n"),
        ("materials.\"old glass\".ior", json!(2), "ior = 2.0 # crown"),
        (
            "materials.\"old glass\".ior",
            json!(1.3333333333333333),
            "ior = 1.33333 # crown",
        ),
        ("shapes.0.center", json!([1, 2, 3]), "center = [1, 2.0, 3] # middle"),
        ("lights.0.power", json!(7), "power = 7\n"),
        ("media.fog.sigma_a", json!([0.1, 1, 2]), "sigma_a = [0.1, 1.0, 2.0]\n"),
        ("media.fog.phase.g", json!(-0.5), "{ type = \"hg\", g = -0.5 }"),
        ("render.exposure", json!(1), "[render]\nexposure = 1\n"),
        ("camera.aperture", json!(0.25), "fov = 40\naperture = 0.25\n"),
        ("materials.ball.type", json!("mirror"), "type = \"mirror\""),
    ] {
        let after = set(SCENE, path, Some(value)).unwrap();
        assert!(after.contains(expected), "{path}: {after}");
        assert_comments(SCENE, &after);
    }
    assert!(set(SCENE, "lights.9.power", Some(json!(1))).is_err());
    assert!(set(SCENE, "camera.fov", Some(json!({}))).is_err());
    assert!(set("[camera", "camera.fov", Some(json!(1))).is_err());
    assert_eq!(set(SCENE, "render.exposure", Some(Json::Null)).unwrap(), SCENE);
}
