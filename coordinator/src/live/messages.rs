//! Messages between a live view's page and its server over their WebSocket.
//!
//! A picture is a binary message: four bytes, little-endian, with the length of a [`FrameHeader`] in JSON, then the
//! header and a JPEG. A client of `/look?pixels=linear` gets radiance in place of the JPEG, for its own exposure and
//! tone curve: R, G, B of each pixel as little-endian 32-bit floats, rows from the top.

use beamfarm_image::job::MAX_PASSES;
use beamfarm_scene::desk::{Field, Thing};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A message from a page. `seq` counts its changes from one; changes of one `gesture` are one undo step.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum FromPage {
    /// Move the camera, world space; `fov` as in the scene file.
    Camera {
        seq: u64,
        gesture: String,
        origin: [f64; 3],
        target: [f64; 3],
        #[serde(default)]
        up: Option<[f64; 3]>,
        #[serde(default)]
        fov: Option<f64>,
    },
    /// Set a field; null removes it.
    Set {
        seq: u64,
        gesture: String,
        path: String,
        value: Value,
    },
    /// Move an object by this much since the gesture began, world space.
    Move {
        seq: u64,
        gesture: String,
        thing: String,
        by: [f64; 3],
    },
    /// Turn an object by this many degrees since the gesture began.
    Turn {
        seq: u64,
        gesture: String,
        thing: String,
        axis: [f64; 3],
        angle: f64,
    },
    /// No more changes for now.
    Rest,
    /// Identify what is visible at a point. Coordinates from the upper left of the picture, 0 to 1.
    Pick { x: f64, y: f64 },
    /// Focus on what is visible there.
    Focus { seq: u64, x: f64, y: f64 },
    /// Undo one step.
    Undo { seq: u64 },
    /// Redo one step.
    Redo { seq: u64 },
    /// Go back to the text on disk.
    Revert { seq: u64 },
    /// The scene's files have all just been written: read them without waiting for the next check.
    Written { seq: u64 },
    /// Write the scene file.
    Save,
    /// Start a job.
    Render,
    /// Open the scene file in an editor.
    Editor,
    /// Largest useful picture width in device pixels.
    Size { width: u32 },
    /// A picture is being displayed.
    Drawn { frame: u64 },
    /// Total number of passes.
    Passes { passes: u64 },
    /// Invalid, and why.
    #[serde(skip)]
    Nonsense(String),
}

/// Limit for numbers from a page: their squares, and values derived from them in single precision, stay finite.
const LARGEST: f64 = 1e18;
/// Range of picture coordinates: a click may end outside the picture.
const BESIDE: [f64; 2] = [-1.0, 2.0];
/// Range of picture widths in pixels.
const WIDTHS: std::ops::RangeInclusive<u32> = 64..=8192;

impl FromPage {
    /// Parse a page's message. Its numbers are validated only here: none is infinite or so large that it becomes so.
    pub fn read(text: &str) -> Self {
        let read = serde_json::from_str(text).map_err(|error| error.to_string());
        read.and_then(Self::within_ranges).unwrap_or_else(Self::Nonsense)
    }

    fn within_ranges(mut self) -> Result<Self, String> {
        let within = |name: &str, numbers: &[f64], [low, high]: [f64; 2]| match numbers
            .iter()
            .find(|x| !(low..=high).contains(*x))
        {
            Some(wrong) => Err(format!(
                "{name}: expected numbers from {low:e} to {high:e}, found {wrong:e}"
            )),
            None => Ok(()),
        };
        const ANY: [f64; 2] = [-LARGEST, LARGEST];
        match &mut self {
            Self::Camera {
                origin,
                target,
                up,
                fov,
                ..
            } => {
                within("origin", origin, ANY)?;
                within("target", target, ANY)?;
                within("up", up.as_ref().map_or(&[], |up| &up[..]), ANY)?;
                within("fov", fov.as_slice(), [0.0, 360.0])?;
            }
            Self::Set { value, .. } => {
                let mut numbers = Vec::new();
                collect(value, &mut numbers);
                // Seeds are 64-bit integers.
                within("value", &numbers, [-f64::from(f32::MAX), f64::from(f32::MAX)])?;
            }
            Self::Move { by, .. } => within("by", by, ANY)?,
            Self::Turn { axis, angle, .. } => {
                within("axis", axis, ANY)?;
                within("angle", &[*angle], [-1e9, 1e9])?;
            }
            Self::Pick { x, y } | Self::Focus { x, y, .. } => within("x, y", &[*x, *y], BESIDE)?,
            Self::Size { width } => *width = (*width).clamp(*WIDTHS.start(), *WIDTHS.end()),
            Self::Passes { passes } => *passes = (*passes).clamp(1, MAX_PASSES),
            Self::Rest
            | Self::Undo { .. }
            | Self::Redo { .. }
            | Self::Revert { .. }
            | Self::Written { .. }
            | Self::Save
            | Self::Render
            | Self::Editor
            | Self::Drawn { .. }
            | Self::Nonsense(_) => {}
        }
        Ok(self)
    }

