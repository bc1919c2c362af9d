//! glTF 2.0, `.gltf` and `.glb`: its meshes, base materials, lights and cameras, as a piece of a scene file and the
//! meshes and pictures that it names. Whatever the piece says is checked as if an author had written it.

mod accessor;
mod material;
mod node;

use super::Flaw;
use super::mesh::RawMesh;
use accessor::Buffers;
use base64::Engine;
use beamfarm_render::texture::Image;
use glam::{DAffine3, DVec3};
use gltf::khr_lights_punctual::Kind;
use node::Placed;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::Arc;

/// What a glTF file becomes.
pub struct Piece {
    /// Materials, shapes and lights, as TOML.
    pub text: String,
    /// Meshes by the names that `text` calls them.
    pub meshes: BTreeMap<String, RawMesh>,
    /// Pictures by the names that `text` calls them.
    pub images: BTreeMap<String, Arc<Image>>,
}

/// What is taken from a file.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// Materials. Without them shapes have none, and do not emit.
    pub materials: bool,
    /// Lights.
    pub lights: bool,
}

/// Bytes of the files beside it, by their path from the glTF file's folder.
pub type Beside<'a> = dyn Fn(&str) -> Option<&'a [u8]> + 'a;

/// Read the JSON and validate it. What the `gltf` crate's validation and accessors take for granted is looked at
/// before.
fn open(bytes: &[u8]) -> Result<gltf::Gltf, Flaw> {
    let unusable = |reason: &str| {
        let reason: String = reason.trim_end_matches(';').chars().take(200).collect();
        Flaw::from(format!("not a usable glTF file: {reason}"))
    };
    // Magic number, version, and the length of all of it.
    let length = bytes.get(8..).and_then(|rest| rest.first_chunk());
    if bytes.starts_with(b"glTF") && length.is_none_or(|length| u32::from_le_bytes(*length) < 20) {
        return Err(unusable("its header is too short"));
    }
    let gltf = gltf::Gltf::from_slice_without_validation(bytes).map_err(|e| unusable(&e.to_string()))?;
    let gltf::Gltf { document, blob } = gltf;
    let json = document.into_json();
    for (i, mesh) in json.meshes.iter().enumerate() {
        let mut named = mesh.primitives.iter().flat_map(|p| p.attributes.values());
        if let Some(accessor) = named.find(|a| a.value() >= json.accessors.len()) {
            return Err(unusable(&format!(
                "mesh {i} (from zero) names accessor {}, but there are {}",
                accessor.value(),
                json.accessors.len()
            )));
        }
    }
    for (i, image) in json.images.iter().enumerate() {
        let lacks = match (&image.buffer_view, &image.uri, &image.mime_type) {
            (Some(_), _, None) => "mimeType",
            (None, None, _) => "uri",
            _ => continue,
        };
        return Err(unusable(&format!("image {i} (from zero) has no `{lacks}`")));
    }
    let document = gltf::Document::from_json(json).map_err(|e| unusable(&e.to_string()))?;
    Ok(gltf::Gltf { document, blob })
}

/// The files that a glTF file names, as paths from its folder.
pub fn files(bytes: &[u8]) -> Result<Vec<String>, Flaw> {
    let document = open(bytes)?.document;
    let buffers = document.buffers().filter_map(|buffer| match buffer.source() {
        gltf::buffer::Source::Uri(uri) => Some(uri),
        gltf::buffer::Source::Bin => None,
    });
    let images = document.images().filter_map(|image| match image.source() {
        gltf::image::Source::Uri { uri, .. } => Some(uri),
        gltf::image::Source::View { .. } => None,
    });
    let outside = |uri: &&str| !uri.starts_with("data:");
    buffers.chain(images).filter(outside).map(path_of).collect()
}

/// The path of a file that the glTF file at `path` names as `file`.
pub fn beside(path: &str, file: &str) -> String {
    match path.rsplit_once('/') {
        Some((folder, _)) if !file.starts_with('/') => format!("{folder}/{file}"),
        _ => file.to_string(),
    }
}

