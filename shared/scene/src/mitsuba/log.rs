//! The messages of an import: errors, unsupported parts, notes.

use super::FileLine;
use crate::error::SceneError;
use std::path::{Path, PathBuf};

/// Collects all faults to report them together.
#[derive(Debug, Default)]
pub struct Log {
    /// Files by the index that places use, as shown in messages.
    pub files: Vec<PathBuf>,
    invalid: Vec<(Option<FileLine>, String)>,
    unsupported: Vec<(Option<FileLine>, String)>,
    notes: Vec<(Option<FileLine>, String)>,
}

impl Log {
    /// Add an error.
    pub fn invalid(&mut self, place: Option<FileLine>, message: impl Into<String>) {
        self.invalid.push((place, message.into()));
    }

    /// Add an error after which nothing can be read.
    pub fn fatal<T>(&mut self, place: Option<FileLine>, message: impl Into<String>) -> Option<T> {
        self.invalid(place, message);
        None
    }

    /// Add something that Mitsuba supports and this program does not; a render may leave it out.
    pub fn unsupported(&mut self, place: FileLine, message: impl Into<String>) {
        self.unsupported.push((Some(place), message.into()));
    }

    /// Add a note.
    pub fn note(&mut self, place: FileLine, message: impl Into<String>) {
        self.notes.push((Some(place), message.into()));
    }

    /// A place as shown in messages.
    pub fn describe(&self, place: FileLine) -> String {
        let file = self.files.get(place.file);
        let file = file.map(|file| file.display().to_string());
        match file {
            Some(file) => format!("{file}:{}", place.line),
            None => format!("line {}", place.line),
        }
    }

    /// The notes and what was left out, or all errors as one. With `skip`, unsupported parts are left out.
    pub fn finish(self, main: &Path, skip: bool) -> Result<[Vec<String>; 2], SceneError> {
        let mut errors = self.invalid.clone();
        if !skip {
            errors.extend(self.unsupported.iter().cloned());
        }
        if errors.is_empty() {
            let describe = |(place, message): &(Option<FileLine>, String)| match place {
                Some(place) => format!("{}: {message}", self.describe(*place)),
                None => message.clone(),
            };
            return Ok([&self.notes, &self.unsupported].map(|list| list.iter().map(describe).collect()));
        }
        // Sorted by file and line; those without a line come first.
        errors.sort_by_key(|(place, _)| place.map(|place| (place.file, place.line)));
        errors.dedup();
        let error = |(place, message): &(Option<FileLine>, String)| SceneError {
            file: place
                .and_then(|place| self.files.get(place.file))
                .map_or_else(|| main.to_path_buf(), Clone::clone),
            line: place.map(|place| place.line),
            message: message.clone(),
        };
        let mut all = errors.iter().map(error);
        let first = all.next();
        let rest = all.fold(String::new(), |text, error| format!("{text}\n{error}"));
        Err(first.map_or_else(
            || SceneError {
                file: main.to_path_buf(),
                line: None,
                message: String::new(),
            },
            |first| SceneError {
                message: first.message + &rest,
                ..first
            },
        ))
    }
}
