//! glTF 2.0, `.gltf` and `.glb`: converts meshes, materials, lights and cameras to a piece of a scene file, and the
//! meshes and images that it names. The piece is validated like a file that an author wrote.

mod accessor;
mod animation;
mod anisotropy;
mod bounds;
mod camera;
mod gloss;
mod left_out;
mod light;
mod lobes;
mod material;
mod mesh;
mod node;
mod notes;
mod open;
mod packed;
mod record;
mod scene;
mod shape;
mod texture;
mod through;
mod used;
mod write;
mod writer;

use super::Flaw;
use super::mesh::RawMesh;
use accessor::Buffers;
use animation::Moment;
use base64::Engine;
use beamfarm_render::world::texture::Image;
pub use camera::camera;
use glam::{DAffine3, DMat3};
pub use light::LightUnit;
use notes::Notes;
pub use open::is_animated;
use open::open;
use record::Record;
pub use scene::{Whole, scene};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;
use used::Used;
pub use write::{number, numbers, quoted};

/// What a glTF file becomes.
pub struct Piece {
    /// Materials, media, shapes and lights, as TOML.
    pub text: String,
    /// Meshes by their names in `text`.
    pub meshes: BTreeMap<String, RawMesh>,
    /// Images by their names in `text`.
    pub images: BTreeMap<String, Arc<Image>>,
    /// What is ignored or interpreted differently.
    pub notes: Vec<String>,
}

/// What to take from a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Choice {
    /// Whether to read materials. Without them shapes have none and do not emit.
    pub materials: bool,
    /// Whether to read lights.
    pub lights: bool,
    /// The unit of lights; `None`: the unit of the program that wrote the file.
    pub light_unit: Option<LightUnit>,
}

/// Reads the files next to the glTF file, by path relative to its folder.
pub type Beside<'a> = dyn Fn(&str) -> Option<&'a [u8]> + 'a;

/// The files that a glTF file names and needs, as paths relative to its folder.
pub fn files(bytes: &[u8]) -> Result<Vec<String>, Flaw> {
    let opened = open(bytes)?;
    let document = &opened.document;
    let used = Used::of(&opened);
    let buffers = document
        .buffers()
        .filter(|buffer| used.buffers.contains(&buffer.index()));
    let buffers = buffers.filter_map(|buffer| match buffer.source() {
        gltf::buffer::Source::Uri(uri) => Some(uri),
        gltf::buffer::Source::Bin => None,
    });
    let images = document.images().filter(|image| used.images.contains(&image.index()));
    let images = images.filter_map(|image| match image.source() {
        gltf::image::Source::Uri { uri, .. } => Some(uri),
        gltf::image::Source::View { .. } => None,
    });
    let outside = |uri: &&str| !uri.starts_with("data:");
    buffers.chain(images).filter(outside).map(path_of).collect()
}

/// The path of `file`, which the glTF file at `path` names.
pub fn beside(path: &str, file: &str) -> String {
    match path.rsplit_once('/') {
        Some((folder, _)) if !file.starts_with('/') => format!("{folder}/{file}"),
        _ => file.to_string(),
    }
}

/// The path in a URI, percent-decoded.
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
fn bytes_of<'b>(uri: &str, beside: &Beside<'b>) -> Result<Cow<'b, [u8]>, Flaw> {
    if let Some(data) = uri.strip_prefix("data:") {
        let encoded = data.split_once(";base64,").map(|(_, encoded)| encoded);
        let decode = |text: &str| base64::engine::general_purpose::STANDARD.decode(text).ok();
        return encoded
            .and_then(decode)
            .map(Cow::Owned)
            .ok_or_else(|| "a data URI is not base64".into());
    }
    let path = path_of(uri)?;
    match beside(&path) {
        Some(bytes) => Ok(bytes.into()),
        None => Err(format!("the bundle lacks the file {path:?} that it names").into()),
    }
}

/// Where a file is placed, and at which time.
#[derive(Clone, Copy, Debug)]
pub struct There<'m> {
    pub world_from_file: &'m DAffine3,
    /// Seconds since the start of its animations. `None`: nodes stay as written.
    pub seconds: Option<f64>,
}

