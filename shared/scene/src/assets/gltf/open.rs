//! The validated JSON of a glTF file, and the extensions it requires.

use super::left_out::{self, list};
use super::notes::Notes;
use super::record::Record;
use crate::assets::Flaw;
use crate::assets::mesh::BYTE_ORDER_MARK;
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::borrow::Cow;

/// An opened file.
pub struct Opened<'b> {
    pub document: gltf::Document,
    pub blob: Option<&'b [u8]>,
    pub record: Record,
    /// The textures that each material names.
    pub textures: Vec<Vec<usize>>,
    /// What was left out.
    pub notes: Notes,
}

/// Extensions that a file may require.
const UNDERSTOOD: [&str; 26] = [
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
];

const OLD: &str =
    "it is glTF 1.0, which is not read; expected 2.0. `gltf-pipeline -i in.gltf -o out.gltf` makes it 2.0";

/// Advice for an extension that packs data the image needs.
fn advice(extension: &str) -> &'static str {
    match extension {
        "EXT_texture_avif" => {
            ": its textures are in AVIF, which is not read. `gltf-transform png in.glb out.glb --formats avif` makes \
             PNG of them"
        }
        "MSFT_texture_dds" => ": its textures are in DDS, which is not read. Export it with PNG, JPEG or KTX2",
        "EXT_texture_video" => ": its textures move, which is not read",
        _ => "",
    }
}

/// Whether an extension only changes how materials look, so that a file can be read without it though it requires it.
fn is_of_looks(extension: &str) -> bool {
    let words = extension.split_once('_').map_or("", |(_, words)| words);
    words.starts_with("materials_")
}

/// Whether an extension is read, or has no effect on the image.
pub fn is_understood(extension: &str) -> bool {
    UNDERSTOOD.contains(&extension)
}

fn unusable(reason: &str) -> Flaw {
    let reason: String = reason.trim_end_matches(';').chars().take(200).collect();
    Flaw::from(format!("not a usable glTF file: {reason}"))
}

/// The parts of a file.
struct Parts<'b> {
    json: Cow<'b, [u8]>,
    /// The binary part, if the file has one.
    blob: Option<&'b [u8]>,
}

fn parts(bytes: &[u8]) -> Result<Parts<'_>, Flaw> {
    let is_binary = bytes.starts_with(b"glTF");
    match is_binary {
        true if bytes.get(4..8) == Some(&[1, 0, 0, 0]) => Err(OLD.into()),
        true => chunks(bytes),
        false => Ok(Parts {
            json: bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes).into(),
            blob: None,
        }),
    }
}

/// The parts of a GLB file: JSON, then binary data. Chunks of other kinds and bytes after the last chunk are ignored,
/// as the specification demands (GLB in glTF 2.0).
fn chunks(bytes: &[u8]) -> Result<Parts<'_>, Flaw> {
    let number = |at: usize| {
        let four = bytes.get(at..)?.first_chunk::<4>()?;
        usize::try_from(u32::from_le_bytes(*four)).ok()
    };
    // Magic number, version, total length.
    let length = number(8).filter(|length| *length >= 20);
    let length = length.ok_or_else(|| unusable("its header is too short"))?;
    if length > bytes.len() {
        return Err(unusable(&format!("it has {} bytes; {length} are claimed", bytes.len())));
    }
    // A chunk's kind and data.
    let chunk = |at: usize| {
        let kind = bytes.get(at + 4..at + 8)?;
        let end = (at + 8).checked_add(number(at)?).filter(|end| *end <= length)?;
        Some((kind, &bytes[at + 8..end]))
    };
    let (kind, json) = chunk(12).ok_or_else(|| unusable("its first chunk reaches beyond it"))?;
    if kind != b"JSON" {
        return Err(unusable("its first chunk is not JSON"));
    }
    let at = (20 + json.len()).next_multiple_of(4);
    let blob = match at + 8 <= length {
        false => None,
        true => Some(chunk(at).ok_or_else(|| unusable("its second chunk reaches beyond it"))?),
    };
    Ok(Parts {
        json: json.into(),
        blob: blob.filter(|(kind, _)| *kind == b"BIN\0").map(|(_, bytes)| bytes),
    })
}

/// Whether a file has animations. An unusable file has none.
pub fn is_animated(bytes: &[u8]) -> bool {
    let parts = parts(bytes).ok();
    let record = parts.and_then(|parts| serde_json::from_slice::<Record>(&parts.json).ok());
    record.is_some_and(|record| !record.animations.is_empty())
}

