//! Turns a place in the scene file into an error with file, line and field.

use crate::error::SceneError;
use beamfarm_assets::line_of;
use std::ops::Range as Span;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A fault at a place of the scene file.
#[derive(Debug)]
pub struct Fault {
    pub span: Option<Span<usize>>,
    pub message: String,
}

impl Fault {
    pub fn new(span: Span<usize>, message: impl Into<String>) -> Self {
        Self {
            span: Some(span),
            message: message.into(),
        }
    }
}

impl From<toml::de::Error> for Fault {
    fn from(error: toml::de::Error) -> Self {
        let mut message = error.message().replace('\n', ", ");
        for (rust, word) in [
            ("expected u32", "expected a whole number"),
            ("expected i64", "expected a whole number"),
            ("expected u64", "expected a whole number"),
            ("expected a boolean", "expected true or false"),
        ] {
            message = message.replace(rust, word);
        }
        Self {
            span: error.span(),
            message: with_nearest(message),
        }
    }
}

/// For an unknown field, suggest the most likely one instead of listing all.
fn with_nearest(message: String) -> String {
    let nearest = || {
        let mut names = message.strip_prefix("unknown field `")?.split('`').step_by(2);
        let given = names.next()?;
        let distance = |name: &&str| strsim::damerau_levenshtein(given, name);
        let nearest = names.filter(|name| !name.is_empty()).min_by_key(distance)?;
        (distance(&nearest) <= (given.len() / 3).max(1))
            .then(|| format!("unknown field `{given}`; did you mean `{nearest}`?"))
    };
    nearest().unwrap_or(message)
}

/// `fault` as an error of `file`, whose text is `text`.
pub fn locate(file: &Path, text: &str, fault: &Fault) -> SceneError {
    // An empty span means the whole file.
    let span = fault.span.as_ref().filter(|span| !span.is_empty());
    let field = span.and_then(|span| field_at(text, span));
    SceneError {
        file: file.to_path_buf(),
        line: fault.span.as_ref().map(|span| line_of(text.as_bytes(), span.start)),
        message: match field {
            Some(field) => format!("{field}: {}", fault.message),
            None => fault.message.clone(),
        },
    }
}

/// The path of the innermost field around a span, such as `shapes["lamp"].radius`.
fn field_at(text: &str, span: &Span<usize>) -> Option<String> {
    let root = DeTable::parse(text).ok()?;
    let mut best = None;
    in_table(root.get_ref(), "", span, &mut best);
    best.map(|(_, path)| path)
}

type Best = Option<(usize, String)>;

fn consider(span: &Span<usize>, around: Span<usize>, path: &str, best: &mut Best) {
    let size = around.len();
    if around.start <= span.start && span.end <= around.end && best.as_ref().is_none_or(|(least, _)| size <= *least) {
        *best = Some((size, path.to_string()));
    }
}

fn in_table(table: &DeTable<'_>, path: &str, span: &Span<usize>, best: &mut Best) {
    for (key, value) in table {
        let path = match path {
            "" => key.get_ref().to_string(),
            _ => format!("{path}.{}", key.get_ref()),
        };
        consider(span, key.span(), &path, best);
        in_value(value, &path, span, best);
    }
}

fn in_value(value: &Spanned<DeValue<'_>>, path: &str, span: &Span<usize>, best: &mut Best) {
    consider(span, value.span(), path, best);
    match value.get_ref() {
        DeValue::Table(table) => in_table(table, path, span, best),
        DeValue::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                let name = match item.get_ref() {
                    DeValue::Table(table) => table.get("name").and_then(|name| name.get_ref().as_str()),
                    _ => None,
                };
                let path = match name {
                    Some(name) => format!("{path}[\"{name}\"]"),
                    None => format!("{path}[{i}]"),
                };
                in_value(item, &path, span, best);
            }
        }
        _ => {}
    }
}
