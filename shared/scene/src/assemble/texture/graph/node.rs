//! A node's table read according to its kind: the settings that are the same for all points.

use crate::parse::{Choice, Fault, KINDS, Kind, NodeRecord, NodeValue};
use crate::values::Spanned;
use std::ops::Range as Span;

/// A node and its kind.
#[derive(Clone, Copy)]
pub(super) struct Node<'n> {
    pub record: &'n NodeRecord,
    pub kind: &'static Kind,
}

impl<'n> Node<'n> {
    pub fn of(record: &'n NodeRecord) -> Result<Self, Fault> {
        let name = record.node.get_ref();
        let kind = Kind::named(name).ok_or_else(|| {
            let names: Vec<&str> = KINDS.iter().map(|kind| kind.name).collect();
            let message = format!("there is no node {name:?}; expected one of {}", names.join(", "));
            Fault::new(record.node.span(), message)
        })?;
        for (field, value) in &record.fields {
            if !kind.fields().any(|known| known == field) {
                let known: Vec<&str> = kind.fields().collect();
                let known = match known[..] {
                    [] => "it takes none but `output`".to_owned(),
                    _ => format!("expected one of {}", known.join(", ")),
                };
                let message = format!("a {name:?} node has no field `{field}`; {known}");
                return Err(Fault::new(value.span(), message));
            }
        }
        Ok(Self { record, kind })
    }

    pub fn choice(&self, name: &str) -> Choice {
        let found = self.kind.choices.iter().find(|(choice, _)| *choice == name);
        found.map_or(Choice::Flag(false), |(_, choice)| *choice)
    }

    pub fn wrong(&self, value: &Spanned<NodeValue>, name: &str, expected: &str) -> Fault {
        let message = format!("`{name}` of a {:?} node: expected {expected}", self.kind.name);
        Fault::new(value.span(), message)
    }

    pub fn word(&self, name: &str) -> Result<&'static str, Fault> {
        let Choice::Words(words) = self.choice(name) else {
            return Ok("");
        };
        match self.record.field(name) {
            None => Ok(words[0]),
            Some(value) => match value.get_ref() {
                NodeValue::Word(word) => words.iter().find(|known| *known == word).copied(),
                _ => None,
            }
            .ok_or_else(|| self.wrong(value, name, &format!("one of \"{}\"", words.join("\", \"")))),
        }
    }

    pub fn flag(&self, name: &str) -> Result<bool, Fault> {
        match (self.record.field(name), self.choice(name)) {
            (None, Choice::Flag(unset)) => Ok(unset),
            (Some(value), _) => match value.get_ref() {
                NodeValue::Flag(is_so) => Ok(*is_so),
                _ => Err(self.wrong(value, name, "true or false")),
            },
            (None, _) => Ok(false),
        }
    }

    pub fn count(&self, name: &str) -> Result<u32, Fault> {
        let Choice::Count(low, high, unset) = self.choice(name) else {
            return Ok(0);
        };
        match self.record.field(name) {
            None => Ok(unset),
            Some(value) => match value.get_ref() {
                NodeValue::Number(x) if x.fract() == 0.0 && (f64::from(low)..=f64::from(high)).contains(x) => {
                    Ok(*x as u32)
                }
                _ => Err(self.wrong(value, name, &format!("a whole number from {low} to {high}"))),
            },
        }
    }

    pub fn number(&self, name: &str) -> Result<f32, Fault> {
        match (self.record.field(name), self.choice(name)) {
            (Some(value), _) => match value.get_ref() {
                NodeValue::Number(x) => Ok(*x as f32),
                _ => Err(self.wrong(value, name, "a number")),
            },
            (None, Choice::Number(unset)) => Ok(unset),
            (None, _) => Ok(0.0),
        }
    }

    /// Rows whose counts of numbers lie in `counts`; at least one row, or `None` if the field is missing.
    pub fn rows(&self, name: &str, counts: Span<usize>) -> Result<Option<Vec<Vec<f32>>>, Fault> {
        let Some(value) = self.record.field(name) else {
            return Ok(None);
        };
        let number = |value: &NodeValue| match value {
            NodeValue::Number(x) => Some(*x as f32),
            _ => None,
        };
        let row = |value: &NodeValue| match value {
            NodeValue::List(row) if counts.contains(&row.len()) => row.iter().map(number).collect(),
            _ => None,
        };
        let rows: Option<Vec<Vec<f32>>> = match value.get_ref() {
            NodeValue::List(rows) if !rows.is_empty() => rows.iter().map(row).collect(),
            _ => None,
        };
        let expected = match (counts.start, counts.end - 1) {
            (low, high) if low == high => format!("rows of {low} numbers"),
            (low, high) => format!("rows of {low} to {high} numbers"),
        };
        rows.map(Some).ok_or_else(|| self.wrong(value, name, &expected))
    }

    /// The name of the requested output, given here or where the node is referenced.
    pub fn output(&self, asked: Option<&Spanned<String>>) -> Result<&'static str, Fault> {
        let Some(asked) = asked.or(self.record.output.as_ref()) else {
            return Ok(self.kind.outputs[0].0);
        };
        let outputs = self.kind.outputs;
        let found = outputs.iter().find(|(name, _)| name == asked.get_ref());
        found.map(|(name, _)| *name).ok_or_else(|| {
            let names: Vec<&str> = outputs.iter().map(|(name, _)| *name).collect();
            let message = format!(
                "a {:?} node has no output {:?}; expected one of \"{}\"",
                self.kind.name,
                asked.get_ref(),
                names.join("\", \"")
            );
            Fault::new(asked.span(), message)
        })
    }
}
