//! The JSON Schema of scene files, for editors. It holds what can be said without looking at other fields: files that
//! it refuses are refused by the parser, but not all the other way round.

use super::SceneRecord;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema, json_schema as json};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// Draft 7, which editors of TOML understand.
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

/// A table of these fields and no others.
pub(super) fn table(required: &[&str], fields: Schema) -> Schema {
    json!({
        "type": "object",
        "properties": fields,
        "required": required,
        "additionalProperties": false
    })
}

/// Split the schema of a record with a `type` by its kinds, each with the fields that it takes.
pub(super) fn one_of<K: JsonSchema + DeserializeOwned>(schema: &mut Schema, takes: impl Fn(K) -> Vec<&'static str>) {
    let Some(Value::Object(fields)) = schema.get("properties").cloned() else {
        return;
    };
    let mut kinds = Vec::new();
    for (name, description) in variants(&schemars::schema_for!(K).to_value()) {
        let Ok(kind) = serde_json::from_value::<K>(name.clone()) else {
            continue;
        };
        let taken = takes(kind);
        let own = fields.iter().filter(|(name, _)| taken.contains(&name.as_str()));
        let mut own: Map<String, Value> = own.map(|(name, field)| (name.clone(), field.clone())).collect();
        let kind = json!({ "const": name, "description": description });
        own.insert("type".into(), kind.to_value());
        kinds.push(table(&["type"], Schema::from(own)).to_value());
    }
    schema.remove("properties");
    schema.remove("required");
    schema.remove("additionalProperties");
    schema.insert("oneOf".into(), kinds.into());
}

/// Names and descriptions of an enum's variants.
fn variants(schema: &Value) -> Vec<(Value, Value)> {
    let described = schema["oneOf"].as_array().into_iter().flatten();
    described
        .map(|variant| (variant["const"].clone(), variant["description"].clone()))
        .collect()
}

/// Where a comment of the code wraps is nothing to a reader of its description.
fn without_line_ends(schema: &mut Value) {
    match schema {
        Value::Array(items) => items.iter_mut().for_each(without_line_ends),
        Value::Object(map) => map.values_mut().for_each(without_line_ends),
        Value::String(text) if text.contains('\n') => *text = text.replace('\n', " "),
        _ => {}
    }
}

/// TOML has no null: an optional field is there or not.
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
