//! The JSON Schema of scene files: up to date, and it accepts every scene here and rejects wrong ones.

use beamfarm_scene::json_schema;
use jsonschema::Validator;
use serde_json::Value;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes")
}

fn validator() -> Validator {
    let schema: Value = serde_json::from_str(&json_schema()).unwrap();
    jsonschema::draft7::meta::validate(&schema).unwrap();
    jsonschema::draft7::new(&schema).unwrap()
}

fn value(text: &str) -> Value {
    let table: toml::Table = text.parse().unwrap();
    serde_json::to_value(table).unwrap()
}

#[test]
fn the_committed_schema_is_current() {
    let committed = std::fs::read_to_string(folder().join("beamfarm.schema.json")).unwrap();
    assert!(
        committed == json_schema(),
        "scenes/beamfarm.schema.json is not the schema of the parser's records.\n\
         Make it anew: cargo run -- schema > scenes/beamfarm.schema.json"
    );
}

#[test]
fn every_scene_is_valid() {
    let validator = validator();
    let mut count = 0;
    for folder in [folder(), Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds/scene")] {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|ending| ending != "toml") {
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            let scene = value(&text);
            let errors: Vec<String> = validator
                .iter_errors(&scene)
                .map(|e| format!("{}: {e}", e.instance_path()))
                .collect();
            assert!(errors.is_empty(), "{}: {errors:?}", path.display());
            count += 1;
        }
    }
    assert!(count > 5);
}

/// Every example names the schema, for editors.
#[test]
fn scenes_name_their_schema() {
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "toml") {
            let text = std::fs::read_to_string(&path).unwrap();
            let first = text.lines().next();
            assert_eq!(first, Some("#:schema ./beamfarm.schema.json"), "{}", path.display());
        }
    }
}

#[test]
fn wrong_scenes_are_not_valid() {
    let validator = validator();
    let view = "image = { width = 8, height = 8 }\ncamera = { origin = [0, 0, 5], target = [0, 0, 0], fov = 40 }\n";
    for good in [
        "",
        "[[shapes]]\ntype = \"sphere\"\nradius = 2",
        "[[shapes]]\ntype = \"instances\"\nshape = { type = \"cube\", material = \"x\" }\ntransforms = [[], [{ scale = [1, 2, 3] }]]",
        "[materials.x]\ntype = \"principled\"\nbase_color = { checkerboard = [0, [0, 0.5, 1]] }\nopacity = 0.5",
        "[media.x]\ntype = \"heterogeneous\"\nsigma_a = 1\nsigma_s = 2\nphase = { type = \"blend\", weight = 0.5, \
         phases = [\"isotropic\", { type = \"hg\", g = 0.5 }] }\ndensity = { file = \"a.vdb\" }\ntransmittance = { free_flights = 3 }",
        "[[gltf]]\nfile = \"a.glb\"\nlights = false",
    ] {
        let text = format!("{view}{good}");
        assert!(validator.is_valid(&value(&text)), "{text}");
    }
    for wrong in [
        "[light]",
        "[world]\nmedium = 3",
        "[render]\nalpha = 1",
        "[render]\npaths = 0",
        "[render]\nschedule = \"pas\"",
        "[[shapes]]\nradius = 1",
        "[[shapes]]\ntype = \"spere\"",
        "[[shapes]]\ntype = \"sphere\"\nradius = -1",
        "[[shapes]]\ntype = \"sphere\"\nradus = 1",
        "[[shapes]]\ntype = \"rectangle\"\nradius = 1",
        "[[shapes]]\ntype = \"sphere\"\ncenter = [0, 1]",
        "[[shapes]]\ntype = \"sphere\"\ntransform = [{ scale = 1, translate = [0, 0, 0] }]",
        "[[shapes]]\ntype = \"sphere\"\ntransform = [{}]",
        "[[shapes]]\ntype = \"sphere\"\nemission = { radience = 1 }",
        "[materials.x]\ntype = \"diffuse\"\nreflectance = 2",
        "[materials.x]\ntype = \"diffuse\"\nreflectance = { file = \"a.png\" }",
        "[materials.x]\ntype = \"diffuse\"\nior = 1.5",
        "[materials.x]\ntype = \"null\"\nopacity = 0.5",
        "[media.x]\ntype = \"homogeneous\"\nsigma_a = -1\nsigma_s = 1",
        "[media.x]\ntype = \"homogeneous\"\nsigma_a = 1\nsigma_s = 1\nphase = { type = \"hg\", g = 1 }",
        "[media.x]\ntype = \"homogeneous\"\nsigma_a = 1\nsigma_s = 1\ndensity = { file = \"a.vdb\" }",
        "[[lights]]\ntype = \"spot\"\ncutoff_angle = 180",
        "[[lights]]\ntype = \"directional\"\npower = 1",
        "[[gltf]]\ntransform = []",
    ] {
        let text = format!("{view}{wrong}");
        assert!(!validator.is_valid(&value(&text)), "{text}");
    }
    for (from, to) in [
        ("width = 8", "width = 0"),
        ("width = 8", "width = 40000"),
        ("width = 8", "width = 8.5"),
        ("width = 8, ", ""),
        ("fov = 40", "fov = 180"),
        ("fov = 40", "filter = 1"),
    ] {
        assert!(!validator.is_valid(&value(&view.replace(from, to))), "{to}");
    }
}

