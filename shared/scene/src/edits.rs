//! Changes to a scene file that are requested without opening it: fields by path, and the image size.

use crate::error::SceneError;
use crate::place::{Place, put};
use std::path::Path;
use toml_edit::{DocumentMut, InlineTable, Item, TableLike, Value};

/// Values that override the file's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Edits {
    /// Fields by path (`camera.fov`, `lights.0.power`, `materials.glass.ior`) and their values as TOML. A value that is
    /// not TOML is taken as a string.
    pub fields: Vec<(String, String)>,
    /// Pixels per row; without `height` the aspect ratio is kept.
    pub width: Option<u32>,
    /// Rows; without `width` the aspect ratio is kept.
    pub height: Option<u32>,
    /// Factor on both sides, applied before `width` and `height`.
    pub scale: Option<f64>,
    /// Window of the resulting image: x, y, width, height.
    pub crop: Option<[u32; 4]>,
}

impl Edits {
    /// The changed text, otherwise as it was; `None` if nothing changes.
    pub(crate) fn apply(&self, file: &Path, text: &str) -> Result<Option<String>, SceneError> {
        if *self == Self::default() {
            return Ok(None);
        }
        // Faults in the text itself are reported, with their line, by the next reader.
        let Ok(mut document) = text.parse::<DocumentMut>() else {
            return Ok(None);
        };
        let wrong = |message: String| SceneError {
            file: file.to_owned(),
            line: None,
            message,
        };
        for (path, value) in &self.fields {
            set(document.as_item_mut(), path, value)
                .map_err(|message| wrong(format!("-D {path}={value}: {message}")))?;
        }
        if let Some(image) = document.get_mut("image").and_then(Item::as_table_like_mut) {
            self.resize(image).map_err(wrong)?;
        }
        Ok(Some(document.to_string()))
    }

    fn resize(&self, image: &mut dyn TableLike) -> Result<(), String> {
        let side = |name: &str| image.get(name).and_then(Item::as_integer).map(|side| side as f64);
        let (Some(width), Some(height)) = (side("width"), side("height")) else {
            return Ok(());
        };
        let scale = self.scale.unwrap_or(1.0);
        let (across, down) = match (self.width, self.height) {
            (Some(w), Some(h)) => (f64::from(w) / width, f64::from(h) / height),
            (Some(w), None) => (f64::from(w) / width, f64::from(w) / width),
            (None, Some(h)) => (f64::from(h) / height, f64::from(h) / height),
            (None, None) => (scale, scale),
        };
        let pixels = |side: f64, factor: f64| ((side * factor).round() as i64).max(1);
        for (name, side, factor) in [("width", width, across), ("height", height, down)] {
            put(image, name, Value::from(pixels(side, factor)));
        }
        match self.crop {
            Some(crop) => {
                let fields = ["x", "y", "width", "height"].into_iter().zip(crop);
                let window: InlineTable = fields.map(|(name, pixels)| (name, i64::from(pixels))).collect();
                put(image, "crop", Value::from(window));
            }
            None => {
                let Some(crop) = image.get_mut("crop").and_then(Item::as_table_like_mut) else {
                    return Ok(());
                };
                for (place, side, factor) in [("x", "width", across), ("y", "height", down)] {
                    let given = |name: &str| crop.get(name).and_then(Item::as_integer).unwrap_or(0) as f64;
                    let (first, count) = (given(place), given(side));
                    let start = (first * factor).round() as i64;
                    let end = ((first + count) * factor).round() as i64;
                    put(crop, place, Value::from(start));
                    put(crop, side, Value::from((end - start).max(1)));
                }
            }
        }
        Ok(())
    }
}

/// Set a field to a TOML value, or to a string if it is not TOML.
fn set(root: &mut Item, path: &str, text: &str) -> Result<(), String> {
    let value = text.parse::<Value>().unwrap_or_else(|_| Value::from(text));
    let (place, name) = Place::find(root, path)?;
    place.set(&name, value)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "\
# A room.
image = { width = 640, height = 480 } # small
[camera]
fov = 50 # wide
target = [0, 0, 0]
[materials.glass]
ior = 1.5
[[lights]]
power = 10
[[lights]]
power = [1, 2, 3]
transform = [{ translate = [0, 1, 0] }]
";

    fn edited(edits: &Edits) -> Result<String, String> {
        let text = edits.apply(Path::new("a.toml"), TEXT);
        text.map(|text| text.unwrap()).map_err(|error| error.message)
    }

    fn with(path: &str, value: &str) -> Result<String, String> {
        edited(&Edits {
            fields: vec![(path.into(), value.into())],
            ..Edits::default()
        })
    }

    #[test]
    fn a_field_changes_and_nothing_else() {
        for (path, value, before, after) in [
            ("camera.fov", "40", "fov = 50 # wide", "fov = 40 # wide"),
            ("camera.target.2", "1.5", "[0, 0, 0]\n", "[0, 0, 1.5]\n"),
            ("materials.glass.ior", "1.33", "ior = 1.5", "ior = 1.33"),
            ("lights.1.power", "7", "power = [1, 2, 3]", "power = 7"),
            ("lights.1.transform.0.translate.1", "9", "[0, 1, 0]", "[0, 9, 0]"),
            ("image.width", "64", "width = 640", "width = 64"),
        ] {
            let expected = TEXT.replace(before, after);
            assert_eq!(with(path, value).unwrap(), expected, "{path}");
        }
        // Missing fields are added, and strings need no quotes.
        assert!(with("world.medium", "fog").unwrap().contains("medium = \"fog\""));
        assert!(with("camera.focus", "2").unwrap().contains("focus = 2"));
    }

    #[test]
    fn what_is_not_there_is_named() {
        for (path, expected) in [
            ("lights.2.power", "lights.2: there are 2"),
            ("lights.first.power", "the number of one of a list"),
            ("camera.fov.x", "it is no"),
            ("camera.target.3", "there are 3"),
            ("", "expected a path"),
            ("a..b", "expected a path"),
        ] {
            let said = with(path, "1").unwrap_err();
            assert!(said.contains(expected), "{path}: {said}");
        }
    }

    #[test]
    fn sizes_keep_their_proportions() {
        let sized = |edits: Edits| edited(&edits).unwrap();
        let half = Edits {
            scale: Some(0.5),
            ..Edits::default()
        };
        assert!(sized(half.clone()).contains("{ width = 320, height = 240 } # small"));
        let wide = Edits {
            width: Some(960),
            ..Edits::default()
        };
        assert!(sized(wide.clone()).contains("{ width = 960, height = 720 }"));
        let both = Edits {
            height: Some(10),
            ..wide
        };
        assert!(sized(both).contains("{ width = 960, height = 10 }"));
        let crop = Edits {
            crop: Some([1, 2, 30, 40]),
            ..half
        };
        let text = sized(crop);
        assert!(
            text.contains("crop = { x = 1, y = 2, width = 30, height = 40 }"),
            "{text}"
        );
    }
}
