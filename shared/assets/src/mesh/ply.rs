//! PLY: ASCII and binary of either byte order.

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

/// Elements that make triangles.
const FACES: [&str; 2] = ["face", "tristrips"];

/// What negative indices become: no vertex has it, and strips end at it.
const NO_INDEX: u32 = u32::MAX;

/// Elements that the library reads at once.
const CHUNK: usize = 1 << 12;

/// Read a mesh: element `vertex` with x, y, z, optional normals, UVs and, if they are asked for, colours, element
/// `face` with a list of vertex indices, or `tristrips`.
/// Polygons become triangles. Other elements and properties are skipped.
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
    mesh.cut(&runs);
    Ok(mesh)
}

/// Each vertex makes a triangle with the two before it, every second one the other way around. Those that name one
/// vertex twice join strips.
fn add_strip(mesh: &mut RawMesh, strip: &[u32]) {
    let triangles = strip.windows(3).enumerate().map(|(i, t)| match i % 2 {
        0 => [t[0], t[1], t[2]],
        _ => [t[1], t[0], t[2]],
    });
    let has_area = |[a, b, c]: &[u32; 3]| a != b && b != c && a != c;
    mesh.triangles.extend(triangles.filter(has_area));
}

/// Give the elements of one kind to `take`, one after the other.
fn read_elements(
    reader: &mut Reader<&[u8]>,
    element: &ElementDef,
    header: &Header,
    take: &mut dyn FnMut(Element),
) -> Result<(), Flaw> {
    let failed = |e: ParseError| {
        let mut flaw = flaw(&e, header.encoding == Encoding::Ascii);
        if e.kind() == ErrorKind::UnexpectedEof {
            // The library counts those of a part.
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

/// Whether the properties of these names are of types that fit.
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
    // The messages quote the line at length, then end with the cause.
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

/// A vertex, a face, or anything else: one type, since the library's reader is compiled anew for each.
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

/// Types that do not fit were refused, or the element is one of which this is not looked at.
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

/// A part of a colour.
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
mod tests {
    use super::*;
    use crate::image::linear_from_srgb;
    use crate::mesh::RawMesh;

    const HEADER: &str = "comment a square\nelement vertex 4\nproperty float x\nproperty float y\n\
        property double z\nproperty uchar red\nproperty float s\nproperty float t\nelement edge 1\n\
        property int vertex1\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    const CORNERS: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

    fn ascii() -> Vec<u8> {
        let mut text = format!("ply\nformat ascii 1.0\n{HEADER}");
        for [x, y] in CORNERS {
            text += &format!("{x} {y} 5e-1 7 {x} {y}\n");
        }
        (text + "3\n4 0 1 2 3\n").into_bytes()
    }

    fn binary(big: bool) -> Vec<u8> {
        let format = if big {
            "binary_big_endian"
        } else {
            "binary_little_endian"
        };
        let mut bytes = format!("ply\nformat {format} 1.0\n{HEADER}").into_bytes();
        let mut put = |little: &[u8]| match big {
            true => bytes.extend(little.iter().rev()),
            false => bytes.extend(little),
        };
        for [x, y] in CORNERS {
            put(&x.to_le_bytes());
            put(&y.to_le_bytes());
            put(&0.5f64.to_le_bytes());
            put(&[7]);
            put(&x.to_le_bytes());
            put(&y.to_le_bytes());
        }
        put(&3i32.to_le_bytes());
        put(&[4]);
        (0..4i32).for_each(|i| put(&i.to_le_bytes()));
        bytes
    }

    #[test]
    fn all_encodings_give_the_same_mesh() {
        for bytes in [ascii(), binary(false), binary(true)] {
            let mesh = RawMesh::read("square.PLY", &bytes).unwrap();
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
            for (i, [x, y]) in CORNERS.iter().map(|c| c.map(f64::from)).enumerate() {
                assert_eq!(mesh.positions[i], DVec3::new(x, y, 0.5));
                assert_eq!(mesh.uvs[i], DVec2::new(x, y));
            }
            assert!(mesh.normals.is_empty());
        }
    }

    /// A file in which faces have two to six corners and properties are of all kinds, in any order: binary ones, which
    /// are read side by side, are read as the library reads the text.
    #[test]
    fn binary_files_are_read_as_text_is() {
        let header = "element vertex 50000\nproperty short nx\nproperty float y\nproperty uchar red\nproperty double x\n\
            property char nz\nproperty ushort z\nproperty int ny\nproperty float u\nproperty float green\n\
            property double blue\nproperty uint v\nproperty float s\nelement face 40000\n\
            property list uchar float weights\nproperty uchar kind\nproperty list ushort uint vertex_index\nend_header\n";
        let file = |format: &str| format!("ply\nformat {format} 1.0\n{header}").into_bytes();
        let mut files = [file("ascii"), file("binary_little_endian"), file("binary_big_endian")];
        macro_rules! put {
            ($x:expr) => {
                let x = $x;
                files[0].extend(format!("{x} ").into_bytes());
                files[1].extend(x.to_le_bytes());
                files[2].extend(x.to_be_bytes());
            };
        }
        for i in 0..50_000u32 {
            put!(i as i16);
            put!(i as f32 * 0.1);
            put!(i as u8);
            put!(f64::from(i) / 3.0);
            put!(i as i8);
            put!((i / 7) as u16);
            put!(5 - i as i32);
            put!(i as f32 / 5e4);
            put!(0.5f32);
            put!(0.25f64);
            put!(i);
            put!(1.0 - i as f32 / 5e4);
            files[0].push(b'\n');
        }
        for i in 0..40_000u32 {
            put!((i % 3) as u8);
            (0..i % 3).for_each(|k| {
                put!(k as f32);
            });
            put!(7u8);
            put!((2 + i % 5) as u16);
            (0..2 + i % 5).for_each(|k| {
                put!(i + k);
            });
            files[0].push(b'\n');
        }
        let [text, little, big] = files.map(|bytes| RawMesh::read("a.ply", &bytes).unwrap());
        assert_eq!(text.triangles.len(), 80_000);
        assert_eq!(text.uvs[7].x, f64::from(1.0 - 7.0f32 / 5e4));
        assert!(!text.normals.is_empty() && !text.colors.is_empty());
        assert!(text == little && text == big);
    }

    /// A dart and a triangle, and a dart whose vertices follow: of text and of both byte orders.
    #[test]
    fn polygons_that_are_not_convex_are_filled() {
        let vertices = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
        let faces = "element face 2\nproperty list uchar int vertex_indices\n";
        let places = [[2.0f32, -1.0, 0.0], [0.5, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0; 3]];
        for faces_first in [false, true] {
            let mut files = ["ascii", "binary_little_endian", "binary_big_endian"].map(|format| {
                let (one, two) = if faces_first {
                    (faces, vertices)
                } else {
                    (vertices, faces)
                };
                format!("ply\nformat {format} 1.0\n{one}{two}end_header\n").into_bytes()
            });
            let put_faces = |files: &mut [Vec<u8>; 3]| {
                files[0].extend(b"4 0 1 2 3\n3 0 1 2\n");
                for list in [&[0, 1, 2, 3][..], &[0, 1, 2]] {
                    for (i, file) in files.iter_mut().enumerate().skip(1) {
                        file.push(list.len() as u8);
                        let bytes = |v: &i32| if i == 1 { v.to_le_bytes() } else { v.to_be_bytes() };
                        file.extend(list.iter().flat_map(bytes));
                    }
                }
            };
            if faces_first {
                put_faces(&mut files);
            }
            for [x, y, z] in places {
                files[0].extend(format!("{x} {y} {z}\n").into_bytes());
            }
            for x in places.into_iter().flatten() {
                files[1].extend(x.to_le_bytes());
                files[2].extend(x.to_be_bytes());
            }
            if !faces_first {
                put_faces(&mut files);
            }
            for file in files {
                let mesh = RawMesh::read("a.ply", &file).unwrap();
                assert_eq!(mesh.triangles, [[0, 1, 3], [1, 2, 3], [0, 1, 2]]);
            }
        }
    }

    /// With restarts, and with vertices named twice to join strips; each triangle winds as the first one.
    #[test]
    fn strips_are_triangles() {
        let file = |lists: &str, count: usize| {
            let vertices = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n1 2 0\n";
            format!(
                "\u{feff}ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n\
                 property float z\nelement tristrips {count}\nproperty list int int vertex_indices\nend_header\n\
                 {vertices}{lists}"
            )
        };
        for (lists, count, triangles) in [
            ("6 0 1 2 3 4 5\n", 1, 4),
            ("7 0 1 2 3 4 5 -1\n", 1, 4),
            ("9 0 1 2 3 -1 2 3 4 5\n", 1, 4),
            ("9 -1 0 1 2 3 -1 -1 4 5\n", 1, 2),
            ("4 0 1 2 3\n4 2 3 4 5\n", 2, 4),
            ("8 0 1 2 3 3 2 2 3\n", 1, 2),
            ("3 0 1 2\n5 1 3 2 -1 0\n", 2, 2),
        ] {
            let mesh = RawMesh::read("a.ply", file(lists, count).as_bytes()).unwrap();
            assert_eq!(mesh.triangles.len(), triangles, "{lists}");
            assert_eq!(mesh.area(&glam::DAffine3::IDENTITY), 0.5 * triangles as f64);
            let normal = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
                (b - a).cross(c - a)
            };
            assert!(mesh.triangles.iter().all(|t| normal(t) == DVec3::Z), "{lists}");
        }
        let flaw = RawMesh::read("a.ply", file("4 0 1 2 6\n", 1).as_bytes()).unwrap_err();
        assert!(
            flaw.message.contains("names vertex 6, but there are 6"),
            "{}",
            flaw.message
        );
    }

    /// Floats as they are, bytes as sRGB, and nothing of them where they are not asked for.
    #[test]
    fn colours_of_vertices_are_linear() {
        let linear = linear_from_srgb(7.0 / 255.0);
        for (kind, names, value, expected) in [
            ("uchar", ["red", "green", "blue"], "7", linear),
            ("float", ["r", "g", "b"], "0.25", 0.25),
            ("double", ["red", "green", "blue"], "0.75", 0.75),
        ] {
            let properties: String = names.iter().map(|name| format!("property {kind} {name}\n")).collect();
            let text = String::from_utf8(ascii()).unwrap();
            let text = text.replace("property uchar red\n", &properties);
            let text = text.replace(" 5e-1 7 ", &format!(" 5e-1 {value} 0 {value} "));
            let mesh = RawMesh::read_nth("a.ply", text.as_bytes(), 0, true).unwrap();
            assert_eq!(mesh.colors, [Rgb::new(expected, 0.0, expected); 4]);
            assert_eq!(mesh.uvs[2], DVec2::ONE);
            let without = RawMesh::read_nth("a.ply", text.as_bytes(), 0, false).unwrap();
            assert!(without.colors.is_empty() && without.positions == mesh.positions);
        }
        // One channel is no colour.
        assert!(RawMesh::read("a.ply", &ascii()).unwrap().colors.is_empty());
    }

    #[test]
    fn every_truncation_is_refused() {
        for bytes in [ascii(), binary(false), binary(true)] {
            // The last line of ASCII may do without its end.
            for length in 0..bytes.len() - 1 {
                assert!(RawMesh::read("a.ply", &bytes[..length]).is_err(), "{length}");
            }
        }
    }

    #[test]
    fn ascii_errors_have_lines() {
        let text = String::from_utf8(ascii()).unwrap();
        for (from, to, line) in [
            ("0 1 5e-1 7 0 1\n", "0 nan 5e-1 7 0 1\n", 19),
            ("0 1 5e-1 7 0 1\n", "0 1 5e-1 7 0\n", 19),
            ("4 0 1 2 3\n", "4 0 1 2\n", 21),
            ("property uchar red", "property colour red", 8),
        ] {
            assert!(text.contains(from));
            let flaw = RawMesh::read("a.ply", text.replace(from, to).as_bytes()).unwrap_err();
            assert_eq!(flaw.line, Some(line), "{}", flaw.message);
        }
    }

    #[test]
    fn bad_meshes_say_why() {
        let text = String::from_utf8(ascii()).unwrap();
        for (from, to, reason) in [
            ("4 0 1 2 3", "4 0 1 2 4", "names vertex 4, but there are 4"),
            ("4 0 1 2 3", "4 0 1 -2 3", "names vertex 4294967295"),
            ("4 0 1 2 3", "2 0 1", "the mesh is empty"),
            ("4 0 1 2 3", "4000000000 0 1 2 3", "list"),
            ("element vertex 4\n", "element vertex 4000000000\n", "too short"),
            (
                "element vertex 4\n",
                "element vertex 18446744073709551615\n",
                "too short",
            ),
            (
                "element edge 1\nproperty int vertex1\n",
                "element edge 4000000000\n",
                "too short",
            ),
            ("element face 1\n", "element strips 1\n", "it has no faces"),
            ("element face 1\n", "element face 0\n", "the mesh is empty"),
            ("property double z\n", "property double w\n", "lacks x, y or z"),
            ("vertex_indices", "indices", "lacks the list `vertex_indices`"),
            ("1 0 5e-1", "1e39 0 5e-1", "NaN or infinite"),
        ] {
            assert!(text.contains(from), "{from}");
            let flaw = RawMesh::read("a.ply", text.replace(from, to).as_bytes()).unwrap_err();
            assert!(flaw.message.contains(reason), "{}", flaw.message);
        }
        let nan = [0, 0, 0xc0, 0x7f];
        let mut bytes = binary(false);
        let first_vertex = bytes.len() - 25 * 4 - 4 - 17;
        bytes[first_vertex..first_vertex + 4].copy_from_slice(&nan);
        let flaw = RawMesh::read("a.ply", &bytes).unwrap_err();
        assert!(
            flaw.message.contains("vertex 0 (from zero) has a position that is NaN"),
            "{}",
            flaw.message
        );
    }

    /// Damaged files are refused or read as something else; none makes the reader panic.
    #[test]
    fn damage_does_not_panic() {
        crate::damage::damage(&[ascii(), binary(false), binary(true)], |bytes| {
            let _ = RawMesh::read("a.ply", bytes);
        });
    }
}
