//! PLY: ASCII and binary of either byte order.

use super::Flaw;
use super::mesh::RawMesh;
use glam::{DVec2, DVec3};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    DefaultElement, ElementDef, Encoding, Property, PropertyAccess, PropertyAccessResult,
    PropertyType, ScalarType,
};

/// Read a mesh: element `vertex` with x, y, z, optional normals and UVs, element `face` with a list of vertex indices.
/// Polygons become fans of triangles. Other elements and properties are skipped.
pub fn read(bytes: &[u8]) -> Result<RawMesh, Flaw> {
    let mut reader = Reader::new(bytes);
    let header = Parser::<DefaultElement>::new()
        .read_header(&mut reader)
        .map_err(|e| flaw(&e, true))?;
    let text = header.encoding == Encoding::Ascii;
    let mut room = reader.get_ref().len() as u64;
    for element in header.elements.values() {
        let least = least_size(element, text) * element.count as u64;
        room = room.checked_sub(least).ok_or_else(|| {
            format!(
                "the file is too short for the {} `{}` elements it claims",
                element.count, element.name
            )
        })?;
    }
    let mut mesh = RawMesh::default();
    for element in header.elements.values() {
        let place = |e: ParseError| flaw(&e, text);
        match element.name.as_str() {
            "vertex" => {
                let has = |names: &[&str]| {
                    names
                        .iter()
                        .all(|name| element.properties.contains_key(*name))
                };
                if !has(&["x", "y", "z"]) {
                    return Err("the element `vertex` lacks x, y or z".into());
                }
                let vertices = Parser::<Vertex>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(place)?;
                mesh.positions = vertices.iter().map(|v| v.position).collect();
                if has(&["nx", "ny", "nz"]) {
                    mesh.normals = vertices.iter().map(|v| v.normal).collect();
                }
                if UV_NAMES.iter().any(|names| has(names)) {
                    mesh.uvs = vertices.iter().map(|v| v.uv).collect();
                }
            }
            "face" => {
                if !INDEX_NAMES
                    .iter()
                    .any(|name| element.properties.contains_key(*name))
                {
                    return Err("the element `face` lacks the list `vertex_indices`".into());
                }
                let faces = Parser::<Face>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(place)?;
                for face in &faces {
                    for i in 2..face.0.len() {
                        mesh.triangles.push([face.0[0], face.0[i - 1], face.0[i]]);
                    }
                }
            }
            _ => {
                Parser::<Skipped>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(place)?;
            }
        }
    }
    Ok(mesh)
}

const UV_NAMES: [[&str; 2]; 4] = [
    ["u", "v"],
    ["s", "t"],
    ["texture_u", "texture_v"],
    ["texture_s", "texture_t"],
];
const INDEX_NAMES: [&str; 2] = ["vertex_indices", "vertex_index"];

fn flaw(error: &ParseError, has_lines: bool) -> Flaw {
    let text = error.to_string();
    let text = match (error.line(), text.split_once(": ")) {
        (Some(_), Some((_, rest))) => rest.to_string(),
        _ => text,
    };
    let lines: Vec<&str> = text
        .lines()
        .map(str::trim)
        .filter(|l| !l.is_empty())
        .take(2)
        .collect();
    Flaw {
        line: error.line().filter(|_| has_lines),
        message: lines.join(" "),
    }
}

/// The fewest bytes that one element can take, so that a count is believed only if its elements fit the file.
fn least_size(element: &ElementDef, text: bool) -> u64 {
    let size = |scalar: &ScalarType| match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    };
    let sizes = element.properties.values().map(|p| match &p.data_type {
        _ if text => 1,
        PropertyType::Scalar(scalar) | PropertyType::List(scalar, _) => size(scalar),
    });
    // An element without properties would take no bytes, and any number of them could be claimed.
    sizes.sum::<u64>().max(1)
}

struct Vertex {
    position: DVec3,
    normal: DVec3,
    uv: DVec2,
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self {
            position: DVec3::ZERO,
            normal: DVec3::ZERO,
            uv: DVec2::ZERO,
        }
    }
    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let target = match name {
            "x" => &mut self.position.x,
            "y" => &mut self.position.y,
            "z" => &mut self.position.z,
            "nx" => &mut self.normal.x,
            "ny" => &mut self.normal.y,
            "nz" => &mut self.normal.z,
            "u" | "s" | "texture_u" | "texture_s" => &mut self.uv.x,
            "v" | "t" | "texture_v" | "texture_t" => &mut self.uv.y,
            _ => return PropertyAccessResult::Ignored,
        };
        *target = match value {
            Property::Float(x) => x.into(),
            Property::Double(x) => x,
            Property::Char(x) => x.into(),
            Property::UChar(x) => x.into(),
            Property::Short(x) => x.into(),
            Property::UShort(x) => x.into(),
            Property::Int(x) => x.into(),
            Property::UInt(x) => x.into(),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

struct Face(Vec<u32>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self(Vec::new())
    }
    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        if !INDEX_NAMES.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        // A negative index becomes one that no vertex has.
        let index = |i: i64| u32::try_from(i).unwrap_or(u32::MAX);
        self.0 = match value {
            Property::ListInt(list) => list.into_iter().map(|i| index(i.into())).collect(),
            Property::ListUInt(list) => list,
            Property::ListShort(list) => list.into_iter().map(|i| index(i.into())).collect(),
            Property::ListUShort(list) => list.into_iter().map(u32::from).collect(),
            Property::ListChar(list) => list.into_iter().map(|i| index(i.into())).collect(),
            Property::ListUChar(list) => list.into_iter().map(u32::from).collect(),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}
