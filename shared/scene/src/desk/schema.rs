//! What the JSON Schema of scene files says of a field: kind, range, words.

use super::part::Part;
use super::words::Words;
use crate::parse;
use serde_json::{Map, Value as Json};
use std::sync::LazyLock;

static SCHEMA: LazyLock<Json> = LazyLock::new(|| serde_json::from_str(&parse::json_schema()).unwrap_or_default());

/// The schema of a top-level field.
pub fn of(name: &str) -> &'static Json {
    &SCHEMA["properties"][name]
}

/// A field that a table may have.
pub struct Known {
    pub name: &'static str,
    pub schema: &'static Json,
    /// The default for the table's type, if that differs.
    default: Option<&'static Json>,
}

/// The form of a field's values.
#[derive(Debug, PartialEq)]
pub enum Form {
    Number,
    Color,
    Vector,
    Bool,
    Choice(Vec<String>),
}

/// A field's form and range.
#[derive(Debug)]
pub struct Meaning {
    pub form: Form,
    pub min: Option<f64>,
    pub max: Option<f64>,
    pub open_min: bool,
    pub open_max: bool,
}

fn resolved(mut schema: &'static Json) -> &'static Json {
    // Circular references must end.
    for _ in 0..16 {
        // A field with its own description refers to its schema this way.
        let named = schema["$ref"].as_str().or(schema["allOf"][0]["$ref"].as_str());
        let Some(name) = named.and_then(|path| path.strip_prefix("#/definitions/")) else {
            break;
        };
        schema = &SCHEMA["definitions"][name];
    }
    schema
}

/// The alternatives of a schema.
fn ways(schema: &'static Json) -> Vec<&'static Json> {
    let schema = resolved(schema);
    let choices = ["anyOf", "oneOf"].into_iter().find_map(|word| schema[word].as_array());
    match choices {
        Some(choices) => choices.iter().flat_map(ways).collect(),
        None => vec![schema],
    }
}

/// The schema of a list's elements.
pub fn items(schema: &'static Json) -> Option<&'static Json> {
    ways(schema).into_iter().find_map(|way| way.get("items"))
}

/// The schema of the entries of a table of names.
pub fn entries(schema: &'static Json) -> &'static Json {
    &resolved(schema)["additionalProperties"]
}

/// Whether a field has the constant value that the schema demands, if any.
fn fits(table: &Part<'_>, name: &str, field: &Json) -> bool {
    let Some(word) = field.get("const") else {
        return true;
    };
    table.get(name).and_then(|given| given.text()) == word.as_str()
}

/// The fields a table may have, given its type and contents.
pub fn fields(schema: &'static Json, table: &Part<'_>) -> Vec<Known> {
    let mut tables = ways(schema)
        .into_iter()
        .filter_map(|way| Some((way, way.get("properties")?.as_object()?)));
    let found = tables.find(|(way, fields)| {
        let required = way["required"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Json::as_str);
        required.into_iter().all(|name| table.get(name).is_some())
            && fields.iter().all(|(name, field)| fits(table, name, field))
    });
    let Some((way, all)) = found else {
        return Vec::new();
    };
    let rules: Vec<&'static Map<String, Json>> = rules(way, table).collect();
    let of_kind = |name: &str| rules.iter().filter_map(move |rule| rule.get(name)).collect::<Vec<_>>();
    all.iter()
        .filter_map(|(name, schema)| {
            let said = of_kind(name);
            let refused = said.iter().any(|said| **said == Json::Bool(false));
            let default = said.iter().find_map(|said| said.get("default"));
            (!refused).then_some(Known { name, schema, default })
        })
        .collect()
}

/// The rules that apply only to tables of this kind.
fn rules<'t>(schema: &'static Json, table: &'t Part<'t>) -> impl Iterator<Item = &'static Map<String, Json>> + 't {
    let rules = schema["allOf"].as_array().into_iter().flatten();
    rules.filter_map(|rule| {
        let conditions = rule["if"]["properties"].as_object()?;
        let holds = conditions.iter().all(|(name, field)| fits(table, name, field));
        rule["then"]["properties"].as_object().filter(|_| holds)
    })
}

impl Known {
    /// An unnamed element of a list.
    pub fn of_list(schema: &'static Json) -> Self {
        Self {
            name: "",
            schema,
            default: None,
        }
    }

    pub fn words(&self) -> Words {
        let own = self.schema["description"].as_str();
        Words::of(
            own.or(resolved(self.schema)["description"].as_str())
                .unwrap_or_default(),
        )
    }

    /// Its default, if that is a number, word or boolean.
    pub fn default(&self) -> Option<Json> {
        let said = self
            .default
            .or(self.schema.get("default"))
            .filter(|said| !said.is_object() && !said.is_array());
        said.cloned().or(self.words().default)
    }

    /// How it is shown; `given`: its value in the file. `None` if it is not shown, or only its parts are.
    pub fn meaning(&self, given: Option<&Part<'_>>) -> Option<Meaning> {
        meaning(self.schema, given)
    }
}

fn meaning(schema: &'static Json, given: Option<&Part<'_>>) -> Option<Meaning> {
    let ways = ways(schema);
    let is = |way: &&&Json, kind: &str| way["type"] == kind;
    let number = ways.iter().find(|way| is(way, "number") || is(way, "integer"));
    let list = ways.iter().filter(|way| is(way, "array")).find_map(|way| {
        let of = resolved(&way["items"]);
        (of["type"] == "number" && way["maxItems"].as_u64()? <= 3).then_some(of)
    });
    let flag = ways.iter().any(|way| is(&way, "boolean"));
    let mut choices: Vec<String> = Vec::new();
    for way in &ways {
        let listed = way["enum"].as_array().into_iter().flatten();
        let words = way.get("const").into_iter().chain(listed).filter_map(Json::as_str);
        choices.extend(words.map(str::to_owned));
    }
    let has_list = given.is_some_and(|given| given.numbers().is_some());
    let has_number = given.is_none_or(|given| given.number().is_some());
    let has_word = given.is_none_or(|given| given.text().is_some());
    let has_flag = given.is_none_or(|given| given.json().is_some_and(|json| json.is_boolean()));
    // Colours are not negative; factors and directions may be.
    let is_color = list.is_some_and(|of| of.get("minimum").is_some());
    let (form, range) = match (number, list) {
        (Some(number), Some(_)) if is_color && (has_number || has_list) => (Form::Color, *number),
        (Some(number), _) if has_number => (Form::Number, *number),
        (_, Some(of)) if has_list || given.is_none() => (Form::Vector, of),
        _ if flag && has_flag => (Form::Bool, &Json::Null),
        _ if choices.len() > 1 && has_word => (Form::Choice(choices), &Json::Null),
        _ => return None,
    };
    let bound = |word: &str| range[word].as_f64();
    Some(Meaning {
        form,
        min: bound("minimum").or(bound("exclusiveMinimum")),
        max: bound("maximum").or(bound("exclusiveMaximum")),
        open_min: bound("exclusiveMinimum").is_some(),
        open_max: bound("exclusiveMaximum").is_some(),
    })
}
