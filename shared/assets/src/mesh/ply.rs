//! PLY: ASCII, and binary in either byte order.

use super::RawMesh;
use super::ply_binary::{self, INDEX_NAMES};
use super::polygon::Runs;
use crate::Flaw;
use beamfarm_render::math::Rgb;
use glam::{DVec2, DVec3};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};
use std::io::ErrorKind;

/// Elements that give triangles.
const FACES: [&str; 2] = ["face", "tristrips"];

/// The value of negative indices, which no vertex has; strips end at it.
const NO_INDEX: u32 = u32::MAX;

/// Elements the library reads at a time.
const CHUNK: usize = 1 << 12;

/// Read a mesh: element `vertex` with x, y, z, optional normals, UVs and, if requested, colours; element `face` with a
/// list of vertex indices, or `tristrips`. Polygons are triangulated. Other elements and properties are skipped.
pub fn read(bytes: &[u8], colored: bool) -> Result<RawMesh, Flaw> {
    let mut reader = Reader::new(bytes);
    let header = Parser::<Element>::new()
        .read_header(&mut reader)
        .map_err(|e| flaw(&e, true))?;
    let text = header.encoding == Encoding::Ascii;
    let mut room = reader.get_ref().len() as u64;
    for element in header.elements.values() {
        let least = least_size(element, text).saturating_mul(element.count as u64);
        room = room.checked_sub(least).ok_or_else(|| {
            format!(
                "the file is too short for the {} `{}` elements it claims",
                element.count, element.name
            )
        })?;
    }
    if !FACES.iter().any(|name| header.elements.contains_key(*name)) {
        return Err("it has no faces, as clouds of points have none; expected an element `face` or `tristrips`".into());
    }
    let mut mesh = RawMesh::default();
    let mut runs = Runs::default();
    for element in header.elements.values() {
        match element.name.as_str() {
            "vertex" => {
                let has = |names: &[&str]| names.iter().all(|name| element.properties.contains_key(*name));
                if !has(&["x", "y", "z"]) {
                    return Err("the element `vertex` lacks x, y or z".into());
                }
                let colored = colored && COLOR_NAMES.iter().any(|names| has(names));
                let columns = [
                    has(&["nx", "ny", "nz"]),
                    UV_NAMES.iter().any(|names| has(names)),
                    colored,
                ];
                if ply_binary::vertices(reader.get_mut(), element, &header.encoding, columns, &mut mesh).is_some() {
                    continue;
                }
                check_types(element, &PLACE_NAMES, is_number, "a number")?;
                check_types(element, UV_NAMES.as_flattened(), is_number, "a number")?;
                if colored {
                    let names = COLOR_NAMES.as_flattened();
                    check_types(element, names, is_shade, "float, double or uchar")?;
                }
                let [has_normals, has_uvs, _] = columns;
                read_elements(&mut reader, element, &header, &mut |vertex| {
                    mesh.positions.push(vertex.position);
                    if has_normals {
                        mesh.normals.push(vertex.normal);
                    }
                    if has_uvs {
                        mesh.uvs.push(vertex.uv);
                    }
                    if colored {
                        mesh.colors.push(vertex.color);
                    }
                })?;
            }
            name @ ("face" | "tristrips") => {
                if !INDEX_NAMES.iter().any(|name| element.properties.contains_key(*name)) {
                    return Err(format!("the element `{name}` lacks the list `vertex_indices`").into());
                }
                let is_face = name == "face";
                if is_face && let Some(faces) = ply_binary::faces(reader.get_mut(), element, &header.encoding) {
                    runs.extend(&faces.runs.0, mesh.triangles.len());
                    mesh.triangles.extend(faces.triangles);
                    continue;
                }
                check_types(element, &INDEX_NAMES, is_list_of_indices, "a list of whole numbers")?;
                read_elements(&mut reader, element, &header, &mut |face| {
                    let corners = &face.indices;
                    if !is_face {
                        return corners
                            .split(|v| *v == NO_INDEX)
                            .for_each(|strip| add_strip(&mut mesh, strip));
                    }
                    runs.add(mesh.triangles.len(), corners.len().saturating_sub(2));
                    for i in 2..corners.len() {
                        mesh.triangles.push([corners[0], corners[i - 1], corners[i]]);
                    }
                })?;
            }
            _ => read_elements(&mut reader, element, &header, &mut |_| ())?,
        }
    }
    // Vertices may follow the faces.
    mesh.cut(&runs)?;
    Ok(mesh)
}

/// Each vertex forms a triangle with the two before it, every second one reversed. Triangles that name a vertex twice
/// join strips and are dropped.
fn add_strip(mesh: &mut RawMesh, strip: &[u32]) {
    let triangles = strip.windows(3).enumerate().map(|(i, t)| match i % 2 {
        0 => [t[0], t[1], t[2]],
        _ => [t[1], t[0], t[2]],
    });
    let has_area = |[a, b, c]: &[u32; 3]| a != b && b != c && a != c;
    mesh.triangles.extend(triangles.filter(has_area));
}

