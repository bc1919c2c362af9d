use super::*;
use crate::assemble::Kept;
use crate::files::{Files, Source};
use crate::parse::SceneRecord;
use crate::values::Spanned;
use beamfarm_render::world::texture::TexturePoint;
use beamfarm_render::world::texture::graph::Place;
use serde_json::Value;
use std::fmt::Write;

/// A JSON value as TOML; "p" stands for the point.
fn toml(value: &Value) -> String {
    match value {
        Value::String(word) if word == "p" => "{ node = \"coordinates\", of = \"object\" }".to_owned(),
        Value::Object(fields) => {
            let fields = fields.iter().map(|(name, value)| format!("{name} = {}", toml(value)));
            format!("{{ {} }}", fields.collect::<Vec<_>>().join(", "))
        }
        Value::Array(list) => format!("[{}]", list.iter().map(toml).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}

const HEAD: &str = "image = { width = 8, height = 6 }\n\
                    camera = { origin = [0, 0, 9], target = [0, 0, 0], fov = 40 }\n";

/// Blender's own values: `tests/blender/nodes.py` had Cycles render them. Those of version 4 are used where version 5
/// has others.
#[test]
fn nodes_have_blenders_values() {
    for (file, least) in [(include_str!("nodes.json"), 850), (include_str!("nodes-4.json"), 100)] {
        let all: Value = serde_json::from_str(file).unwrap();
        let cases = all["cases"].as_array().unwrap();
        assert!(cases.len() > least, "{}", cases.len());
        let wrong = wrong(&all["sets"], cases);
        assert!(
            wrong.is_empty(),
            "{} of {}:\n{}",
            wrong.len(),
            cases.len(),
            wrong.join("\n")
        );
    }
}

/// The cases that fail.
fn wrong(sets: &Value, cases: &[Value]) -> Vec<String> {
    let mut text = format!("{HEAD}[textures]\n");
    for (i, case) in cases.iter().enumerate() {
        writeln!(text, "c{i} = {}", toml(&case["texture"])).unwrap();
    }
    let record = SceneRecord::parse(&text).unwrap();
    let files = Files::default();
    let mut kept = Kept::default();
    let mut assets = Assets::new(Source::Files(&files), &mut kept, &record);
    let mut wrong = Vec::new();
    for (i, case) in cases.iter().enumerate() {
        let name = case["name"].as_str().unwrap();
        let named = TextureRecord::<Finite>::Named(NamedRecord {
            texture: Spanned::new(0..0, format!("c{i}")),
            output: None,
        });
        let texture = match self::texture(&named, bounds::<Finite>(), false, &mut assets) {
            Ok(texture) => texture,
            Err(problem) => panic!("{name}: {problem:?}"),
        };
        let points = &sets[case["set"].as_u64().unwrap_or(0) as usize];
        let points = points.as_array().unwrap().iter().map(vector);
        for (own, expected) in points.zip(case["values"].as_array().unwrap()) {
            let expected = match expected.as_f64() {
                Some(x) => Vec3::splat(x as f32),
                None => vector(expected),
            };
            let at = TexturePoint {
                place: Place {
                    own,
                    ..Place::default()
                },
                ..TexturePoint::default()
            };
            let value = texture.eval(&at);
            let error = (value - expected).abs().max_element();
            // Blender approximates black bodies by a fit.
            let most = if name.contains("blackbody") { 3e-3 } else { 1e-3 };
            if error > most * expected.abs().max_element().max(1.0) {
                wrong.push(format!("{name} at {own}: {value}, not {expected}"));
                break;
            }
        }
    }
    wrong
}

/// Errors name the line and what was expected.
#[test]
fn wrong_graphs_are_told() {
    let message = |textures: &str, reflectance: &str| {
        let text = format!("{HEAD}{textures}\n[materials.m]\ntype = \"diffuse\"\nreflectance = {reflectance}\n");
        let mut bundle = beamfarm_image::bundle::Bundle {
            scene: "a.toml".into(),
            ..Default::default()
        };
        bundle.files.insert("a.toml".into(), text.into());
        crate::load(&bundle).map(|_| ()).unwrap_err().to_string()
    };
    let named = "[textures.t]\nnode = \"noise\"\n";
    for (textures, reflectance, expected) in [
        (
            "",
            r#"{ node = "nose" }"#,
            "there is no node \"nose\"; expected one of coordinates, geometry",
        ),
        (
            "",
            r#"{ node = "noise", depth = 2 }"#,
            "a \"noise\" node has no field `depth`; expected one of vector, w",
        ),
        (
            "",
            r#"{ node = "noise", colour = 2 }"#,
            "unknown field `colour`, expected one of",
        ),
        (
            "",
            r#"{ node = "noise", type = "fur" }"#,
            "`type` of a \"noise\" node: expected one of \"fbm\", \"multi",
        ),
        (
            "",
            r#"{ node = "magic", depth = 2.5 }"#,
            "`depth` of a \"magic\" node: expected a whole number from 0 to 10",
        ),
        (
            "",
            r#"{ node = "noise", output = "colour" }"#,
            "a \"noise\" node has no output \"colour\"; expected one of \"value\", \"color\"",
        ),
        (
            "",
            r#"{ node = "noise", scale = [1, 2, 3] }"#,
            "expected a number or a texture",
        ),
        (
            "",
            r#"{ node = "noise", vector = [1, 2] }"#,
            "expected a number, three of them in brackets, or a texture",
        ),
        ("", r#"{ node = "ramp" }"#, "a \"ramp\" node needs `stops`"),
        (
            "",
            r#"{ node = "ramp", stops = [[0, 1]] }"#,
            "`stops` of a \"ramp\" node: expected rows of 4 to 5 numbers",
        ),
        ("", r#"{ node = "luminance" }"#, "a \"luminance\" node needs `color`"),
        (
            "",
            r#"{ node = "wave", direction = "spherical" }"#,
            "is no direction of these waves",
        ),
        (
            "",
            r#"{ node = "transform", matrix = [[1, 0, 0, 0]] }"#,
            "a \"transform\" node needs `matrix`",
        ),
        ("", r#"{ texture = "t" }"#, "there is no texture \"t\" in `textures`"),
        (named, r#"{ texture = "t", output = "x" }"#, "has no output \"x\""),
        (
            named,
            r#"{ texture = "t", scale = 2 }"#,
            "`scale` is a field of nodes; beside `texture` only `output`",
        ),
        (
            named,
            r#"{ node = "noise", texture = "t" }"#,
            "a `node` or one of the `texture`s, not both",
        ),
        (
            "",
            r#"{ node = "noise", image = "a.png" }"#,
            "a texture is one of `node`, `texture`, `image`",
        ),
        (
            "",
            r#"{ node = "noise", raw = true }"#,
            "a node takes no fields of images",
        ),
        (
            "",
            r#"{ checkerboard = [0, 1], vector = 1 }"#,
            "`vector` is a field of nodes",
        ),
        (
            "",
            r#"{ checkerboard = [0, 1], output = "x" }"#,
            "`output` is a field of nodes",
        ),
        (
            "[textures.t]\nnode = \"noise\"\nscale = { texture = \"u\" }\n[textures.u]\nnode = \"math\"\na = { texture = \"t\" }\n",
            r#"{ texture = "t" }"#,
            "the texture \"t\" is made from itself",
        ),
    ] {
        let found = message(textures, reflectance);
        assert!(
            found.starts_with("a.toml:") && found.contains(expected),
            "{reflectance}: {found}"
        );
    }
}

fn vector(value: &Value) -> Vec3 {
    let at = |i: usize| value[i].as_f64().unwrap() as f32;
    Vec3::new(at(0), at(1), at(2))
}
