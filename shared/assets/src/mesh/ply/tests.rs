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

/// A file with faces of two to six corners and properties of all types in any order. Binary files, read in parallel,
/// must give the same result as the library's reading of the text.
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

/// A dart and a triangle, then a dart before its vertices, in text and both byte orders.
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

/// With restarts, and with repeated vertices that join strips; all triangles wind like the first.
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

/// Floats are linear, bytes are sRGB, and colours are read only on request.
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
    // A single channel is not a colour.
    assert!(RawMesh::read("a.ply", &ascii()).unwrap().colors.is_empty());
}

#[test]
fn every_truncation_is_refused() {
    for bytes in [ascii(), binary(false), binary(true)] {
        // The last line of ASCII may lack its line end.
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

/// Damaged files are refused or read as something else, without a panic.
#[test]
fn damage_does_not_panic() {
    crate::damage::damage(&[ascii(), binary(false), binary(true)], |bytes| {
        let _ = RawMesh::read("a.ply", bytes);
    });
}
