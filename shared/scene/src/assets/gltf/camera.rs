//! Cameras of a glTF file.

use super::node::{self, Placed};
use super::open::open;
use super::write::{number, vector};
use crate::assets::Flaw;
use glam::{DAffine3, DVec3};

/// The camera of that name, or the first one: `origin`, `target`, `up` and `fov`, as TOML.
pub fn camera(bytes: &[u8], wanted: Option<&str>, world_from_file: &DAffine3) -> Result<String, Flaw> {
    let opened = open(bytes)?;
    let placed = node::placed(&opened.document, world_from_file)?;
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
    let gltf::camera::Projection::Perspective(perspective) = camera.projection() else {
        return Err(format!("the camera {:?} is orthographic; expected a perspective one", node.name).into());
    };
    Ok(fields(node, f64::from(perspective.yfov())))
}

/// The nodes that are cameras.
pub fn cameras<'p, 'a>(placed: &'p [Placed<'a>]) -> impl Iterator<Item = (&'p Placed<'a>, gltf::Camera<'a>)> {
    placed.iter().filter_map(|node| Some((node, node.node.camera()?)))
}

/// A perspective camera's fields. `yfov`: radians.
pub fn fields(node: &Placed<'_>, yfov: f64) -> String {
    let place = &node.world_from_node;
    let direction = |v| place.transform_vector3(v).normalize_or_zero();
    format!(
        "origin = {}\ntarget = {}\nup = {}\nfov = {}\n",
        vector(place.translation),
        vector(place.translation + direction(DVec3::NEG_Z)),
        vector(direction(DVec3::Y)),
        number(yfov.to_degrees()),
    )
}