/// Read and validate the JSON. What the `gltf` crate's validation and accessors take for granted is checked first.
pub fn open(bytes: &[u8]) -> Result<Opened<'_>, Flaw> {
    let Parts { json: text, blob } = parts(bytes)?;
    let json = |e: serde_json::Error| unusable(&e.to_string());
    let mut text = serde_json::from_slice::<Value>(&text).map_err(json)?;
    let version = text.pointer("/asset/version").and_then(Value::as_str);
    let is_old = version.is_some_and(|version| version.starts_with("1.") || version.starts_with("0."));
    // Version 1 keys objects by name, later versions by number.
    if is_old || text.get("nodes").is_some_and(Value::is_object) {
        return Err(OLD.into());
    }
    let mut notes = Notes::default();
    if let Some(root) = text.as_object_mut() {
        left_out::primitives_without_positions(root, &mut notes);
        left_out::textures_without_images(root, &mut notes);
    }
    let record = Record::deserialize(&text).map_err(json)?;
    let mut required = record.extensions_required.iter();
    if let Some(name) = required.find(|name| !is_understood(name) && !is_of_looks(name)) {
        let advice = advice(name);
        return Err(format!("it says that it cannot do without {name}, which is not supported{advice}").into());
    }
    leave_out_what_is_not_read(&mut text);
    let textures = textures(&text);
    let json = gltf::json::Root::deserialize(text).map_err(json)?;
    for (i, mesh) in json.meshes.iter().enumerate() {
        let attributes = mesh.primitives.iter().flat_map(|p| p.attributes.values());
        let targets = mesh.primitives.iter().flat_map(|p| p.targets.iter().flatten());
        let moved = targets.flat_map(|t| t.positions.iter().chain(&t.normals).chain(&t.tangents));
        let mut named = attributes.chain(moved).map(|a| a.value());
        if let Some(accessor) = named.find(|a| *a >= json.accessors.len()) {
            return Err(unusable(&format!(
                "mesh {i} (from zero) names accessor {accessor}, but there are {}",
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
    Ok(Opened {
        document,
        blob,
        record,
        textures,
        notes,
    })
}

/// Remove what the `gltf` crate rejects, and add what it misses.
fn leave_out_what_is_not_read(text: &mut Value) {
    let Some(root) = text.as_object_mut() else { return };
    root.remove("extensionsRequired");
    // The pointers of KHR_animation_pointer have no node. The crate does not validate targets.
    let nodes = root.get("nodes").and_then(Value::as_array).map_or(0, Vec::len);
    let moves_a_node = |channel: &Value| {
        let node = channel.pointer("/target/node").and_then(Value::as_u64);
        let path = channel.pointer("/target/path").and_then(Value::as_str);
        node.is_some_and(|node| node < nodes as u64)
            && path.is_some_and(|path| ["translation", "rotation", "scale", "weights"].contains(&path))
    };
    for animation in list(root, "animations") {
        if let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) {
            channels.retain(moves_a_node);
        }
    }
    for scene in list(root, "scenes") {
        scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
    }
    // The accessor is all zeros: an empty sparse view passes validation.
    let none = json!({
        "count": 0,
        "indices": { "bufferView": 0, "componentType": 5121 },
        "values": { "bufferView": 0 },
    });
    for accessor in list(root, "accessors").filter(|accessor| is_bare(accessor)) {
        accessor.insert("sparse".into(), none.clone());
    }
    // Bounds of positions are not used here, and some files lack them.
    let positions: std::collections::BTreeSet<u64> = list(root, "meshes")
        .filter_map(|mesh| mesh.get("primitives")?.as_array())
        .flatten()
        .filter_map(|primitive| primitive.pointer("/attributes/POSITION")?.as_u64())
        .collect();
    for (i, accessor) in list(root, "accessors").enumerate() {
        if positions.contains(&(i as u64)) {
            for bound in ["min", "max"] {
                accessor.entry(bound).or_insert_with(|| json!([0, 0, 0]));
            }
        }
    }
}

/// Whether an accessor has no bytes.
fn is_bare(accessor: &Map<String, Value>) -> bool {
    !accessor.contains_key("bufferView") && !accessor.contains_key("sparse")
}

/// The textures that each material names, in extensions too.
fn textures(text: &Value) -> Vec<Vec<usize>> {
    let materials = text.get("materials").and_then(Value::as_array);
    let of = |material| {
        let mut found = Vec::new();
        find(material, &mut found);
        found
    };
    materials.into_iter().flatten().map(of).collect()
}

fn find(value: &Value, found: &mut Vec<usize>) {
    for (name, value) in value.as_object().into_iter().flatten() {
        // Occlusion textures are never read.
        if name.ends_with("Texture") && name != "occlusionTexture" {
            let index = value.get("index").and_then(Value::as_u64);
            found.extend(index.and_then(|index| usize::try_from(index).ok()));
        }
        find(value, found);
    }
}
