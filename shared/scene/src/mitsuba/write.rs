//! Writes the native scene file and records the origin of each line.

use super::FileLine;
use std::collections::BTreeMap;
use std::fmt::Write;

/// A TOML value on one line.
#[derive(Clone, Debug, PartialEq)]
pub enum Toml {
    Boolean(bool),
    Integer(i64),
    Float(f64),
    String(String),
    Array(Vec<Toml>),
    Table(Vec<(&'static str, Toml)>),
}

impl Toml {
    /// A list of numbers.
    pub fn numbers(numbers: &[f64]) -> Self {
        Self::Array(numbers.iter().map(|x| Self::Float(*x)).collect())
    }

    /// An inline table.
    pub fn table<const N: usize>(entries: [(&'static str, Toml); N]) -> Self {
        Self::Table(entries.into())
    }

    /// A colour; a grey is one number.
    pub fn color([r, g, b]: [f64; 3]) -> Self {
        if r == g && g == b {
            Self::Float(r)
        } else {
            Self::numbers(&[r, g, b])
        }
    }

    /// A string.
    pub fn string(text: impl Into<String>) -> Self {
        Self::String(text.into())
    }

    fn write(&self, out: &mut String) {
        match self {
            Self::Boolean(b) => out.push_str(if *b { "true" } else { "false" }),
            Self::Integer(n) => {
                let _ = write!(out, "{n}");
            }
            // The shortest decimals that read back to the same number, always with a point or an exponent.
            Self::Float(x) => {
                let _ = write!(out, "{x:?}");
            }
            Self::String(text) => write_string(text, out),
            Self::Array(items) => {
                out.push('[');
                for (i, item) in items.iter().enumerate() {
                    out.push_str(if i > 0 { ", " } else { "" });
                    item.write(out);
                }
                out.push(']');
            }
            Self::Table(entries) => {
                for (i, (key, value)) in entries.iter().enumerate() {
                    out.push_str(if i > 0 { ", " } else { "{ " });
                    out.push_str(key);
                    out.push_str(" = ");
                    value.write(out);
                }
                out.push_str(if entries.is_empty() { "{}" } else { " }" });
            }
        }
    }
}

/// A basic string. The `toml` crate's writer may use several lines, which would upset the line numbers.
fn write_string(text: &str, out: &mut String) {
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            c if c.is_control() => {
                let _ = write!(out, "\\u{:04X}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
}

/// A table of the file.
#[derive(Clone, Debug)]
pub struct Section {
    head: String,
    place: FileLine,
    entries: Vec<Entry>,
}

#[derive(Clone, Debug)]
struct Entry {
    key: &'static str,
    value: Toml,
    place: FileLine,
    /// An array's values, one per line.
    items: Option<Vec<(Toml, FileLine)>>,
}

impl Section {
    /// `[name]`.
    pub fn table(name: &str, place: FileLine) -> Self {
        Self::new(format!("[{name}]"), place)
    }

    /// `[group.name]`; the name may need quotes.
    pub fn named(group: &str, name: &str, place: FileLine) -> Self {
        let bare = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        let mut key = String::new();
        if !name.is_empty() && name.chars().all(bare) {
            key.push_str(name);
        } else {
            write_string(name, &mut key);
        }
        Self::new(format!("[{group}.{key}]"), place)
    }

    /// `[[name]]`.
    pub fn item(name: &str, place: FileLine) -> Self {
        Self::new(format!("[[{name}]]"), place)
    }

    fn new(head: String, place: FileLine) -> Self {
        Self {
            head,
            place,
            entries: Vec::new(),
        }
    }

    /// Add a field.
    pub fn set(&mut self, key: &'static str, value: Toml, place: FileLine) {
        self.entries.push(Entry {
            key,
            value,
            place,
            items: None,
        });
    }

    /// Add a list field, one item per line.
    pub fn set_lines(&mut self, key: &'static str, items: Vec<(Toml, FileLine)>, place: FileLine) {
        self.entries.push(Entry {
            key,
            value: Toml::Boolean(true),
            place,
            items: Some(items),
        });
    }

    /// A copy without one field.
    pub fn without(&self, key: &str) -> Self {
        let mut section = self.clone();
        section.entries.retain(|entry| entry.key != key);
        section
    }

    /// Whether it has no fields.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The fields as an inline table.
    pub fn into_inline(self) -> Toml {
        Toml::Table(self.entries.into_iter().map(|e| (e.key, e.value)).collect())
    }
}

/// A file's text and the origin of its lines.
#[derive(Clone, Debug, Default)]
pub struct Written {
    pub text: String,
    /// Origins by line; `None` for blank lines and comments.
    pub places: Vec<Option<FileLine>>,
    /// Generated files by their names in the text.
    pub made: BTreeMap<String, Vec<u8>>,
}

impl Written {
    /// Write sections below a comment.
    pub fn new(comment: &str, sections: &[Section]) -> Self {
        let mut written = Self::default();
        for line in comment.lines() {
            // Control characters in a file name must not break the comment.
            let line: String = line.chars().filter(|c| !c.is_control()).collect();
            written.line(format!("# {line}"), None);
        }
        for section in sections {
            written.line(String::new(), None);
            written.line(section.head.clone(), Some(section.place));
            for entry in &section.entries {
                let mut line = format!("{} = ", entry.key);
                match &entry.items {
                    None => {
                        entry.value.write(&mut line);
                        written.line(line, Some(entry.place));
                    }
                    Some(items) => {
                        line.push('[');
                        written.line(line, Some(entry.place));
                        for (item, place) in items {
                            let mut line = "  ".to_string();
                            item.write(&mut line);
                            line.push(',');
                            written.line(line, Some(*place));
                        }
                        written.line("]".to_string(), Some(entry.place));
                    }
                }
            }
        }
        written
    }

    fn line(&mut self, line: String, place: Option<FileLine>) {
        self.text.push_str(&line);
        self.text.push('\n');
        self.places.push(place);
    }
}
