//! What the page and the server of a live view say to each other over their WebSocket.
//!
//! Pictures go as binary messages: four bytes, little endian, with the length of a [`FrameHeader`] in JSON, the header,
//! and the bytes of a JPEG. Who asks for `/look?pixels=linear` gets the radiance in its place: R, G, B of each pixel as
//! 32-bit floats, little endian, rows from the top, for programs that have an exposure and a tone curve of their own.

use beamfarm_scene::desk::{Field, Thing};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// What a page says. `seq` counts its changes from one; those of one `gesture` are one step of undo.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum FromPage {
    /// The camera goes elsewhere, world space; `fov` as the scene file has it.
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
    /// A field gets a value; null takes it out.
    Set {
        seq: u64,
        gesture: String,
        path: String,
        value: Value,
    },
    /// A thing has been moved by so much since the gesture began, world space.
    Move {
        seq: u64,
        gesture: String,
        thing: String,
        by: [f64; 3],
    },
    /// A thing has been turned by so many degrees since the gesture began.
    Turn {
        seq: u64,
        gesture: String,
        thing: String,
        axis: [f64; 3],
        angle: f64,
    },
    /// Nothing more comes for now.
    Rest,
    /// What is there? From the upper left of the picture, 0 to 1.
    Pick { x: f64, y: f64 },
    /// Focus on what is there.
    Focus { seq: u64, x: f64, y: f64 },
    /// One step back.
    Undo { seq: u64 },
    /// And forth.
    Redo { seq: u64 },
    /// As it is on the disk.
    Revert { seq: u64 },
    /// The scene's files have just been written, all of them: nobody has to wait for the next look at the disk.
    Written { seq: u64 },
    /// Write the scene file.
    Save,
    /// Begin a job.
    Render,
    /// Open the scene file in an editor.
    Editor,
    /// Device pixels that the picture may be wide.
    Size { width: u32 },
    /// A picture is on the page.
    Drawn { frame: u64 },
    /// So many passes in all.
    Passes { passes: u64 },
}

impl FromPage {
    /// Its number, and its gesture if it is a part of one, of what changes the scene.
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

    /// Whether nothing is lost when this one is not heard, since `later` says all that it said.
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

/// The camera, for what is drawn over the picture.
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
    /// Of the image's middle, to the right and up, on the plane at distance one.
    pub shift: [f64; 2],
    pub flip_x: bool,
    pub aperture: f64,
    pub focus_distance: f64,
    /// Why it cannot be moved, if it cannot.
    pub fixed: Option<String>,
}

/// What a page is told.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ToPage {
    /// The scene as it is.
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
    /// A change cannot be; `seq` 0: one on the disk.
    Error {
        seq: u64,
        path: Option<String>,
        line: Option<usize>,
        message: String,
    },
    /// What was wrong is mended.
    Fine,
    /// What goes on.
    State {
        workers: usize,
        doing: &'static str,
        passes: u64,
        of: u64,
        error: Option<f64>,
        seconds: f64,
    },
    /// What was asked for by a click.
    Picked {
        thing: Option<String>,
        name: Option<String>,
        point: Option<[f64; 3]>,
        distance: Option<f64>,
        material: Option<String>,
    },
    /// For people.
    Told { text: String },
    /// A job has begun.
    Open { url: String },
}

/// What stands before a picture.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct FrameHeader {
    /// Which of all that this page was sent.
    pub frame: u64,
    pub revision: u64,
    /// The page's last change that is in it.
    pub seq: u64,
    pub step: usize,
    pub steps: usize,
    /// Of the true average; 0 for a sketch.
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
}