    /// For a message that changes the scene: its number, and its gesture if it has one.
    pub fn change(&self) -> Option<(u64, Option<&str>)> {
        match self {
            Self::Camera { seq, gesture, .. }
            | Self::Set { seq, gesture, .. }
            | Self::Move { seq, gesture, .. }
            | Self::Turn { seq, gesture, .. } => Some((*seq, Some(gesture))),
            Self::Focus { seq, .. }
            | Self::Undo { seq }
            | Self::Redo { seq }
            | Self::Revert { seq }
            | Self::Written { seq } => Some((*seq, None)),
            _ => None,
        }
    }

    /// Whether `later` makes this message superfluous.
    pub fn is_outdone_by(&self, later: &Self) -> bool {
        match (self, later) {
            (
                Self::Set {
                    gesture: a, path: p, ..
                },
                Self::Set {
                    gesture: b, path: q, ..
                },
            ) => a == b && p == q,
            (Self::Camera { gesture: a, .. }, Self::Camera { gesture: b, .. }) => a == b,
            (
                Self::Move {
                    gesture: a, thing: p, ..
                },
                Self::Move {
                    gesture: b, thing: q, ..
                },
            )
            | (
                Self::Turn {
                    gesture: a, thing: p, ..
                },
                Self::Turn {
                    gesture: b, thing: q, ..
                },
            ) => a == b && p == q,
            (Self::Size { .. }, Self::Size { .. }) | (Self::Written { .. }, Self::Written { .. }) => true,
            _ => false,
        }
    }
}

/// Collects the numbers in a value.
fn collect(value: &Value, numbers: &mut Vec<f64>) {
    match value {
        Value::Number(number) => numbers.extend(number.as_f64()),
        Value::Array(values) => values.iter().for_each(|value| collect(value, numbers)),
        Value::Object(fields) => fields.values().for_each(|value| collect(value, numbers)),
        Value::Null | Value::Bool(_) | Value::String(_) => {}
    }
}

/// The camera, for overlays on the picture.
#[derive(Clone, Debug, Serialize)]
pub struct Camera {
    pub origin: [f64; 3],
    pub target: [f64; 3],
    pub up: [f64; 3],
    pub fov: f64,
    pub fov_axis: &'static str,
    /// Tangent of half the horizontal angle.
    pub tan_x: f64,
    pub width: u32,
    pub height: u32,
    /// Offset of the image's centre to the right and up, on the plane at distance one.
    pub shift: [f64; 2],
    pub flip_x: bool,
    pub aperture: f64,
    pub focus_distance: f64,
    /// Why the camera cannot be moved, if so.
    pub fixed: Option<String>,
}

/// A message to a page.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ToPage {
    /// The current scene.
    Scene {
        revision: u64,
        seq: u64,
        title: String,
        file: String,
        dirty: bool,
        undo: bool,
        redo: bool,
        camera: Camera,
        things: Vec<Thing>,
        fields: Vec<Field>,
    },
    /// A change is refused; `seq` 0: a change on disk.
    Error {
        seq: u64,
        path: Option<String>,
        line: Option<usize>,
        message: String,
    },
    /// The error is resolved.
    Fine,
    /// Current activity.
    State {
        workers: usize,
        doing: &'static str,
        passes: u64,
        of: u64,
        error: Option<f64>,
        seconds: f64,
    },
    /// The answer to a click.
    Picked {
        thing: Option<String>,
        name: Option<String>,
        point: Option<[f64; 3]>,
        distance: Option<f64>,
        material: Option<String>,
    },
    /// A text for people.
    Told { text: String },
    /// A job has started.
    Open { url: String },
}

