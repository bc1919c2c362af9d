//! A whole scene made from a glTF file. A file without a camera gets one that sees everything, a file without lights
//! gets light.

use super::Beside;
use super::accessor::Buffers;
use super::animation::{self, Moment};
use super::camera::{angle, cameras, place, width};
use super::mesh::{PLAIN, Pose, mesh};
use super::node::{self, Placed};
use super::notes::Notes;
use super::open::{Opened, open};
use super::write::{number, quoted, vector};
use crate::assets::Flaw;
use crate::time::FPS;
use glam::{DAffine3, DVec3};
use gltf::camera::Projection;
use std::fmt::Write;

/// Pixels along the longer side of the image.
const LONGER_SIDE: f64 = 960.0;
/// Aspect ratio, width over height, of a camera that gives none.
const ASPECT: f64 = 16.0 / 9.0;
/// Width and height of the image when the camera is made up.
const SIZE: [u32; 2] = [960, 720];
/// Vertical field of view of a made-up camera, degrees.
const FOV: f64 = 35.0;
/// How much of the image the model then fills.
const FILLED: f64 = 0.9;
/// Direction from the model's centre to a made-up camera: in front, a little to the right and above.
const FROM: DVec3 = DVec3::new(0.6, 0.45, 1.0);
/// Light for a file without lights: radiance from all around, and irradiance from above the camera's left. White
/// surfaces that face it have a radiance of 1.
const AROUND: f64 = 0.4;
const KEY: f64 = 0.6 * std::f64::consts::PI;

/// A scene as TOML.
pub struct Whole {
    pub text: String,
    /// What was made up or left out.
    pub notes: Vec<String>,
}

/// The scene that names the glTF file `file`.
pub fn scene<'b>(file: &str, bytes: &'b [u8], beside: &Beside<'b>) -> Result<Whole, Flaw> {
    let mut opened = open(bytes)?;
    let mut notes = Notes::default();
    let buffers = Buffers::new(&opened.document, opened.blob, beside)?;
    let mut animation = String::new();
    if let Some([first, last]) = animation::span(&opened.document, &buffers)? {
        let frames = [(first * FPS).floor(), (last * FPS).ceil()];
        let [first, last] = frames.map(|frame| frame as i64);
        animation = format!("\n[animation]\nframes = [{first}, {last}]\n");
        notes.add(format!(
            "it moves, in frames {first} to {last}, {FPS} of them a second; what is shown is the first"
        ));
        let seconds = frames[0] / FPS;
        opened = Moment::new(opened, beside, seconds)?.opened;
    }
    let placed = node::placed(&opened.document, &DAffine3::IDENTITY)?;
    let placed = node::shown(&opened.document, placed, &buffers)?;
    let view = match own_view(&placed, &mut notes) {
        Some(view) => view,
        None => {
            notes.add("it is looked at from in front, all of it, since it has no camera");
            Shot::of_all(corners(&placed, &buffers)?)
        }
    };
    let [width, height] = view.size;
    let file = quoted(file);
    let mut text = format!(
        "[image]\nwidth = {width}\nheight = {height}\n\n[camera]\n{}{animation}\n[[gltf]]\nfile = {file}\n",
        view.fields
    );
    let has_lights = placed.iter().any(|node| node.node.light().is_some());
    let glows = glows(&opened, &placed);
    if !has_lights && glows {
        notes.add(
            "it has no lights but surfaces that emit, and is lit by those alone; a scene that names it, as `beamfarm \
             convert` writes it, may have others",
        );
    }
    if !has_lights && !glows {
        notes.add(
            "it has no lights: it is lit by a grey environment, and from above the camera's left (`lights.0` and \
             `lights.1` of its scene)",
        );
        let _ = write!(
            text,
            "\n[[lights]]\nname = \"around\"\ntype = \"environment\"\nradiance = {}\n\n[[lights]]\nname = \"key\"\n\
             type = \"directional\"\ndirection = {}\nirradiance = {}\n",
            number(AROUND),
            vector(view.key),
            number(KEY)
        );
    }
    Ok(Whole {
        text,
        notes: notes.lines(),
    })
}

/// A camera's fields as TOML, the image size, and the direction of light from above its left.
struct Shot {
    fields: String,
    size: [u32; 2],
    key: DVec3,
}

/// The direction of light that comes from above the camera's left.
fn key(right: DVec3, up: DVec3, back: DVec3) -> DVec3 {
    (right * 0.6 - up - back * 0.7).normalize_or(DVec3::NEG_Y)
}