/// Editors show every error, so a wrong field or type must give only one.
#[test]
fn what_is_wrong_once_is_told_once() {
    let validator = validator();
    let view = "image = { width = 8, height = 8 }\ncamera = { origin = [0, 0, 5], target = [0, 0, 0], fov = 40 }\n";
    for (wrong, place) in [
        ("[[shapes]]\ntype = \"sphere\"\nradus = 1", "/shapes/0"),
        ("[[shapes]]\ntype = \"rectangle\"\nradius = 1", "/shapes/0/radius"),
        ("[[shapes]]\ntype = \"spere\"\nradius = 1", "/shapes/0/type"),
        ("[[shapes]]\nradius = 1", "/shapes/0"),
        ("[[shapes]]\ntype = \"sphere\"\nradius = -1", "/shapes/0/radius"),
        ("[materials.x]\ntype = \"dielectric\"\nioor = 1.5", "/materials/x"),
        ("[materials.x]\ntype = \"diffuse\"\nior = 1.5", "/materials/x/ior"),
        ("[media.x]\ntype = \"homogeneous\"\nsigma = 1", "/media/x"),
        ("[[lights]]\ntype = \"spot\"\npowr = 1", "/lights/0"),
        ("[[lights]]\ntype = \"directional\"\npower = 1", "/lights/0/power"),
    ] {
        let scene = value(&format!("{view}{wrong}"));
        let errors: Vec<_> = validator.iter_errors(&scene).collect();
        let places: Vec<String> = errors.iter().map(|error| error.instance_path().to_string()).collect();
        assert_eq!(places, [place], "{wrong}: {errors:?}");
    }
}

/// Fields have descriptions.
#[test]
fn fields_are_described() {
    fn walk(schema: &Value, path: &str, missing: &mut Vec<String>) {
        // Fields of a single kind are described next to what they belong to.
        let is_of_kind = ["/if", "/then", "/else"].iter().any(|end| path.ends_with(end));
        if let Some(fields) = schema["properties"].as_object().filter(|_| !is_of_kind) {
            for (name, field) in fields {
                let known = field["description"].is_string()
                    || matches!(&**name, "type" | "phases")
                    || ["checkerboard", "uv", "filter", "wrap"].contains(&&**name);
                if !known {
                    missing.push(format!("{path}.{name}"));
                }
            }
        }
        match schema {
            Value::Object(map) => map
                .iter()
                .for_each(|(name, value)| walk(value, &format!("{path}/{name}"), missing)),
            Value::Array(items) => items.iter().for_each(|item| walk(item, path, missing)),
            _ => {}
        }
    }
    let mut missing = Vec::new();
    walk(&serde_json::from_str(&json_schema()).unwrap(), "", &mut missing);
    assert!(missing.is_empty(), "without a doc comment: {missing:?}");
}
