//! Finds all errors of a scene file, not just the first: each faulty part is blanked out, and the rest is read again.

use crate::disk::{read_file, text_of};
use crate::error::SceneError;
use crate::gather::{Authors, with_assets};
use crate::kinds;
use crate::load::load;
use crate::options::ImportOptions;
use crate::reach::Reach;
use crate::scene_file::SceneText;
use beamfarm_image::bundle;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The most errors reported.
const MOST: usize = 20;
/// The most attempts at reading the rest.
const ATTEMPTS: usize = 60;

/// All errors of a native scene file in line order; empty if it is valid. Errors that merely follow from others are
/// left out.
pub fn errors(path: &Path, options: &ImportOptions) -> Vec<SceneError> {
    let text = read(path, options);
    let reach = Reach::new(path, &options.allow_outside);
    let found = |text| errors_of(path, text, &BTreeMap::new(), &reach);
    text.map_or_else(Vec::new, found)
}

/// [`errors`] of a scene that is not in a file.
pub fn errors_of_text(scene: &SceneText, options: &ImportOptions) -> Vec<SceneError> {
    let edited = options.edits.apply(&scene.path, &scene.text);
    edited.map_or_else(
        |error| vec![error],
        |edited| {
            let text = edited.unwrap_or_else(|| scene.text.clone());
            errors_of(&scene.path, text, &scene.made, &scene.reach(options))
        },
    )
}

fn errors_of(path: &Path, text: String, made: &BTreeMap<String, Vec<u8>>, reach: &Reach) -> Vec<SceneError> {
    let mut rest = Rest {
        text,
        blanked: BTreeSet::new(),
        incomplete: BTreeSet::new(),
    };
    let mut found: Vec<SceneError> = Vec::new();
    for _ in 0..ATTEMPTS {
        let Err(error) = attempt(path, &rest.text, made, reach) else {
            break;
        };
        let line = error.line.filter(|_| error.file == path);
        if !rest.follows(&error) {
            rest.incomplete.insert(table_of(&error).to_owned());
            found.push(error);
        }
        // The fault may be in another file, and where that is named is unknown.
        if found.len() == MOST || !line.is_some_and(|line| rest.blank(line)) {
            break;
        }
    }
    found.sort_by_key(|error| error.line);
    found
}

fn read(path: &Path, options: &ImportOptions) -> Option<String> {
    if kinds::refusal(path).is_some() {
        return None;
    }
    let bytes = read_file(path, bundle::MAX_BYTES).ok()?;
    let text = text_of(path, &bytes).ok()?.to_owned();
    match options.edits.apply(path, &text).ok()? {
        Some(edited) => Some(edited),
        None => Some(text),
    }
}

fn attempt(path: &Path, text: &str, made: &BTreeMap<String, Vec<u8>>, reach: &Reach) -> Result<(), SceneError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let scene = (name, text.as_bytes().to_vec());
    let bundle = with_assets(scene, path, folder, (reach, Authors::USER), made)?;
    load(&bundle).map(drop).map_err(|error| SceneError {
        file: folder.join(&error.file),
        ..error
    })
}

/// The part of a file that is still read.
struct Rest {
    text: String,
    /// Names of blanked fields and things.
    blanked: BTreeSet<String>,
    /// Tables with a blanked part.
    incomplete: BTreeSet<String>,
}

/// The field that an error is about, as in `media.fog.sigma_a`.
fn field_of(error: &SceneError) -> &str {
    error.message.split(": ").next().unwrap_or_default()
}

/// The table that the field is in.
fn table_of(error: &SceneError) -> &str {
    let field = field_of(error);
    field.rsplit_once('.').map_or(field, |(table, _)| table)
}

impl Rest {
    /// Whether an error only reports something that was blanked out.
    fn follows(&self, error: &SceneError) -> bool {
        // Errors about a value itself hold anyway.
        let of_value = ["unknown field", "found ", "does not take"];
        let is_incomplete = [field_of(error), table_of(error)]
            .iter()
            .any(|name| self.incomplete.contains(*name));
        if is_incomplete && !of_value.iter().any(|words| error.message.contains(words)) {
            return true;
        }
        let says =
            |words: &str, name: &str, quote: char| error.message.contains(&format!("{words}{quote}{name}{quote}"));
        self.blanked.iter().any(|name| {
            says("missing field ", name, '`')
                || says("the field ", name, '`')
                || error.message.contains("there is no") && says(" ", name, '"')
        })
    }

