//! The fields that a panel shows: numbers, colours, vectors, choices and switches, with ranges and words from the JSON
//! Schema.

use super::digits;
use super::part::{Part, below};
use super::schema::{self, Form, Known};
use glam::DVec3;
use serde::Serialize;
use serde_json::Value as Json;
use toml_edit::DocumentMut;

/// Fields shown even if the file omits them, provided their default is known.
const OFFERED: [&str; 13] = [
    "fov",
    "aperture",
    "focus_distance",
    "exposure",
    "white_balance",
    "view",
    "reflectance",
    "base_color",
    "roughness",
    "alpha",
    "ior",
    "g",
    "scale",
];
/// Fields of `render` that affect the display.
const VIEW: [&str; 3] = ["exposure", "white_balance", "view"];
/// Fields set by moving the camera.
const MOVES: [&str; 3] = ["origin", "target", "up"];
/// Significant digits of a computed distance.
const DIGITS: i32 = 4;

/// A field of a panel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Field {
    /// As in [`crate::Edits`].
    pub path: String,
    /// Name of the thing it belongs to.
    pub group: String,
    /// `camera`, `render`, `light`, `shape`, `medium` or `material`.
    pub group_kind: &'static str,
    /// The thing's id, if it has a place in the scene.
    pub thing: Option<String>,
    /// Path within the thing: `power`, `phase.g`.
    pub name: String,
    /// The kind of its values.
    pub kind: FieldKind,
    /// Its value; null if neither the file nor the field's description gives one.
    pub value: Json,
    /// Its default, if known.
    pub default: Option<Json>,
    /// Whether the file sets it.
    pub given: bool,
    /// Least value of numbers and of colour components.
    pub min: Option<f64>,
    /// Greatest value, likewise.
    pub max: Option<f64>,
    /// Whether `min` itself is excluded.
    pub open_min: bool,
    /// Whether `max` itself is excluded.
    pub open_max: bool,
    /// Allowed words.
    pub choices: Vec<String>,
    /// The unit, such as `W/sr`; empty if there is none.
    pub unit: String,
    /// A sentence of help; empty if there is none.
    pub help: String,
}

/// The kind of a field's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum FieldKind {
    /// One number.
    Number,
    /// One number or three.
    Color,
    /// Two numbers or three.
    Vector,
    /// True or false.
    Bool,
    /// One of several words.
    Choice,
}

/// All fields that a panel shows: those of the camera, the view, lights, emitting shapes, media and materials, each in
/// the order of the text. Empty if the text is not TOML.
pub fn fields(text: &str) -> Vec<Field> {
    let Ok(document) = text.parse::<DocumentMut>() else {
        return Vec::new();
    };
    let root = Part::Table(document.as_table());
    let mut panel = Panel {
        found: Vec::new(),
        root: &root,
    };
    panel.table("camera", "camera", &|name| !MOVES.contains(&name));
    panel.table("render", "render", &|name| VIEW.contains(&name));
    panel.list("lights", "light", |_| true);
    // Shapes show only their emission.
    panel.list("shapes", "shape", |name| name == "emission");
    panel.names("media", "medium");
    panel.names("materials", "material");
    panel.found
}

struct Panel<'a> {
    found: Vec<Field>,
    root: &'a Part<'a>,
}

/// The thing whose fields are walked.
struct Group<'g> {
    name: &'g str,
    kind: &'static str,
    thing: Option<String>,
    path: String,
    /// Which of its own fields are shown.
    shows: &'g dyn Fn(&str) -> bool,
}

