//! What of a file does not count or counts otherwise than it says, each with what it is said of.

use std::collections::BTreeMap;

/// Names that a note lists.
const MOST_NAMES: usize = 6;

/// Notes for people, each told once.
#[derive(Default)]
pub struct Notes(BTreeMap<String, Vec<String>>);

impl Notes {
    /// Of the file as a whole.
    pub fn add(&mut self, note: impl Into<String>) {
        self.0.entry(note.into()).or_default();
    }

    /// Of one thing of a kind that `note` speaks of.
    pub fn add_of(&mut self, note: impl Into<String>, name: &str) {
        self.0.entry(note.into()).or_default().push(name.to_owned());
    }

    /// All of them as lines.
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