/// The header of a picture.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct FrameHeader {
    /// The picture's number among those sent to this page.
    pub frame: u64,
    pub revision: u64,
    /// The page's last change included in it.
    pub seq: u64,
    pub step: usize,
    pub steps: usize,
    /// Passes in the average; 0 for a sketch.
    pub passes: u64,
    pub of: u64,
    pub width: u32,
    pub height: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_read_as_pages_write_them() {
        let read = |text: &str| serde_json::from_str::<FromPage>(text);
        let camera = read(r#"{"type":"camera","seq":7,"gesture":"g","origin":[1,2,3],"target":[0,0,0]}"#).unwrap();
        assert_eq!(camera.change(), Some((7, Some("g"))));
        let set = |value: &str| {
            let text = format!(r#"{{"type":"set","seq":1,"gesture":"g","path":"camera.fov","value":{value}}}"#);
            read(&text).unwrap()
        };
        assert!(set("40").is_outdone_by(&set("null")));
        assert!(!set("40").is_outdone_by(&camera));
        let written = |seq: u64| read(&format!(r#"{{"type":"written","seq":{seq}}}"#)).unwrap();
        assert_eq!(written(3).change(), Some((3, None)));
        assert!(written(3).is_outdone_by(&written(4)));
        assert!(read(r#"{"type":"rest"}"#).unwrap().change().is_none());
        for wrong in [
            r#"{"type":"set"}"#,
            r#"{"type":"no"}"#,
            "[]",
            r#"{"type":"pick","x":"a","y":0}"#,
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }

    /// Every number of every message, with the largest and smallest values.
    #[test]
    fn numbers_are_in_their_ranges() {
        let messages = [
            r#"{"type":"camera","seq":1,"gesture":"g","origin":[N,0,0],"target":[0,0,0]}"#,
            r#"{"type":"camera","seq":1,"gesture":"g","origin":[0,0,0],"target":[0,N,0]}"#,
            r#"{"type":"camera","seq":1,"gesture":"g","origin":[0,0,0],"target":[0,0,0],"up":[0,0,N]}"#,
            r#"{"type":"camera","seq":1,"gesture":"g","origin":[0,0,0],"target":[0,0,0],"fov":N}"#,
            r#"{"type":"set","seq":1,"gesture":"g","path":"a","value":N}"#,
            r#"{"type":"set","seq":1,"gesture":"g","path":"a","value":{"b":[0,N]}}"#,
            r#"{"type":"move","seq":1,"gesture":"g","thing":"a","by":[0,0,N]}"#,
            r#"{"type":"turn","seq":1,"gesture":"g","thing":"a","axis":[N,0,0],"angle":1}"#,
            r#"{"type":"turn","seq":1,"gesture":"g","thing":"a","axis":[1,0,0],"angle":N}"#,
            r#"{"type":"pick","x":N,"y":0}"#,
            r#"{"type":"pick","x":0,"y":N}"#,
            r#"{"type":"focus","seq":1,"x":N,"y":0}"#,
            r#"{"type":"focus","seq":1,"x":0,"y":N}"#,
            r#"{"type":"size","width":N}"#,
            r#"{"type":"drawn","frame":N}"#,
            r#"{"type":"undo","seq":N}"#,
        ];
        for message in messages {
            let read = |number: &str| FromPage::read(&message.replace('N', number));
            for wrong in ["1e39", "-1e39", "1e308", "-1e308", "1e999", "NaN", "Infinity", "[[", ""] {
                assert!(matches!(read(wrong), FromPage::Nonsense(_)), "{message}: {wrong}");
            }
            assert!(!matches!(read("0"), FromPage::Nonsense(_)), "{message}");
            let is_whole = ["size", "drawn", "undo"].iter().any(|kind| message.contains(kind));
            let small = read("5e-324");
            assert_eq!(matches!(small, FromPage::Nonsense(_)), is_whole, "{message}");
        }
        for (text, expected) in [("1", 64), ("4294967295", 8192), ("100", 100)] {
            let read = FromPage::read(&format!(r#"{{"type":"size","width":{text}}}"#));
            assert!(
                matches!(read, FromPage::Size { width } if width == expected),
                "{read:?}"
            );
        }
        let passes = FromPage::read(r#"{"type":"passes","passes":18446744073709551615}"#);
        assert!(matches!(passes, FromPage::Passes { passes: MAX_PASSES }));
        let nested = format!("{{\"type\":\"set\",\"value\":{}", "[".repeat(1 << 19));
        assert!(matches!(FromPage::read(&nested), FromPage::Nonsense(_)));
    }
}