    /// Blank what begins on this line: a field with its value, or a whole table.
    fn blank(&mut self, line: usize) -> bool {
        let Some(range) = self.table_at(line).or_else(|| self.field_at(line)) else {
            return false;
        };
        let gone = &self.text[range.clone()];
        let spaces: String = gone.chars().map(|c| if c == '\n' { '\n' } else { ' ' }).collect();
        let is_news = spaces.trim() != gone.trim();
        self.text.replace_range(range, &spaces);
        is_news
    }

    /// From a header on this line to the next header.
    fn table_at(&mut self, line: usize) -> Option<Range<usize>> {
        let mut lines = Vec::new();
        let mut start = 0;
        for text in self.text.split_inclusive('\n') {
            lines.push((start, text.trim()));
            start += text.len();
        }
        let is_header = |text: &str| {
            let bare = text.split('#').next().unwrap_or_default().trim_end();
            bare.starts_with('[') && bare.ends_with(']') && !bare.contains(',')
        };
        let (start, header) = *lines.get(line.checked_sub(1)?)?;
        if !is_header(header) {
            return None;
        }
        let mut later = lines[line..].iter();
        let end = later
            .find(|(_, text)| is_header(text))
            .map_or(self.text.len(), |next| next.0);
        let name = header.trim_matches(['[', ']']).rsplit('.').next().unwrap_or_default();
        self.blanked.insert(name.trim_matches('"').to_owned());
        Some(start..end)
    }

    /// The first field whose name is on this line, with its value.
    fn field_at(&mut self, line: usize) -> Option<Range<usize>> {
        let root = DeTable::parse(&self.text).ok()?;
        let on_line = |byte: usize| beamfarm_assets::line_of(self.text.as_bytes(), byte) == line;
        let (name, range) = first_field(root.get_ref(), &on_line)?;
        self.blanked.insert(name);
        Some(range)
    }
}

fn first_field(table: &DeTable<'_>, on_line: &impl Fn(usize) -> bool) -> Option<(String, Range<usize>)> {
    for (key, value) in table {
        let is_header = value.span().start <= key.span().start;
        if on_line(key.span().start) && !is_header {
            return Some((key.get_ref().to_string(), key.span().start..value.span().end));
        }
        let inner = first_in_value(value, on_line);
        if inner.is_some() {
            return inner;
        }
    }
    None
}

fn first_in_value(value: &Spanned<DeValue<'_>>, on_line: &impl Fn(usize) -> bool) -> Option<(String, Range<usize>)> {
    match value.get_ref() {
        DeValue::Table(table) => first_field(table, on_line),
        DeValue::Array(items) => items.iter().find_map(|item| first_in_value(item, on_line)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = "\
[image]
width = 64
height = 48
[camera]
origin = [0, 0, 3]
target = [0, 0, 0]
fov = 40
[materials.red]
type = \"diffuse\"
reflectance = [0.8, 0.1, 0.1]
[[shapes]]
type = \"sphere\"
center = [0, 0, 0]
radius = 1
material = \"red\"
[[lights]]
type = \"point\"
position = [2, 2, 3]
power = 100
";

    /// All errors, as lines and messages.
    fn all(text: &str) -> Vec<(usize, String)> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, text).unwrap();
        let errors = errors(&path, &ImportOptions::default());
        errors
            .into_iter()
            .map(|error| (error.line.unwrap_or_default(), error.message))
            .collect()
    }

    #[test]
    fn each_error_is_told_once_and_what_follows_is_not() {
        assert_eq!(all(SCENE), []);
        let wrong = SCENE
            .replace("width = 64", "width = \"wide\"")
            .replace("fov = 40", "fovv = 40")
            .replace("reflectance = [0.8, 0.1, 0.1]", "reflectance = [0.8, 0.1]")
            .replace("radius = 1", "radius = -1")
            .replace("power = 100", "powr = 100");
        let found = all(&wrong);
        let lines: Vec<usize> = found.iter().map(|(line, _)| *line).collect();
        assert_eq!(lines, [2, 7, 10, 14, 19], "{found:#?}");
        for ((_, message), word) in found
            .iter()
            .zip(["whole number", "`fov`", "reflectance", "radius", "`power`"])
        {
            assert!(message.contains(word), "{message}");
        }
    }

    #[test]
    fn names_and_whole_tables() {
        let wrong = SCENE
            .replace("material = \"red\"", "material = \"rod\"")
            .replace("type = \"point\"\n", "");
        let found = all(&wrong);
        assert_eq!(found.len(), 2, "{found:#?}");
        assert!(
            found[0].1.contains("there is no material \"rod\"") && found[0].0 == 15,
            "{found:#?}"
        );
        assert_eq!(found[1].0, 16);
        // Text that is not TOML has one error.
        assert_eq!(all("[image\nwidth = 3\n").len(), 1);
    }
}