/// Pass the elements of one kind to `take`, one by one.
fn read_elements(
    reader: &mut Reader<&[u8]>,
    element: &ElementDef,
    header: &Header,
    take: &mut dyn FnMut(Element),
) -> Result<(), Flaw> {
    let failed = |e: ParseError| {
        let mut flaw = flaw(&e, header.encoding == Encoding::Ascii);
        if e.kind() == ErrorKind::UnexpectedEof {
            // The library's count is that of one chunk.
            let what = flaw.message.split(" (expected").next().unwrap_or_default();
            flaw.message = format!("{what}; expected {} of them", element.count);
        }
        flaw
    };
    let mut part = element.clone();
    let mut left = element.count;
    while left > 0 {
        part.count = left.min(CHUNK);
        left -= part.count;
        let read = Parser::<Element>::new().read_payload_for_element(reader, &part, header);
        read.map_err(failed)?.into_iter().for_each(&mut *take);
    }
    Ok(())
}

/// Check that the named properties have suitable types.
fn check_types(
    element: &ElementDef,
    names: &[&str],
    fits: fn(&PropertyType) -> bool,
    expected: &str,
) -> Result<(), Flaw> {
    let mut named = element.properties.values().filter(|p| names.contains(&p.name.as_str()));
    match named.find(|property| !fits(&property.data_type)) {
        Some(property) => Err(format!(
            "the property `{}` of the element `{}` has the type {:?}; expected {expected}",
            property.name, element.name, property.data_type
        )
        .into()),
        None => Ok(()),
    }
}

fn is_number(kind: &PropertyType) -> bool {
    matches!(kind, PropertyType::Scalar(_))
}

fn is_shade(kind: &PropertyType) -> bool {
    use ScalarType::{Double, Float, UChar};
    matches!(kind, PropertyType::Scalar(Float | Double | UChar))
}

fn is_list_of_indices(kind: &PropertyType) -> bool {
    use ScalarType::{Double, Float};
    matches!(kind, PropertyType::List(_, kind) if !matches!(kind, Double | Float))
}

const PLACE_NAMES: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];
const UV_NAMES: [[&str; 2]; 4] = [
    ["u", "v"],
    ["s", "t"],
    ["texture_u", "texture_v"],
    ["texture_s", "texture_t"],
];
const COLOR_NAMES: [[&str; 3]; 2] = [["red", "green", "blue"], ["r", "g", "b"]];

fn flaw(error: &ParseError, has_lines: bool) -> Flaw {
    let text = error.to_string();
    let text = match (error.line(), text.split_once(": ")) {
        (Some(_), Some((_, rest))) => rest.to_string(),
        _ => text,
    };
    // The messages quote the whole line and end with the cause.
    let first = text.lines().next().unwrap_or_default();
    let message = match text.rsplit_once("Error: ") {
        Some((_, cause)) => format!("{first} {}", cause.trim()),
        None => first.to_string(),
    };
    Flaw {
        line: error.line().filter(|_| has_lines),
        message,
    }
}

/// The fewest bytes an element can take, so that a count is accepted only if its elements fit in the file.
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
    // An element without properties would take no bytes and could be claimed any number of times.
    sizes.sum::<u64>().max(1)
}

/// A vertex, a face, or anything else. One type, since the library's generic reader would be compiled for each.
struct Element {
    position: DVec3,
    normal: DVec3,
    uv: DVec2,
    color: Rgb,
    indices: Vec<u32>,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self {
            position: DVec3::ZERO,
            normal: DVec3::ZERO,
            uv: DVec2::ZERO,
            color: Rgb::ZERO,
            indices: Vec::new(),
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
            "red" | "r" => return set(&mut self.color.x, shade(&value)),
            "green" | "g" => return set(&mut self.color.y, shade(&value)),
            "blue" | "b" => return set(&mut self.color.z, shade(&value)),
            _ if INDEX_NAMES.contains(&name) => return set(&mut self.indices, indices(value)),
            _ => return PropertyAccessResult::Ignored,
        };
        set(target, number(&value))
    }
}

/// Bad types were refused earlier, or belong to an element whose value is not used.
fn set<T>(target: &mut T, value: Option<T>) -> PropertyAccessResult {
    match value {
        Some(value) => {
            *target = value;
            PropertyAccessResult::Set
        }
        None => PropertyAccessResult::Ignored,
    }
}

fn number(value: &Property) -> Option<f64> {
    Some(match value {
        Property::Float(x) => (*x).into(),
        Property::Double(x) => *x,
        Property::Char(x) => (*x).into(),
        Property::UChar(x) => (*x).into(),
        Property::Short(x) => (*x).into(),
        Property::UShort(x) => (*x).into(),
        Property::Int(x) => (*x).into(),
        Property::UInt(x) => (*x).into(),
        _ => return None,
    })
}

/// A colour component.
fn shade(value: &Property) -> Option<f32> {
    match value {
        Property::Float(x) => Some(*x),
        Property::Double(x) => Some(*x as f32),
        Property::UChar(x) => Some(ply_binary::linear(*x)),
        _ => None,
    }
}

fn indices(value: Property) -> Option<Vec<u32>> {
    let index = |i: i64| u32::try_from(i).unwrap_or(NO_INDEX);
    Some(match value {
        Property::ListInt(list) => list.into_iter().map(|i| index(i.into())).collect(),
        Property::ListUInt(list) => list,
        Property::ListShort(list) => list.into_iter().map(|i| index(i.into())).collect(),
        Property::ListUShort(list) => list.into_iter().map(u32::from).collect(),
        Property::ListChar(list) => list.into_iter().map(|i| index(i.into())).collect(),
        Property::ListUChar(list) => list.into_iter().map(u32::from).collect(),
        _ => return None,
    })
}

#[cfg(test)]
mod tests;
