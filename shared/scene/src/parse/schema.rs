//! The JSON Schema of scene files, for editors. It covers what can be checked without looking at other fields: the
//! parser refuses every file that the schema refuses, but not vice versa.

use super::SceneRecord;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema, json_schema as json};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// The schema of static scenes: draft 7, which TOML editors understand.
pub fn json_schema() -> String {
    let generator = SchemaSettings::draft07().into_generator();
    let mut schema = generator.into_root_schema_for::<SceneRecord>().to_value();
    without_null(&mut schema);
    without_line_ends(&mut schema);
    if let Some(root) = schema.as_object_mut() {
        root.insert("title".into(), "A scene of beamfarm".into());
    }
    format!("{schema:#}\n")
}

/// The JSON Schema (draft 7) of native scene files, for editors, as a JSON document. Keys are allowed wherever a
/// number, colour, vector or list is, for moving scenes.
pub fn json_schema_with_keys() -> String {
    let mut schema: Value = serde_json::from_str(&json_schema()).unwrap_or_default();
    let Some(root) = schema.as_object_mut() else {
        return String::new();
    };
    if let Some(Value::Object(fields)) = root.get_mut("properties") {
        fields.values_mut().for_each(with_keys);
    }
    if let Some(Value::Object(definitions)) = root.get_mut("definitions") {
        let moving = definitions
            .iter_mut()
            .filter(|(name, _)| !STILL.contains(&name.as_str()));
        moving.for_each(|(_, definition)| with_keys(definition));
        let keys = json!({
            "description": "A value over time, by the frame.",
            "type": "object",
            "properties": {
                "keys": {
                    "type": "array",
                    "description": "[frame, value], in the order of the frames.",
                    "minItems": 2,
                    "items": { "type": "array", "minItems": 2, "maxItems": 2 }
                },
                "interpolation": {
                    "description": "Between two keys: straight, at a speed without jumps, or the value of the first. Default: linear.",
                    "enum": ["linear", "smooth", "step"]
                }
            },
            "required": ["keys"],
            "additionalProperties": false
        });
        definitions.insert("Keys".into(), keys.to_value());
    }
    format!("{schema:#}\n")
}

/// Records that cannot have keys.
const STILL: [&str; 4] = ["ImageRecord", "CropRecord", "RenderRecord", "AnimationRecord"];

/// Allow keys wherever a schema has a number or list.
fn with_keys(schema: &mut Value) {
    match schema {
        Value::Array(items) => items.iter_mut().for_each(with_keys),
        Value::Object(map) => {
            for (word, part) in map.iter_mut() {
                match (word.as_str(), part) {
                    ("properties", Value::Object(fields)) => fields.values_mut().for_each(or_keys),
                    ("items", items) => or_keys(items),
                    (_, part) => with_keys(part),
                }
            }
        }
        _ => {}
    }
}

fn or_keys(schema: &mut Value) {
    with_keys(schema);
    let is_list_or_number = |schema: &Value| schema["type"] == "number" || schema["type"] == "array";
    let moves = is_list_or_number(schema) || schema["anyOf"].as_array().into_iter().flatten().any(is_list_or_number);
    if let (true, Value::Object(map)) = (moves, schema) {
        let description = map.remove("description");
        let plain = Value::Object(std::mem::take(map));
        map.insert(
            "anyOf".into(),
            Value::Array(vec![plain, json!({ "$ref": "#/definitions/Keys" }).to_value()]),
        );
        map.extend(description.map(|words| ("description".into(), words)));
    }
}

/// A table with these fields and no others.
pub(super) fn table(required: &[&str], fields: Schema) -> Schema {
    json!({
        "type": "object",
        "properties": fields,
        "required": required,
        "additionalProperties": false
    })
}

/// A schema with a description.
pub(super) fn described(mut schema: Schema, words: &str) -> Schema {
    schema.insert("description".into(), words.into());
    schema
}

/// Restrict a record with a `type` to the fields that each kind takes. The record itself refuses a field that no kind
/// has; a kind refuses fields of other kinds.
pub(super) fn by_type<K: JsonSchema + DeserializeOwned>(schema: &mut Schema, takes: impl Fn(K) -> Vec<&'static str>) {
    let Some(Value::Object(fields)) = schema.get("properties").cloned() else {
        return;
    };
    let kinds = kinds::<K>().into_iter().map(|(name, kind)| {
        let taken = takes(kind);
        let refused = fields
            .keys()
            .filter(|field| *field != "type" && !taken.contains(&field.as_str()));
        let refused: Map<String, Value> = refused.map(|field| (field.clone(), false.into())).collect();
        of_kind(&name, refused)
    });
    schema.insert("allOf".into(), kinds.collect());
}

/// Add the defaults of fields that differ between kinds.
pub(super) fn defaults<K: JsonSchema + DeserializeOwned>(
    schema: &mut Schema,
    of: impl Fn(K) -> &'static [(&'static str, f64)],
) {
    let Some(Value::Array(rules)) = schema.get_mut("allOf") else {
        return;
    };
    for (name, kind) in kinds::<K>() {
        let fields = of(kind)
            .iter()
            .map(|(field, x)| ((*field).to_owned(), json!({ "default": x }).to_value()));
        let fields: Map<String, Value> = fields.collect();
        if !fields.is_empty() {
            rules.push(of_kind(&name, fields));
        }
    }
}

/// The rule for one kind's fields.
fn of_kind(name: &Value, fields: Map<String, Value>) -> Value {
    let is_kind = json!({ "properties": { "type": { "const": name } }, "required": ["type"] });
    json!({ "if": is_kind, "then": { "properties": fields } }).to_value()
}

/// An enum's variants with their names in files.
fn kinds<K: JsonSchema + DeserializeOwned>() -> Vec<(Value, K)> {
    let schema = schemars::schema_for!(K).to_value();
    let names = schema["oneOf"]
        .as_array()
        .into_iter()
        .flatten()
        .map(|variant| variant["const"].clone());
    names
        .filter_map(|name| serde_json::from_value(name.clone()).ok().map(|kind| (name, kind)))
        .collect()
}

/// Line breaks of the code's comments do not belong in descriptions.
fn without_line_ends(schema: &mut Value) {
    match schema {
        Value::Array(items) => items.iter_mut().for_each(without_line_ends),
        Value::Object(map) => map.values_mut().for_each(without_line_ends),
        Value::String(text) if text.contains('\n') => *text = text.replace('\n', " "),
        _ => {}
    }
}

/// TOML has no null: an optional field is present or absent.
fn without_null(schema: &mut Value) {
    match schema {
        Value::Array(items) => items.iter_mut().for_each(without_null),
        Value::Object(map) => {
            map.values_mut().for_each(without_null);
            if map.get("default") == Some(&Value::Null) {
                map.remove("default");
            }
            if let Some(Value::Array(types)) = map.get_mut("type") {
                types.retain(|kind| kind != "null");
                if let [only] = &types[..] {
                    let only = only.clone();
                    map.insert("type".into(), only);
                }
            }
            if let Some(Value::Array(choices)) = map.get_mut("anyOf") {
                choices.retain(|choice| choice["type"] != "null");
                if let [Value::Object(only)] = &mut choices[..] {
                    let only = std::mem::take(only);
                    map.remove("anyOf");
                    map.extend(only);
                }
            }
        }
        _ => {}
    }
}
