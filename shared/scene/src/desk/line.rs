//! Finds the field on a line.

use super::part::below;
use beamfarm_assets::line_of;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The path of the first field whose name is on a line of a text, counted from one; `None` if there is none, or if the
/// text is not TOML.
pub fn path_at(text: &str, line: usize) -> Option<String> {
    let root = DeTable::parse(text).ok()?;
    let on_line = |byte: usize| line_of(text.as_bytes(), byte) == line;
    in_table("", root.get_ref(), &on_line)
}

fn in_table(path: &str, table: &DeTable<'_>, on_line: &impl Fn(usize) -> bool) -> Option<String> {
    table.iter().find_map(|(key, value)| {
        let here = below(path, key.get_ref());
        let is_header = value.span().start <= key.span().start;
        match on_line(key.span().start) && !is_header {
            // An inline table: the fault is inside it, but it cannot be located.
            true => Some(here),
            false => in_value(&here, value, on_line),
        }
    })
}

fn in_value(path: &str, value: &Spanned<DeValue<'_>>, on_line: &impl Fn(usize) -> bool) -> Option<String> {
    match value.get_ref() {
        DeValue::Table(table) => in_table(path, table, on_line),
        DeValue::Array(items) => {
            let mut items = items.iter().enumerate();
            items.find_map(|(i, item)| in_value(&below(path, &i.to_string()), item, on_line))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_have_paths() {
        let text = "\
# A room.
image = { width = 8, height = 6 }
[camera]
fov = 40

[materials.\"a.b\"]
ior = 1.5
[[lights]]
power = 1
[[lights]]
type = \"point\"
power = [
  1,
]
";
        let expected = [
            (2, Some("image")),
            (3, None),
            (4, Some("camera.fov")),
            (5, None),
            (7, Some("materials.\"a.b\".ior")),
            (9, Some("lights.0.power")),
            (12, Some("lights.1.power")),
            (13, None),
            (99, None),
        ];
        for (line, path) in expected {
            assert_eq!(path_at(text, line).as_deref(), path, "line {line}");
        }
        assert_eq!(path_at("[camera\n", 1), None);
    }
}
