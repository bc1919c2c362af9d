//! Removes what cannot be rendered before the rest of a glTF file is read, with a note on each.

use super::notes::Notes;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Texture extensions whose image formats are not read.
const UNREAD: [&str; 3] = ["EXT_texture_avif", "EXT_texture_video", "MSFT_texture_dds"];

pub fn list<'v>(root: &'v mut Map<String, Value>, name: &str) -> impl Iterator<Item = &'v mut Map<String, Value>> {
    let items = root.get_mut(name).and_then(Value::as_array_mut);
    items.into_iter().flatten().filter_map(Value::as_object_mut)
}

/// A thing's name, or its number if it has none.
fn name_of(thing: &Map<String, Value>, number: usize) -> String {
    let name = thing.get("name").and_then(Value::as_str);
    name.map_or_else(|| number.to_string(), |name| format!("{name:?}"))
}

/// Primitives without positions, of which by the specification nothing is drawn.
pub fn primitives_without_positions(root: &mut Map<String, Value>, notes: &mut Notes) {
    for (i, mesh) in list(root, "meshes").enumerate() {
        let name = name_of(mesh, i);
        let Some(primitives) = mesh.get_mut("primitives").and_then(Value::as_array_mut) else {
            continue;
        };
        let before = primitives.len();
        primitives.retain(|primitive| {
            let attributes = primitive.get("attributes").and_then(Value::as_object);
            attributes.is_none_or(|attributes| attributes.contains_key("POSITION"))
        });
        if primitives.len() < before {
            notes.add_of("primitives without POSITION are left out: of meshes", &name);
        }
    }
}

/// Remove textures without an image, and their uses in materials. A texture whose image is in an extension gets that
/// one.
pub fn textures_without_images(root: &mut Map<String, Value>, notes: &mut Notes) {
    let mut bare = BTreeMap::new();
    for (i, texture) in list(root, "textures").enumerate() {
        let others = texture.get("extensions").and_then(Value::as_object);
        let others: Vec<(&String, &Value)> = others.into_iter().flatten().collect();
        let known = others.iter().filter(|(name, _)| !UNREAD.contains(&name.as_str()));
        let instead = known.filter_map(|(_, one)| one.get("source")).next().cloned();
        let names: Vec<String> = others.iter().map(|(name, _)| (*name).clone()).collect();
        if let Some(instead) = instead {
            texture.entry("source").or_insert(instead);
        }
        if !texture.contains_key("source") {
            texture.insert("source".into(), json!(0));
            bare.insert(i as u64, names.join(", "));
        }
    }
    if bare.is_empty() {
        return;
    }
    for (i, material) in list(root, "materials").enumerate() {
        let mut named = BTreeSet::new();
        forget(material, &bare, &mut named);
        for texture in named {
            let by = match bare[&texture].as_str() {
                "" => String::new(),
                extensions => format!(", but for one by {extensions},"),
            };
            let note = format!("texture {texture} has no image{by} and is left out: of materials");
            notes.add_of(note, &name_of(material, i));
        }
    }
    // Without images, no texture is named any more.
    if list(root, "images").next().is_none() {
        root.remove("textures");
    }
}

/// Remove the uses of these textures from a material, and record them in `named`.
fn forget(object: &mut Map<String, Value>, textures: &BTreeMap<u64, String>, named: &mut BTreeSet<u64>) {
    object.retain(|name, value| {
        let index = value.get("index").and_then(Value::as_u64);
        match index.filter(|index| name.ends_with("Texture") && textures.contains_key(index)) {
            None => true,
            Some(index) => {
                // Occlusion textures are never read.
                if name != "occlusionTexture" {
                    named.insert(index);
                }
                false
            }
        }
    });
    for value in object.values_mut().filter_map(Value::as_object_mut) {
        forget(value, textures, named);
    }
}