/// The view of the file's first camera.
fn own_view(placed: &[Placed<'_>], notes: &mut Notes) -> Option<Shot> {
    let mut found: Vec<Shot> = Vec::new();
    for (node, camera) in cameras(placed) {
        let (aspect, extent) = match camera.projection() {
            Projection::Perspective(perspective) => {
                let aspect = perspective.aspect_ratio().map_or(ASPECT, f64::from);
                let extent = angle(f64::from(perspective.yfov()));
                (aspect, format!("{extent}fov_axis = \"y\"\n"))
            }
            Projection::Orthographic(orthographic) => {
                let aspect = f64::from(orthographic.xmag()) / f64::from(orthographic.ymag());
                let extent = width(&orthographic);
                (aspect.abs(), format!("projection = \"orthographic\"\n{extent}"))
            }
        };
        let aspect = if aspect > 0.0 && aspect.is_finite() {
            aspect
        } else {
            ASPECT
        };
        let pixels = |share: f64| ((LONGER_SIDE * share).round() as u32).max(1);
        let world_from_node = &node.world_from_node;
        let direction = |v| world_from_node.transform_vector3(v).normalize_or_zero();
        found.push(Shot {
            fields: place(node) + &extent,
            size: [pixels(aspect.min(1.0)), pixels(aspect.recip().min(1.0))],
            key: key(direction(DVec3::X), direction(DVec3::Y), direction(DVec3::Z)),
        });
    }
    if found.len() > 1 {
        notes.add(format!("it has {} cameras, of which the first is taken", found.len()));
    }
    found.into_iter().next()
}

impl Shot {
    /// A view of the whole box.
    fn of_all(corners: Option<[DVec3; 2]>) -> Self {
        let [low, high] = corners.unwrap_or([DVec3::NEG_ONE, DVec3::ONE]);
        let middle = 0.5 * low + 0.5 * high;
        let half = (0.5 * (high - low)).max(DVec3::splat(1e-9));
        let back = FROM.normalize();
        let right = DVec3::Y.cross(back).normalize();
        let up = back.cross(right);
        let [width, height] = SIZE.map(f64::from);
        let tan_y = libm::tan(0.5 * FOV.to_radians()) * FILLED;
        let tan_x = tan_y * width / height;
        // Far enough that every corner is in view.
        let mut distance = 0.0f64;
        for i in 0..8 {
            let sign = |bit: u32| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
            let corner = half * DVec3::new(sign(0), sign(1), sign(2));
            let needed = (corner.dot(right).abs() / tan_x).max(corner.dot(up).abs() / tan_y);
            distance = distance.max(needed + corner.dot(back));
        }
        Self {
            fields: format!(
                "origin = {}\ntarget = {}\nup = [0.0, 1.0, 0.0]\nfov = {}\nfov_axis = \"y\"\n",
                vector(middle + back * distance),
                vector(middle),
                number(FOV)
            ),
            size: SIZE,
            key: key(right, up, back),
        }
    }
}

/// The bounding box of all triangles.
fn corners(placed: &[Placed<'_>], buffers: &Buffers<'_>) -> Result<Option<[DVec3; 2]>, Flaw> {
    let mut corners: Option<[DVec3; 2]> = None;
    for node in placed {
        let Some(there) = node.node.mesh() else { continue };
        let pose = Pose::at_rest(&node.node, placed, buffers)?;
        let place = match pose.joints {
            Some(_) => DAffine3::IDENTITY,
            None => node.world_from_node,
        };
        for primitive in there.primitives() {
            let in_node = |flaw: Flaw| format!("the node {:?}: {}", node.name, flaw.message);
            let Some(raw) = mesh(&primitive, buffers, &PLAIN, &pose).map_err(in_node)? else {
                continue;
            };
            for position in &raw.positions {
                let at = place.transform_point3(*position);
                let [low, high] = corners.unwrap_or([at, at]);
                corners = Some([low.min(at), high.max(at)]);
            }
        }
    }
    Ok(corners.filter(|corners| corners.iter().all(|corner| corner.is_finite())))
}

/// Whether surfaces light the scene. Parts that glow by a texture do not count.
fn glows(opened: &Opened, placed: &[Placed<'_>]) -> bool {
    let glows = |primitive: gltf::Primitive<'_>| {
        let material = primitive
            .material()
            .index()
            .and_then(|i| opened.record.materials.get(i));
        // Unlit surfaces emit towards the camera alone.
        material.is_some_and(|m| {
            m.emissive_texture.is_none() && m.emissive_factor != [0.0; 3] && m.extensions.unlit.is_none()
        })
    };
    placed.iter().any(|node| {
        let meshes = node.node.mesh().into_iter();
        meshes.flat_map(|mesh| mesh.primitives()).any(glows)
    })
}
