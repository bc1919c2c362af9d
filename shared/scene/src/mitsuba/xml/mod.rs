//! Parses XML files into objects with properties.

mod cycles;
mod parameters;
mod read;
mod upgrade;

pub use read::read;

use super::FileLine;
use super::value::Value;
use std::cell::Cell;
use std::path::PathBuf;

/// The kinds of objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    Scene,
    Integrator,
    Sensor,
    Film,
    Filter,
    Sampler,
    Emitter,
    Shape,
    Bsdf,
    Texture,
    Medium,
    Phase,
    Volume,
}

impl Kind {
    fn of_tag(tag: &str) -> Option<Self> {
        Some(match tag {
            "scene" => Self::Scene,
            "integrator" => Self::Integrator,
            "sensor" => Self::Sensor,
            "film" => Self::Film,
            "rfilter" => Self::Filter,
            "sampler" => Self::Sampler,
            "emitter" => Self::Emitter,
            "shape" => Self::Shape,
            "bsdf" => Self::Bsdf,
            "texture" => Self::Texture,
            "medium" => Self::Medium,
            "phase" => Self::Phase,
            "volume" => Self::Volume,
            _ => return None,
        })
    }

    /// The tag name.
    pub fn tag(self) -> &'static str {
        match self {
            Self::Scene => "scene",
            Self::Integrator => "integrator",
            Self::Sensor => "sensor",
            Self::Film => "film",
            Self::Filter => "rfilter",
            Self::Sampler => "sampler",
            Self::Emitter => "emitter",
            Self::Shape => "shape",
            Self::Bsdf => "bsdf",
            Self::Texture => "texture",
            Self::Medium => "medium",
            Self::Phase => "phase",
            Self::Volume => "volume",
        }
    }
}

/// Index of an object.
pub type Id = usize;

/// An object: an element with a plugin.
#[derive(Debug)]
pub struct Object {
    pub kind: Kind,
    pub plugin: String,
    /// The id, if the file gives one.
    pub id: Option<String>,
    pub place: FileLine,
    pub members: Vec<Member>,
    /// Whether its file is of a version before 2, with different defaults.
    pub old: bool,
}

/// A property or a nested object.
#[derive(Debug)]
pub struct Member {
    /// `None` for objects without a name.
    pub name: Option<String>,
    pub place: FileLine,
    pub content: Content,
    /// Whether it was queried. A member that is never queried is not supported.
    pub used: Cell<bool>,
}

#[derive(Debug)]
pub enum Content {
    Value(Value),
    Object(Id),
}

/// All objects; the scene is the first.
#[derive(Debug)]
pub struct Objects {
    pub list: Vec<Object>,
    /// Each file's search folders, nearest first.
    folders: Vec<Vec<PathBuf>>,
}

impl Objects {
    /// The file that a path refers to: the first that exists, else the nearest candidate.
    pub fn resolve(&self, place: FileLine, written: &str) -> PathBuf {
        find(&self.folders[place.file], written)
    }
}

fn find(folders: &[PathBuf], written: &str) -> PathBuf {
    let candidates = || folders.iter().map(|folder| folder.join(written));
    candidates()
        .find(|path| path.exists())
        .or_else(|| candidates().next())
        .unwrap_or_else(|| PathBuf::from(written))
}