/// A URI's path, percent signs resolved.
fn path_of(uri: &str) -> Result<String, Flaw> {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        rest = tail;
        let hex = |digits: &[u8]| u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok();
        match tail {
            [a, b, after @ ..] if *first == b'%' => {
                let byte = hex(&[*a, *b]).ok_or_else(|| format!("{uri:?} is not a URI"))?;
                bytes.push(byte);
                rest = after;
            }
            _ => bytes.push(*first),
        }
    }
    String::from_utf8(bytes).map_err(|_| format!("{uri:?} is not a path").into())
}

/// The bytes that a URI stands for.
fn bytes_of(uri: &str, beside: &Beside<'_>) -> Result<Vec<u8>, Flaw> {
    if let Some(data) = uri.strip_prefix("data:") {
        let encoded = data.split_once(";base64,").map(|(_, encoded)| encoded);
        let decode = |text: &str| base64::engine::general_purpose::STANDARD.decode(text).ok();
        return encoded
            .and_then(decode)
            .ok_or_else(|| "a data URI is not base64".into());
    }
    let path = path_of(uri)?;
    match beside(&path) {
        Some(bytes) => Ok(bytes.to_vec()),
        None => Err(format!("the bundle lacks the file {path:?} that it names").into()),
    }
}

/// Read a glTF file called `name`. `world_from_file`: where the scene puts it.
pub fn read(
    name: &str,
    bytes: &[u8],
    beside: &Beside<'_>,
    world_from_file: &DAffine3,
    choice: Choice,
) -> Result<Piece, Flaw> {
    let gltf = open(bytes)?;
    let document = &gltf.document;
    let buffers = Buffers::new(document, gltf.blob.as_deref(), beside)?;
    let mut piece = Piece {
        text: String::new(),
        meshes: BTreeMap::new(),
        images: BTreeMap::new(),
    };
    let placed = node::placed(document, world_from_file)?;
    let mut materials = material::Materials::new(name, &buffers, beside);
    add_shapes(name, &placed, &buffers, choice, &mut materials, &mut piece)?;
    if choice.lights {
        for node in &placed {
            if let Some(light) = node.node.light() {
                add_light(&light, node, &mut piece.text);
            }
        }
    }
    materials.write(&mut piece)?;
    Ok(piece)
}

/// Shapes of all nodes: one for each primitive of a mesh, or instances where several nodes share it.
fn add_shapes<'a>(
    name: &str,
    placed: &[Placed<'a>],
    buffers: &Buffers,
    choice: Choice,
    materials: &mut material::Materials<'a, '_>,
    piece: &mut Piece,
) -> Result<(), Flaw> {
    let mut users: BTreeMap<usize, Vec<&Placed<'a>>> = BTreeMap::new();
    for node in placed {
        if let Some(mesh) = node.node.mesh() {
            users.entry(mesh.index()).or_default().push(node);
        }
    }
    for nodes in users.values() {
        let [first, ..] = &nodes[..] else { continue };
        let Some(mesh) = first.node.mesh() else {
            continue;
        };
        for primitive in mesh.primitives() {
            let in_mesh = |flaw: Flaw| {
                format!(
                    "the node {:?}: primitive {} of its mesh: {}",
                    first.name,
                    primitive.index(),
                    flaw.message
                )
            };
            let uv = material::uv(&primitive.material());
            let Some(raw) = accessor::mesh(&primitive, buffers, &uv).map_err(in_mesh)? else {
                continue;
            };
            let file = format!("{name}:mesh{}.{}", mesh.index(), primitive.index());
            let raw = raw.checked().map_err(in_mesh)?;
            piece.meshes.insert(file.clone(), raw);
            let mut surface = format!("type = \"mesh\", file = {}", quoted(&file));
            let mut own = format!("type = \"mesh\"\nfile = {}\n", quoted(&file));
            let mut emits = false;
            if choice.materials {
                let material = primitive.material();
                let id = materials.id(&material);
                let _ = write!(surface, ", material = \"{id}\"");
                let _ = writeln!(own, "material = \"{id}\"");
                if let Some([r, g, b]) = materials.emission(&material)? {
                    emits = true;
                    let _ = writeln!(own, "emission = {{ radiance = {} }}", vector(DVec3::new(r, g, b)));
                }
            }
            let several = mesh.primitives().len() > 1;
            let shape_name = |node: &Placed<'_>| match several {
                true => quoted(&format!("{} ({})", node.name, primitive.index())),
                false => quoted(&node.name),
            };
            let text = &mut piece.text;
            match nodes.len() > 1 && !emits {
                false => {
                    for node in nodes {
                        let _ = writeln!(
                            text,
                            "[[shapes]]\nname = {}\n{own}transform = [{}]",
                            shape_name(node),
                            matrix(&node.world_from_node),
                        );
                    }
                }
                true => {
                    let _ = writeln!(
                        text,
                        "[[shapes]]\nname = {}\ntype = \"instances\"\nshape = {{ {surface} }}\ntransforms = [",
                        shape_name(first)
                    );
                    for node in nodes {
                        let _ = writeln!(text, "  [{}],", matrix(&node.world_from_node));
                    }
                    text.push_str("]\n");
                }
            }
        }
    }
    Ok(())
}

