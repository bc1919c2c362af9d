//! Changes one field of a scene file.

use super::digits;
use super::part::{Part, number};
use crate::place::{self, Place};
use serde_json::Value as Json;
use toml_edit::{Array, DocumentMut, Item, TableLike, Value};

/// The text with a field set, or removed if there is no value.
///
/// Paths are as in [`crate::Edits`]. An equal value keeps its notation; a new one keeps the comments. Long numbers are
/// rounded to six digits.
pub fn set(text: &str, path: &str, value: Option<Json>) -> Result<String, String> {
    let mut document = document(text)?;
    let root = document.as_item_mut();
    match value {
        None | Some(Json::Null) => {
            if is_there(root, path)? {
                let (place, name) = Place::find(root, path)?;
                place.table()?.remove(&name);
            }
        }
        Some(value) => {
            let value = toml(&value)?;
            let (place, name) = Place::find(root, path)?;
            match place.value(&name) {
                Some(before) => replace(before, value),
                None => {
                    let (place, name) = Place::find(root, path)?;
                    place.set(&name, value)?;
                }
            }
        }
    }
    Ok(document.to_string())
}

/// Parses a text for editing.
pub fn document(text: &str) -> Result<DocumentMut, String> {
    text.parse::<DocumentMut>()
        .map_err(|error| format!("the scene is no TOML: {}", error.message().trim()))
}

fn is_there(root: &Item, path: &str) -> Result<bool, String> {
    let names = place::names(path)?;
    let found = names
        .iter()
        .try_fold(Part::of(root), |part, name| Some(part?.get(name)));
    Ok(found.flatten().is_some())
}

fn toml(value: &Json) -> Result<Value, String> {
    match value {
        Json::Bool(is) => Ok(Value::from(*is)),
        Json::String(text) => Ok(Value::from(text.as_str())),
        Json::Number(number) => match (number.as_i64(), number.as_f64()) {
            (Some(whole), _) => Ok(Value::from(whole)),
            (None, Some(x)) => Ok(digits::value(digits::short(x))),
            _ => Err(format!("{number} is too large")),
        },
        Json::Array(items) => Ok(Value::Array(items.iter().map(toml).collect::<Result<Array, _>>()?)),
        Json::Null | Json::Object(_) => {
            Err("expected a number, a word, true or false, or a list of numbers".to_owned())
        }
    }
}

/// Fields that place things.
const PLACES: [&str; 11] = [
    "origin",
    "target",
    "up",
    "position",
    "direction",
    "center",
    "p0",
    "p1",
    "transform",
    "transforms",
    "rotate_y",
];

/// Refuse to move what has keyframes, since the change would apply to one frame only.
pub fn refuse_keys(table: &dyn TableLike) -> Result<(), String> {
    let moving = PLACES
        .into_iter()
        .find(|name| table.get(name).is_some_and(item_has_keys));
    match moving {
        Some(name) => Err(format!("its `{name}` moves by keys, and is where they say")),
        None => Ok(()),
    }
}

fn item_has_keys(item: &Item) -> bool {
    match item {
        Item::None => false,
        Item::Value(value) => has_keys(value),
        Item::Table(table) => table.contains_key("keys") || table.iter().any(|(_, item)| item_has_keys(item)),
        Item::ArrayOfTables(tables) => tables
            .iter()
            .flat_map(|table| table.iter())
            .any(|(_, item)| item_has_keys(item)),
    }
}

fn has_keys(value: &Value) -> bool {
    match value {
        Value::Array(items) => items.iter().any(has_keys),
        Value::InlineTable(table) => table.contains_key("keys") || table.iter().any(|(_, value)| has_keys(value)),
        _ => false,
    }
}

/// Replace a value, in the notation of the old one.
pub fn replace(before: &mut Value, mut after: Value) {
    if let (Value::Array(old), Value::Array(new)) = (&mut *before, &after)
        && old.len() == new.len()
    {
        for (old, new) in old.iter_mut().zip(new.iter()) {
            replace(old, new.clone());
        }
        return;
    }
    match (number(before), number(&after)) {
        (Some(old), Some(new)) if old == new => return,
        (Some(_), None) if before.is_float() => {
            for item in after.as_array_mut().into_iter().flat_map(Array::iter_mut) {
                as_float(item);
            }
        }
        (Some(_), Some(_)) if before.is_float() => as_float(&mut after),
        _ => {}
    }
    *after.decor_mut() = before.decor().clone();
    *before = after;
}

/// Floats stay floats.
fn as_float(value: &mut Value) {
    if let Value::Integer(number) = value {
        *value = Value::from(*number.value() as f64);
    }
}

/// Put a value into a table, in the notation of an old value if there was one.
pub fn put(table: &mut dyn TableLike, name: &str, value: Value) {
    match table.get_mut(name).and_then(Item::as_value_mut) {
        Some(before) => replace(before, value),
        None => {
            table.insert(name, Item::Value(value));
        }
    }
}