impl Panel<'_> {
    fn table(&mut self, name: &'static str, kind: &'static str, shows: &dyn Fn(&str) -> bool) {
        let empty = toml_edit::Table::new();
        let table = self.root.get(name).unwrap_or(Part::Table(&empty));
        let group = Group {
            name,
            kind,
            thing: None,
            path: name.to_owned(),
            shows,
        };
        self.walk(&group, schema::of(name), &table, "");
    }

    fn list(&mut self, name: &str, kind: &'static str, shows: fn(&str) -> bool) {
        let Some(Part::List(parts)) = self.root.get(name) else {
            return;
        };
        let Some(of) = schema::items(schema::of(name)) else {
            return;
        };
        for (i, part) in parts.iter().enumerate() {
            let unnamed = format!("{name}[{i}]");
            let path = format!("{name}.{i}");
            let group = Group {
                name: part.get("name").and_then(|name| name.text()).unwrap_or(&unnamed),
                kind,
                thing: Some(path.clone()),
                path,
                shows: &shows,
            };
            self.walk(&group, of, part, "");
        }
    }

    fn names(&mut self, name: &str, kind: &'static str) {
        let Some(Part::Table(table)) = self.root.get(name) else {
            return;
        };
        for (entry, item) in table.iter() {
            let Some(part) = Part::of(item) else {
                continue;
            };
            let group = Group {
                name: entry,
                kind,
                thing: None,
                path: below(name, entry),
                shows: &|_| true,
            };
            self.walk(&group, schema::entries(schema::of(name)), &part, "");
        }
    }

    /// `inner`: path from the thing to this table.
    fn walk(&mut self, group: &Group<'_>, of: &'static Json, part: &Part<'_>, inner: &str) {
        let Part::Table(table) = part else {
            return;
        };
        let shown = |name: &str| name != "type" && (!inner.is_empty() || (group.shows)(name));
        let known: Vec<Known> = schema::fields(of, part)
            .into_iter()
            .filter(|field| shown(field.name))
            .collect();
        for (name, item) in table.iter() {
            let field = known.iter().find(|field| field.name == name);
            let (Some(field), Some(given)) = (field, Part::of(item)) else {
                continue;
            };
            self.given(group, field, &given, &below(inner, name));
            self.keep_plane(name, part);
        }
        for field in &known {
            if OFFERED.contains(&field.name) && part.get(field.name).is_none() && is_open(field.name, part) {
                self.absent(group, field, part, &below(inner, field.name));
                self.keep_plane(field.name, part);
            }
        }
    }

    /// Limits the last field of view to below 180 degrees, unless the camera is panoramic.
    fn keep_plane(&mut self, name: &str, part: &Part<'_>) {
        let projection = part.get("projection");
        let is_plane = projection.is_none_or(|word| word.text() == Some("perspective"));
        if let ("fov", true, Some(found)) = (name, is_plane, self.found.last_mut()) {
            (found.max, found.open_max) = (Some(180.0), true);
        }
    }

    fn given(&mut self, group: &Group<'_>, field: &Known, given: &Part<'_>, name: &str) {
        if let (Some(meaning), Some(value)) = (field.meaning(Some(given)), given.json()) {
            let field = shown(group, field, name, meaning, value, true);
            self.found.push(field);
            return;
        }
        match given {
            Part::Table(_) => self.walk(group, field.schema, given, name),
            Part::List(parts) => {
                let Some(of) = schema::items(field.schema) else {
                    return;
                };
                for (i, part) in parts.iter().enumerate() {
                    let of_list = Known::of_list(of);
                    // Single numbers of a matrix or words of a list make no sense alone.
                    let is_color = || {
                        of_list
                            .meaning(Some(part))
                            .is_some_and(|meaning| meaning.form == Form::Color)
                    };
                    if !matches!(part, Part::Leaf(_)) || is_color() {
                        self.given(group, &of_list, part, &below(name, &i.to_string()));
                    }
                }
            }
            Part::Leaf(_) => {}
        }
    }

    fn absent(&mut self, group: &Group<'_>, field: &Known, part: &Part<'_>, name: &str) {
        let default = match field.name {
            "focus_distance" => distance(part),
            _ => field.default(),
        };
        if let (Some(meaning), Some(default)) = (field.meaning(None), default) {
            let mut field = shown(group, field, name, meaning, default.clone(), false);
            field.default = Some(default);
            self.found.push(field);
        }
    }
}

/// Whether an omitted field can be added to the fields that are there.
fn is_open(name: &str, part: &Part<'_>) -> bool {
    let has = |other: &str| part.get(other).is_some();
    match name {
        "fov" => !has("gltf") && !has("projection"),
        "ior" => !has("specular"),
        // Only for values from a file or recipe.
        "scale" => has("image") || has("density") || has("ies"),
        _ => true,
    }
}

/// Distance from the camera to its target.
fn distance(camera: &Part<'_>) -> Option<Json> {
    let point = |name: &str| {
        let numbers = camera.get(name)?.numbers()?;
        <[f64; 3]>::try_from(numbers).ok().map(DVec3::from)
    };
    let distance = (point("target")? - point("origin")?).length();
    Some(digits::significant(distance, DIGITS).into())
}

fn shown(group: &Group<'_>, field: &Known, name: &str, meaning: schema::Meaning, value: Json, given: bool) -> Field {
    let words = field.words();
    let (kind, choices) = match meaning.form {
        Form::Number => (FieldKind::Number, Vec::new()),
        Form::Color => (FieldKind::Color, Vec::new()),
        Form::Vector => (FieldKind::Vector, Vec::new()),
        Form::Bool => (FieldKind::Bool, Vec::new()),
        Form::Choice(choices) => (FieldKind::Choice, choices),
    };
    let default = field.default().filter(|default| match default {
        Json::Number(_) => matches!(kind, FieldKind::Number | FieldKind::Color),
        Json::Bool(_) => kind == FieldKind::Bool,
        Json::String(word) => choices.contains(word),
        _ => false,
    });
    Field {
        path: format!("{}.{name}", group.path),
        group: group.name.to_owned(),
        group_kind: group.kind,
        thing: group.thing.clone(),
        name: name.to_owned(),
        kind,
        value,
        default,
        given,
        min: meaning.min,
        max: meaning.max,
        open_min: meaning.open_min,
        open_max: meaning.open_max,
        choices,
        unit: words.unit,
        help: words.help,
    }
}