/// KHR_lights_punctual. Its units are candela and lux; the numbers are taken for W/sr and W/m^2.
fn add_light(light: &gltf::khr_lights_punctual::Light<'_>, node: &Placed<'_>, text: &mut String) {
    let place = &node.world_from_node;
    let towards = place.transform_vector3(DVec3::NEG_Z).normalize_or_zero();
    let [r, g, b] = light
        .color()
        .map(|c| number(f64::from(c) * f64::from(light.intensity())));
    let strength = format!("[{r}, {g}, {b}]");
    let _ = writeln!(text, "[[lights]]\nname = {}", quoted(&node.name));
    let position = vector(place.translation);
    let _ = match light.kind() {
        Kind::Point => writeln!(text, "type = \"point\"\nposition = {position}\nintensity = {strength}"),
        Kind::Directional => writeln!(
            text,
            "type = \"directional\"\ndirection = {}\nirradiance = {strength}",
            vector(towards)
        ),
        Kind::Spot {
            inner_cone_angle,
            outer_cone_angle,
        } => {
            let [inner, outer] = [inner_cone_angle, outer_cone_angle].map(|a| f64::from(a).to_degrees());
            // A spot's edge is not infinitely sharp.
            let inner = inner.min(0.999 * outer);
            writeln!(
                text,
                "type = \"spot\"\nposition = {position}\ntarget = {}\nintensity = {strength}\ncutoff_angle = {}\n\
                 beam_width = {}",
                vector(place.translation + towards),
                number(outer),
                number(inner)
            )
        }
    };
}

/// The camera of that name, or the first one: `origin`, `target`, `up` and `fov`, as TOML.
pub fn camera(bytes: &[u8], wanted: Option<&str>, world_from_file: &DAffine3) -> Result<String, Flaw> {
    let gltf = open(bytes)?;
    let placed = node::placed(&gltf.document, world_from_file)?;
    let named = |node: &Placed<'_>, camera: &gltf::Camera<'_>| match wanted {
        Some(wanted) => node.name == wanted || camera.name() == Some(wanted),
        None => true,
    };
    let mut cameras = placed.iter().filter_map(|node| Some((node, node.node.camera()?)));
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
    let place = &node.world_from_node;
    let direction = |v| place.transform_vector3(v).normalize_or_zero();
    Ok(format!(
        "origin = {}\ntarget = {}\nup = {}\nfov = {}\n",
        vector(place.translation),
        vector(place.translation + direction(DVec3::NEG_Z)),
        vector(direction(DVec3::Y)),
        number(f64::from(perspective.yfov()).to_degrees()),
    ))
}

/// A name or path as a TOML string.
fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// A number as TOML writes it, every digit of it.
fn number(x: f64) -> String {
    match x.is_nan() {
        true => "nan".to_string(),
        false => format!("{x:?}"),
    }
}

fn vector(v: DVec3) -> String {
    format!("[{}, {}, {}]", number(v.x), number(v.y), number(v.z))
}

/// A transform's step.
fn matrix(map: &DAffine3) -> String {
    let m = map.matrix3;
    let row = |i: usize| {
        let entries = [m.x_axis[i], m.y_axis[i], m.z_axis[i], map.translation[i]];
        format!("[{}]", entries.map(number).join(", "))
    };
    format!("{{ matrix = [{}, {}, {}, [0, 0, 0, 1]] }}", row(0), row(1), row(2))
}
