//! Cameras of a glTF file.

use super::node::{self, Placed};
use super::write::{number, vector};
use super::{Beside, There};
use crate::assets::Flaw;
use glam::DVec3;
use gltf::camera::{Orthographic, Projection};

/// The camera of that name, or the first one, as TOML: `origin`, `target`, `up` and `fov`.
pub fn camera<'b>(
    bytes: &'b [u8],
    beside: &Beside<'b>,
    wanted: Option<&str>,
    there: There<'_>,
) -> Result<String, Flaw> {
    let opened = there.open(bytes, beside)?.opened;
    let placed = node::placed(&opened.document, there.world_from_file)?;
    let named = |node: &Placed<'_>, camera: &gltf::Camera<'_>| match wanted {
        Some(wanted) => node.name == wanted || camera.name() == Some(wanted),
        None => true,
    };
    let mut cameras = cameras(&placed);
    let Some((node, camera)) = cameras.find(|(node, camera)| named(node, camera)) else {
        let known: Vec<String> = placed
            .iter()
            .filter(|node| node.node.camera().is_some())
            .take(12)
            .map(|node| format!("{:?}", node.name))
            .collect();
        let known = match known.is_empty() {
            true => "none".to_string(),
            false => known.join(", "),
        };
        let wanted = wanted.map_or(String::new(), |wanted| format!(" {wanted:?}"));
        return Err(format!("its scene has no camera{wanted}; it has {known}").into());
    };
    Ok(match camera.projection() {
        Projection::Perspective(perspective) => place(node) + &angle(f64::from(perspective.yfov())),
        Projection::Orthographic(orthographic) => place(node) + &width(&orthographic),
    })
}

/// The nodes with cameras.
pub fn cameras<'p, 'a>(placed: &'p [Placed<'a>]) -> impl Iterator<Item = (&'p Placed<'a>, gltf::Camera<'a>)> {
    placed.iter().filter_map(|node| Some((node, node.node.camera()?)))
}

/// The fields that place a camera.
pub fn place(node: &Placed<'_>) -> String {
    let place = &node.world_from_node;
    let direction = |v| place.transform_vector3(v).normalize_or_zero();
    format!(
        "origin = {}\ntarget = {}\nup = {}\n",
        vector(place.translation),
        vector(place.translation + direction(DVec3::NEG_Z)),
        vector(direction(DVec3::Y)),
    )
}

/// The field of view of a perspective camera. `yfov`: radians.
pub fn angle(yfov: f64) -> String {
    format!("fov = {}\n", number(yfov.to_degrees()))
}

/// The width of an orthographic camera, twice its magnification.
pub fn width(camera: &Orthographic<'_>) -> String {
    format!("view_width = {}\n", number(2.0 * f64::from(camera.xmag()).abs()))
}
