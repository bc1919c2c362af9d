//! Moves and turns things by id.

use super::set::{document, refuse_keys};
use super::{digits, lights, shapes};
use crate::parse::SceneRecord;
use crate::place::Place;
use glam::DVec3;
use std::collections::BTreeSet;
use toml_edit::{DocumentMut, Item};

/// Significant digits of a distance from a pointer.
const DIGITS: i32 = 5;
/// Significant digits of an axis.
const AXIS_DIGITS: i32 = 7;
/// Decimals of degrees.
const DEGREES_DECIMALS: i32 = 3;

/// The thing that an id names.
enum Thing {
    Light(usize),
    /// The point that a spot shines at.
    Target(usize),
    Shape(usize),
    /// An instance: its shape's number and its own.
    Instance(usize, usize),
}

impl Thing {
    fn of(id: &str) -> Result<Self, String> {
        let names: Vec<&str> = id.split('.').collect();
        let number = |text: &str| {
            text.parse::<usize>()
                .map_err(|_| format!("there is nothing that is called {id}"))
        };
        match names[..] {
            ["lights", i] => Ok(Self::Light(number(i)?)),
            ["lights", i, "target"] => Ok(Self::Target(number(i)?)),
            ["shapes", i] => Ok(Self::Shape(number(i)?)),
            ["shapes", i, copy] => Ok(Self::Instance(number(i)?, number(copy)?)),
            ["gltf", ..] => Err("it comes from a glTF file, and stays where that says".to_owned()),
            _ => Err(format!("there is nothing that is called {id}")),
        }
    }
}

impl Thing {
    /// Refuse things moved by keyframes.
    fn refuse_keys(&self, root: &mut Item) -> Result<(), String> {
        let table = match self {
            Self::Light(i) | Self::Target(i) => format!("lights.{i}.type"),
            Self::Shape(i) | Self::Instance(i, _) => format!("shapes.{i}.type"),
        };
        match Place::find(root, &table) {
            Ok((place, _)) => refuse_keys(place.table()?),
            // Missing things are reported when they are looked up.
            Err(_) => Ok(()),
        }
    }
}

/// The things whose placement has keyframes.
pub fn keyed<'t>(text: &str, ids: impl Iterator<Item = &'t str>) -> BTreeSet<String> {
    let Ok(mut document) = document(text) else {
        return BTreeSet::new();
    };
    let root = document.as_item_mut();
    let is_keyed = |id: &&str| Thing::of(id).is_ok_and(|thing| thing.refuse_keys(root).is_err());
    ids.filter(is_keyed).map(str::to_owned).collect()
}

/// A text, parsed for editing and as a record.
fn read(text: &str) -> Result<(DocumentMut, SceneRecord), String> {
    let record = SceneRecord::parse(text).map_err(|fault| fault.message)?;
    Ok((document(text)?, record))
}

/// The text with a thing moved in world space. A light's target moves along. The error says why it cannot move.
pub fn translate(text: &str, thing: &str, by: [f64; 3]) -> Result<String, String> {
    let by = DVec3::from(by);
    let by = digits::pointed(by, by.length(), DIGITS);
    if !by.is_finite() {
        return Err("expected a finite distance".to_owned());
    }
    let (mut document, record) = read(text)?;
    let root = document.as_item_mut();
    Thing::of(thing)?.refuse_keys(root)?;
    match Thing::of(thing)? {
        Thing::Light(i) => lights::translate(root, &record, i, by, false)?,
        Thing::Target(i) => lights::translate(root, &record, i, by, true)?,
        Thing::Shape(i) => shapes::translate(root, &record, i, None, by)?,
        Thing::Instance(i, copy) => shapes::translate(root, &record, i, Some(copy), by)?,
    }
    Ok(document.to_string())
}

/// The text with a thing turned about its own centre, around a world-space axis by the right-hand rule. The error says
/// why it cannot turn.
pub fn turn(text: &str, thing: &str, axis: [f64; 3], degrees: f64) -> Result<String, String> {
    let axis = DVec3::from(axis)
        .try_normalize()
        .ok_or("expected an axis other than [0, 0, 0]")?;
    let axis = digits::direction(axis, AXIS_DIGITS);
    let degrees = match digits::short(degrees) {
        short if short == degrees => short,
        _ => digits::rounded(degrees, DEGREES_DECIMALS),
    };
    if !degrees.is_finite() {
        return Err("expected a finite angle".to_owned());
    }
    let (mut document, record) = read(text)?;
    let root = document.as_item_mut();
    Thing::of(thing)?.refuse_keys(root)?;
    match Thing::of(thing)? {
        Thing::Light(i) => lights::turn(root, &record, i, axis, degrees)?,
        Thing::Target(_) => return Err("a point looks the same from all sides".to_owned()),
        Thing::Shape(i) => shapes::turn(root, &record, i, None, axis, degrees)?,
        Thing::Instance(i, copy) => shapes::turn(root, &record, i, Some(copy), axis, degrees)?,
    }
    Ok(document.to_string())
}
