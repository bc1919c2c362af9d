//! Notes on what is ignored or interpreted differently, each with the things it concerns.

use std::collections::BTreeMap;

/// How many names a note lists.
const MOST_NAMES: usize = 6;

/// Notes for the user, each given once.
#[derive(Default)]
pub struct Notes(BTreeMap<String, Vec<String>>);

impl Notes {
    /// Add a note on the whole file.
    pub fn add(&mut self, note: impl Into<String>) {
        self.0.entry(note.into()).or_default();
    }

    /// Add a thing to the note on its kind.
    pub fn add_of(&mut self, note: impl Into<String>, name: &str) {
        self.0.entry(note.into()).or_default().push(name.to_owned());
    }

    /// All notes as lines.
    pub fn lines(self) -> Vec<String> {
        let line = |(note, mut names): (String, Vec<String>)| {
            names.dedup();
            let more = names.len().saturating_sub(MOST_NAMES);
            names.truncate(MOST_NAMES);
            let names = names.join(", ");
            match (names.is_empty(), more) {
                (true, _) => note,
                (false, 0) => format!("{note}: {names}"),
                (false, more) => format!("{note}: {names} and {more} others"),
            }
        };
        self.0.into_iter().map(line).collect()
    }
}
