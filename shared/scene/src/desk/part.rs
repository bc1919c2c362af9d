//! Read access to a scene file's text, in the order of the text.

use serde_json::Value as Json;
use toml_edit::{Item, Key, TableLike, Value};

/// A table, list or value, in any notation.
#[derive(Clone)]
pub enum Part<'a> {
    Table(&'a dyn TableLike),
    List(Vec<Part<'a>>),
    Leaf(&'a Value),
}

impl<'a> Part<'a> {
    /// `None` if there is nothing.
    pub fn of(item: &'a Item) -> Option<Self> {
        match item {
            Item::None => None,
            Item::Value(value) => Some(Self::of_value(value)),
            Item::Table(table) => Some(Self::Table(table)),
            Item::ArrayOfTables(list) => Some(Self::List(list.iter().map(|table| Self::Table(table)).collect())),
        }
    }

    fn of_value(value: &'a Value) -> Self {
        match value {
            Value::InlineTable(table) => Self::Table(table),
            Value::Array(list) => Self::List(list.iter().map(Self::of_value).collect()),
            _ => Self::Leaf(value),
        }
    }

    /// A table's field by name, or a list's element by number.
    pub fn get(&self, name: &str) -> Option<Self> {
        match self {
            Self::Table(table) => Self::of(table.get(name)?),
            Self::List(parts) => parts.get(name.parse::<usize>().ok()?).cloned(),
            Self::Leaf(_) => None,
        }
    }

    pub fn text(&self) -> Option<&'a str> {
        match self {
            Self::Leaf(Value::String(text)) => Some(text.value()),
            _ => None,
        }
    }

    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Leaf(value) => number(value),
            _ => None,
        }
    }

    /// A list that consists of numbers only.
    pub fn numbers(&self) -> Option<Vec<f64>> {
        match self {
            Self::List(parts) => parts.iter().map(Self::number).collect(),
            _ => None,
        }
    }

    /// Numbers, words, booleans and lists of numbers as JSON.
    pub fn json(&self) -> Option<Json> {
        match self {
            Self::Leaf(Value::Integer(number)) => Some((*number.value()).into()),
            Self::Leaf(Value::Float(number)) => Some((*number.value()).into()),
            Self::Leaf(Value::Boolean(is)) => Some((*is.value()).into()),
            Self::Leaf(Value::String(text)) => Some(text.value().as_str().into()),
            Self::List(parts) => parts.iter().map(Self::json).collect(),
            _ => None,
        }
    }
}

pub fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Integer(number) => Some(*number.value() as f64),
        Value::Float(number) => Some(*number.value()),
        _ => None,
    }
}

/// A path extended by a name.
pub fn below(path: &str, name: &str) -> String {
    let name = Key::new(name);
    match path {
        "" => name.display_repr().into_owned(),
        _ => format!("{path}.{}", name.display_repr()),
    }
}