impl There<'_> {
    fn open<'b>(&self, bytes: &'b [u8], beside: &Beside<'b>) -> Result<Moment<'b>, Flaw> {
        let opened = open(bytes)?;
        match self.seconds {
            Some(seconds) if opened.document.animations().len() > 0 => Moment::new(opened, beside, seconds),
            _ => Ok(Moment {
                opened,
                hidden: Vec::new(),
            }),
        }
    }
}

/// Read a glTF file called `name`.
pub fn read<'b>(
    name: &str,
    bytes: &'b [u8],
    beside: &Beside<'b>,
    there: There<'_>,
    choice: Choice,
) -> Result<Piece, Flaw> {
    let Moment { opened, hidden } = there.open(bytes, beside)?;
    let world_from_file = there.world_from_file;
    let document = &opened.document;
    let buffers = Buffers::new(document, opened.blob, beside)?;
    let mut notes = opened.notes;
    let placed = node::shown(document, node::placed(document, world_from_file)?, &buffers)?;
    let textures = texture::Textures::new(name, document, &buffers, beside);
    let mut shapes = shape::Shapes {
        file: name,
        buffers: &buffers,
        materials: choice.materials.then(|| {
            let scale = libm::cbrt(DMat3::determinant(&world_from_file.matrix3).abs());
            material::Materials::new(&opened.record, textures, scale)
        }),
        world_from_file,
        at_rest: node::placed(document, &DAffine3::IDENTITY)?,
        notes: &mut notes,
        text: String::new(),
        meshes: BTreeMap::new(),
    };
    shapes.add(&placed)?;
    let shape::Shapes {
        materials,
        mut text,
        meshes,
        ..
    } = shapes;
    let lights = placed.iter().filter_map(|node| Some((node, node.node.light()?)));
    let lights: Vec<_> = lights.filter(|_| choice.lights).collect();
    let generator = &opened.record.asset.generator;
    let unit = choice.light_unit.unwrap_or(LightUnit::of_generator(generator));
    for (node, light) in &lights {
        light::add_light(light, node, unit, &mut text);
    }
    if choice.light_unit.is_none() && unit == LightUnit::Lumen && !lights.is_empty() {
        notes.add(
            "Blender wrote it: its lights are taken for candela and lux, 683 to the watt. If it was exported with the \
             lighting mode \"Unitless\", say `light_unit = \"watt\"` in [[gltf]]",
        );
    }
    if choice.lights && LightUnit::of_generator(generator) == LightUnit::Lumen {
        notes.add("Blender wrote it, whose exporter leaves out the world's light and area lights");
    }
    note_the_rest(&opened.record, document, &mut notes);
    if !opened.record.animations.is_empty() && there.seconds.is_none() {
        notes.add("its animations do not play, since the scene has no [animation]: everything stands as its nodes say");
    }
    let mut channels = opened
        .record
        .animations
        .iter()
        .flat_map(|animation| &animation.channels);
    if there.seconds.is_some() && channels.any(|channel| channel.target.path == "pointer") {
        notes.add("what KHR_animation_pointer moves stays as it is");
    }
    for name in hidden {
        notes.add_of("animations that move what others move do not play", &name);
    }
    let mut images = BTreeMap::new();
    if let Some(materials) = materials {
        text.push_str(&materials.text);
        images = materials.textures.images;
    }
    Ok(Piece {
        text,
        meshes,
        images,
        notes: notes.lines(),
    })
}

/// Note what concerns no particular shape.
fn note_the_rest(record: &Record, document: &gltf::Document, notes: &mut Notes) {
    for name in &record.extensions_used {
        // Material extensions are noted with the materials.
        if !open::is_understood(name) && !name.starts_with("KHR_materials_") {
            notes.add(format!("{name} is not supported and does not count"));
        }
    }
    if document.scenes().len() > 1 {
        notes.add(format!(
            "it has {} scenes, of which its default one is taken",
            document.scenes().len()
        ));
    }
}

#[cfg(test)]
mod tests;
