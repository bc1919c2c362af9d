//! The camera's view, and changes to it.

use super::digits;
use super::set::{document, put, refuse_keys};
use crate::assemble;
use crate::disk::text_of;
use crate::error::SceneError;
use crate::files::{Files, Source};
use crate::made::located;
use crate::parse::{Extent, FovAxis, SceneRecord};
use crate::source;
use glam::DVec3;
use std::path::Path;
use toml_edit::{Item, TableLike, Value};

/// A new camera placement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraMove {
    /// Where it stands, world space.
    pub origin: [f64; 3],
    /// A point at the centre of the image.
    pub target: [f64; 3],
    /// Direction towards the top of the image; `None`: unchanged.
    pub up: Option<[f64; 3]>,
    /// Field of view, degrees, along the camera's axis; `None`: unchanged.
    pub fov: Option<f64>,
}

/// The camera's placement and field of view, from the scene or a glTF file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Where it stands, world space.
    pub origin: [f64; 3],
    /// A point at the centre of the image.
    pub target: [f64; 3],
    /// Direction towards the top of the image.
    pub up: [f64; 3],
    /// Field of view, degrees, and the side of the image that it spans: `x`, `y`, `smaller` or `larger`. `None`: the
    /// camera is orthographic or panoramic.
    pub fov: Option<(f64, &'static str)>,
}

/// Fields that refer to a glTF file's camera.
const FROM_GLTF: [&str; 2] = ["gltf", "gltf_camera"];
/// Digits to which positions are written, relative to the distance from origin to target.
const DIGITS: i32 = 6;

/// The view of a scene.
pub fn eye(files: &Files) -> Result<Eye, SceneError> {
    let file = Path::new(&files.scene);
    let bytes = files.files.get(&files.scene).map_or(&[][..], |file| file.bytes());
    let text = text_of(file, bytes)?;
    let record = SceneRecord::parse(text).map_err(|fault| source::locate(file, text, &fault))?;
    let eye = assemble::eye(&record, Source::Files(files)).map_err(|problem| located(file, text, problem))?;
    Ok(Eye {
        origin: eye.origin.0.to_array(),
        target: eye.target.get_ref().0.to_array(),
        up: eye.up.as_ref().map_or(DVec3::Y, |up| up.get_ref().0).to_array(),
        fov: match &eye.extent {
            Extent::Angle(fov, axis) => Some((*fov.get_ref(), word(*axis))),
            Extent::Width(_) | Extent::Panorama(_) => None,
        },
    })
}

fn word(axis: FovAxis) -> &'static str {
    match axis {
        FovAxis::X => "x",
        FovAxis::Y => "y",
        FovAxis::Smaller => "smaller",
        FovAxis::Larger => "larger",
    }
}

/// The text with the camera moved. A glTF file's camera becomes the scene's own; the move must then be complete, with
/// `up` and a vertical field of view.
pub fn camera(text: &str, to: CameraMove) -> Result<String, String> {
    let [origin, target] = [to.origin, to.target].map(DVec3::from);
    let distance = (target - origin).length();
    if !(origin.is_finite() && target.is_finite() && distance > 0.0) {
        return Err("a camera looks at a point other than where it stands".to_owned());
    }
    let angles = to.up.into_iter().flatten().chain(to.fov);
    if !angles.into_iter().all(f64::is_finite) {
        return Err("expected finite numbers as `up` and `fov`".to_owned());
    }
    let mut document = document(text)?;
    let camera = document.get_mut("camera").and_then(Item::as_table_like_mut);
    let camera = camera.ok_or("the scene has no camera")?;
    refuse_keys(camera)?;
    let is_gltf = FROM_GLTF.iter().any(|name| camera.contains_key(name));
    if is_gltf {
        if to.up.is_none() || to.fov.is_none() {
            return Err(
                "the camera is that of a glTF file: it goes elsewhere as a whole, with `up` and `fov`".to_owned(),
            );
        }
        make_own(camera);
    }
    if to.fov.is_some() && camera.contains_key("view_width") {
        return Err("the camera is orthographic: it has no field of view".to_owned());
    }
    let projection = camera.get("projection").and_then(Item::as_str);
    if to.fov.is_some() && projection.is_some_and(|name| name != "perspective") {
        return Err("the camera is a panoramic one: its field of view is changed in the scene's text".to_owned());
    }
    let place = |point: DVec3| digits::vector(digits::pointed(point, distance, DIGITS));
    put(camera, "origin", place(origin));
    put(camera, "target", place(target));
    if let Some(up) = to.up {
        let up = digits::direction(DVec3::from(up), DIGITS);
        if is_gltf || up != DVec3::Y || camera.contains_key("up") {
            put(camera, "up", digits::vector(up));
        }
    }
    if let Some(fov) = to.fov {
        put(camera, "fov", digits::value(digits::short(fov)));
    }
    if is_gltf {
        put(camera, "fov_axis", Value::from("y"));
    }
    Ok(document.to_string())
}

/// Remove the fields of a glTF file's camera; `origin` inherits their comments.
fn make_own(camera: &mut dyn TableLike) {
    let mut comments = None;
    for name in FROM_GLTF {
        let key = camera.key(name).map(|key| key.leaf_decor().clone());
        let value = camera.remove(name).and_then(|item| item.into_value().ok());
        if let (Some(key), Some(value), None) = (key, value, &comments) {
            comments = Some((key, value.decor().clone()));
        }
    }
    let Some((above, beside)) = comments else {
        return;
    };
    let mut placeholder = digits::vector(DVec3::ZERO);
    *placeholder.decor_mut() = beside;
    camera.insert("origin", Item::Value(placeholder));
    if let Some(mut key) = camera.key_mut("origin") {
        *key.leaf_decor_mut() = above;
    }
}
