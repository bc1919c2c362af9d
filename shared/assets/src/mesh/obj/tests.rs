use super::{PIECE, fans, obj_text, read_in_pieces};
use crate::mesh::{RawMesh, obj_reference};
use beamfarm_render::sampler::{Purpose, Sampler};
use glam::{DVec2, DVec3};
use std::fmt::Write;

const OBJ: &str = "# two objects\nmtllib none.mtl\no first\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 100000.03125\n\
    vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 2\nusemtl red\nf 1/1/1 2/2/1 3/3/1\no second\nf -4 -2 -1\nl 1 2\n";

#[test]
fn names_may_be_of_any_code_page() {
    let mut bytes = b"# \xfcber\ng \xe9t\xe9\n".to_vec();
    bytes.extend(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let mesh = RawMesh::read("a.obj", &bytes).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
}

/// Faces without UVs get (0, 0).
#[test]
fn some_faces_of_an_object_have_uvs() {
    let text =
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 1\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1\nf 1//1 2//1 3//1\nf 3/1/1 2/1/1 1/1/1\n";
    let mesh = RawMesh::read("a.obj", text.as_bytes()).unwrap();
    let uvs: Vec<[DVec2; 3]> = mesh.triangles.iter().map(|t| t.map(|v| mesh.uvs[v as usize])).collect();
    let some = DVec2::new(0.5, 1.0);
    assert_eq!(uvs, [[some; 3], [DVec2::ZERO; 3], [some; 3]]);
    // Errors refer to the file's own lines.
    let flaw = RawMesh::read("a.obj", text.replace("3//1", "9//1").as_bytes()).unwrap_err();
    assert_eq!(flaw.line, Some(7));
}

#[test]
fn objects_are_joined() {
    let mesh = RawMesh::read("a.obj", OBJ.as_bytes()).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [3, 4, 5]]);
    assert_eq!(mesh.positions[1], DVec3::X);
    assert_eq!(mesh.positions[5], DVec3::new(0.0, 1.0, 100000.03125));
    assert_eq!(mesh.uvs[1], DVec2::X);
    assert_eq!(mesh.uvs[3], DVec2::ZERO);
    // The second object has no normals and gets its triangle's.
    assert_eq!(mesh.normals[0], DVec3::Z);
    let [a, b, c] = [3, 4, 5].map(|i| mesh.positions[i]);
    assert_eq!(mesh.normals[3], (b - a).cross(c - a).normalize());
}

/// Unless they have normals, or only some have UVs.
#[test]
fn groups_share_vertices() {
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\n";
    for (faces, vertices) in [
        (" g one\nf 1 2 3\ng\nf 1 3 4\n", 4),
        ("o a\r\nf 1/1 2/1 3/1\r\no b\r\nf 1/1 3/1 4/1\r\n", 4),
        ("g one\nf 1/1 2/1 3/1\ng two\nf 1 3 4\n", 6),
        ("vn 0 0 1\ng one\nf 1//1 2//1 3//1\ng two\nf 1//1 3//1 4//1\n", 6),
    ] {
        let mesh = RawMesh::read("a.obj", format!("{square}{faces}").as_bytes()).unwrap();
        assert_eq!(mesh.positions.len(), vertices, "{faces}");
        assert_eq!(mesh.area(&glam::DAffine3::IDENTITY), 1.0);
    }
}

#[test]
fn polygons_become_fans() {
    let text = "v 0 0 0\nv 1 0 0\nv 2 1 0\nv 1 2 0\nv 0 1 0\nf 1 2 3 4 5\n";
    let mesh = RawMesh::read("a.obj", text.as_bytes()).unwrap();
    assert_eq!(mesh.triangles.len(), 3);
    assert_eq!(mesh.area(&glam::DAffine3::IDENTITY), 2.5);
}

const U: &str = "v 0 0 0\nv 3 0 0\nv 3 3 0\nv 2 3 0\nv 2 1 0\nv 1 1 0\nv 1 3 0\nv 0 3 0\n";

/// Also with vertices after the face, and with faces of every kind.
#[test]
fn polygons_that_are_not_convex_are_filled() {
    let area = |text: &str| {
        let mesh = RawMesh::read("a.obj", text.as_bytes()).unwrap();
        assert_eq!(mesh.triangles.len(), 6);
        assert_eq!(mesh.cuts.len(), 1);
        let normal = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            (b - a).cross(c - a).z
        };
        assert!(mesh.triangles.iter().all(|t| normal(t) > 0.0));
        mesh.area(&glam::DAffine3::IDENTITY)
    };
    assert_eq!(area(&format!("{U}f 1 2 3 4 5 6 7 8\n")), 7.0);
    assert_eq!(area(&format!("{U}f 5 6 7 8 1 2 3 4\n")), 7.0);
    assert_eq!(area(&format!("f 1 2 3 4 5 6 7 8\n{U}")), 7.0);
    let uvs = "vt 0 0\nvt 1 0\nvt 1 1\n";
    assert_eq!(area(&format!("{U}{uvs}f 1/1 2/2 3/3 4/1 5/2 6/3 7/1 8/2\n")), 7.0);
    // A polygon's triangles do not depend on where the text is cut.
    let text = format!("{U}f 1 2 5 6\nf 1 2 3 4 5 6 7 8\nf 1 2 3\nf 1 2 3 4 5 6 7 8\n").repeat(3);
    let whole = read_in_pieces(text.as_bytes(), PIECE, true).unwrap();
    assert_eq!(whole.cuts.len(), 6);
    assert!(
        [1, 30, 90]
            .into_iter()
            .all(|size| read_in_pieces(text.as_bytes(), size, true).unwrap() == whole)
    );
}

/// A polygon that is convex at only one time keeps the same triangles while moving.
#[test]
fn meshes_move_to_others_whose_polygons_are_cut_otherwise() {
    let mesh = |x: f64| {
        let text = format!("v 0 0 0\nv 2 -1 0\nv {x} 0 0\nv 2 1 0\nvt 0 0\nvt 0 1\nf 2/1 3/2 4/1 1/2\n");
        RawMesh::read("a.obj", text.as_bytes()).unwrap()
    };
    let (convex, dart) = (mesh(3.0), mesh(0.5));
    assert_ne!(convex.triangles, dart.triangles);
    let between = convex.toward(&dart, 0.5).unwrap();
    assert_eq!(between.positions[1], DVec3::new(1.75, 0.0, 0.0));
    assert_eq!(between.triangles, convex.triangles);
    assert_eq!(dart.toward(&convex, 0.0).unwrap().area(&glam::DAffine3::IDENTITY), 0.5);
    assert!(
        mesh(0.5)
            .toward(&RawMesh::read("a.obj", OBJ.as_bytes()).unwrap(), 0.5)
            .is_err()
    );
}

/// As editors and Rhino write them.
#[test]
fn marks_before_the_text_and_lines_that_go_on_are_read() {
    let square = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n";
    let expected = RawMesh::read("a.obj", square.as_bytes()).unwrap();
    for text in [
        format!("\u{feff}{square}"),
        format!("\u{feff}# by hand\n{square}"),
        square.replace("2 3", "2 \\\n  3"),
        square.replace("2 3", "2\\\r\n3 \\\r\n "),
        square.replace("v 1 1 0", "v\\\n1\\\n1\\\n0"),
        square.replace("v -1 1 0", "# in C:\\meshes\\\nv -1 1 0\nmtllib C:\\a.mtl"),
        format!("{square}\\\n"),
    ] {
        assert_eq!(RawMesh::read("a.obj", text.as_bytes()).unwrap(), expected, "{text}");
    }
}

#[test]
fn bad_meshes_say_why() {
    for (text, line, reason) in [
        ("", None, "the mesh is empty"),
        ("v 0 0 0\nv 1 0 0\nv x 1 0\nf 1 2 3\n", Some(3), "position"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", Some(4), "vertex 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 -4\n", Some(5), ""),
        ("v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n", None, "position that is NaN"),
        (
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nvn 0 0 1\nf 1//1 2//1 3\n",
            None,
            "some faces of",
        ),
    ] {
        let flaw = RawMesh::read("a.obj", text.as_bytes()).unwrap_err();
        assert_eq!(flaw.line, line, "{text}: {}", flaw.message);
        assert!(flaw.message.contains(reason), "{text}: {}", flaw.message);
    }
    let flaw = RawMesh::read("a.stl", b"").unwrap_err();
    assert!(flaw.message.contains("expected .ply, .obj or .serialized"));
}

/// For OBJ files: what was expected, the start of what was found, and the line number.
#[test]
fn bad_lines_are_quoted() {
    let square = "v 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 1 0\r\nvt 0 0\r\n";
    let long = format!("v {}\n", "1".repeat(100_000) + "x");
    for (text, line, message) in [
        ("v 1 2\n", 6, "expected three numbers of a position, found `1 2`"),
        ("\n\nv 1 2 3 0\n", 8, "the position is divided by zero"),
        ("v 1 2 3 4 5", 6, "found `1 2 3 4 5`"),
        (
            "v 1 2 3 w",
            6,
            "expected a number that the position is divided by, found `w`",
        ),
        (&long, 6, "found `1111111111111111111111111111111111111111`…"),
        ("vt 1\n", 6, "expected two numbers of a UV, found `1`"),
        ("vn\r\n", 6, "expected three numbers of a normal, found nothing"),
        (
            "# a\nf 1 2 3/x\n",
            7,
            "expected an index, or indices like 1/2/3, 1//3 or 1/2, found `3/x`",
        ),
        ("f 1 2 3/1/1/1\n", 6, "found `3/1/1/1`"),
        ("f 1 2 \\", 6, "found `\\`"),
        ("f 1 2 \\\n9\nv x\n", 8, "found `x`"),
        ("f 1 2 \\\r\n 3 \\\r\n\r\nv x\r\n", 9, "found `x`"),
        ("f\n", 6, "expected indices of vertices, found nothing"),
        ("f 1 2 4 3 5", 6, "the face names vertex 5, but there are 4"),
        ("f 1 2 3\nf 1 2 3 0\n", 7, "the face names vertex 0, but there are 4"),
        ("f 1 2 /1\n", 6, "expected the index of a vertex, found `/1`"),
        ("f 1//9 2 3\nvn 0 0 1\n", 6, "the face names normal 9, but there are 1"),
        ("f 1/1 2/1 3/2\n", 6, "the face names UV 2, but there are 1"),
        (
            "f 1//6148914691236517207 2//1 3//1\nvn 0 0 1\n",
            6,
            "the face names normal 6148914691236517207",
        ),
        ("p -5\n", 6, "a face counts back to -5, but there are 4 before it"),
        (
            "v 1 2 3 1 1 1\nf 1 2 5\n",
            7,
            "the face names vertex 2, which has no colour",
        ),
        (
            "vn 0 0 1\no a\nf 1//1 2//1 5//1\no b\nv 0 0 0\n",
            8,
            "the face names vertex 5, but there are 4",
        ),
    ] {
        for size in [1, 50, PIECE] {
            let flaw = read_in_pieces(format!("{square}{text}").as_bytes(), size, true).unwrap_err();
            assert!(flaw.message.contains(message), "{text}: {}", flaw.message);
            assert!(flaw.message.len() < 200);
            assert_eq!(flaw.line, Some(line), "{text}");
        }
    }
    let text = format!("{square}vn 0 0 1\no a b\nf 1//1 2//1 3\n");
    let flaw = RawMesh::read("a.obj", text.as_bytes()).unwrap_err();
    assert_eq!(flaw.message, "some faces of `a b` have normals and some have none");
}

/// A file with faces of every kind, mixed or not. `wild`: with syntax that programs rarely write.
fn random_file(seed: u64, wild: bool) -> String {
    let mut sampler = Sampler::new(2, seed, Purpose::Test, 0);
    let mut below = |n: u32| sampler.next_u32() % n;
    let end = ["\n", "\r\n"][below(2) as usize];
    let (has_normals, has_uvs, has_groups) = (below(2) == 0, below(2) == 0, below(3) > 0);
    let mut text = String::new();
    let mut defined = [0u32; 3];
    for _ in 0..below(60) + 3 {
        let line = match below(if wild { 22 } else { 14 }) {
            _ if defined[0] < 3 => format!("v {}", numbers(3, &mut below)),
            _ if has_uvs && defined[1] == 0 => format!("vt {}", numbers(3, &mut below)),
            _ if has_normals && defined[2] == 0 => format!("vn {}", numbers(3, &mut below)),
            0 | 1 => format!("v {}", numbers(3, &mut below)),
            2 if has_uvs => format!("vt {}", numbers(2, &mut below)),
            3 if has_normals => format!("vn {}", numbers(3, &mut below)),
            4 if has_groups => format!("{} part {}", ["o", "g"][below(2) as usize], below(9)),
            5 => ["# a comment", "", "  ", "s off", "usemtl red", "mtllib a b.mtl"][below(6) as usize].to_owned(),
            14 => format!("v {} 2.5", numbers(3, &mut below)),
            15 => format!("v {}", numbers(6, &mut below)),
            16 => "\t v  1\t2 3 ".to_owned(),
            17 => "# \u{e9}\u{a0} \u{2028}".to_owned(),
            18 => "f 1\u{a0}2\u{3000}3".to_owned(),
            19 => ["g", "o \u{e9}", "p 1", "l 1 2", "l 1 2 3", "f 1", "f 1 2"][below(7) as usize].to_owned(),
            _ if wild && below(8) == 0 => {
                let kind = [below(2) == 0, below(2) == 0];
                face(kind, defined, &mut below)
            }
            _ => face([has_uvs, has_normals], defined, &mut below),
        };
        let keyword = line.split_whitespace().next();
        if let Some(i) = ["v", "vt", "vn"].iter().position(|name| keyword == Some(name)) {
            defined[i] += 1;
        }
        text.push_str(&line);
        text.push_str(end);
    }
    if below(3) == 0 {
        text.truncate(text.trim_end().len());
    }
    text
}

/// Numbers as programs write them, and unusual ones.
fn numbers(count: u32, below: &mut impl FnMut(u32) -> u32) -> String {
    let number = |k: u32| match k % 7 {
        0 => format!("{}", f64::from(k) / 1e3 - 3.0),
        1 => format!("{:e}", f64::from(k) * 1e-9),
        2 => format!("-{k}."),
        3 => format!("0.{k}{k}{k}{k}{k}{k}"),
        4 => format!("{k}{k}{k}{k}E-{}", k % 40),
        5 => format!("+.{k}"),
        _ => format!("{k}"),
    };
    let numbers: Vec<String> = (0..count).map(|_| number(below(10_000))).collect();
    numbers.join(" ")
}

fn face([with_uvs, with_normals]: [bool; 2], defined: [u32; 3], below: &mut impl FnMut(u32) -> u32) -> String {
    let mut face = "f".to_owned();
    let [with_uvs, with_normals] = [with_uvs && defined[1] > 0, with_normals && defined[2] > 0];
    for _ in 0..[3, 3, 3, 4, 4, 5, 9][below(7) as usize] {
        let [v, vt, vn] = defined.map(|defined| match below(3) {
            _ if defined == 0 => String::new(),
            0 => (below(defined) + 1).to_string(),
            1 => format!("-{}", below(defined) + 1),
            // Few indices, so that vertices are shared and one position has many.
            _ => (below(defined.min(3)) + 1).to_string(),
        });
        face += &match (with_uvs, with_normals) {
            (true, true) => format!(" {v}/{vt}/{vn}"),
            (true, false) => format!(" {v}/{vt}"),
            (false, true) => format!(" {v}//{vn}"),
            (false, false) => format!(" {v}"),
        };
    }
    face
}

/// The bits of a mesh, or nothing after an error.
fn bits(mesh: Result<RawMesh, crate::Flaw>) -> Option<(Vec<u64>, Vec<[u32; 3]>)> {
    let mesh = mesh.ok()?;
    let RawMesh {
        positions,
        normals,
        uvs,
        ..
    } = &mesh;
    let vectors = positions.iter().chain(normals).flat_map(|p| p.to_array());
    let numbers = vectors.chain(uvs.iter().flat_map(|uv| uv.to_array()));
    let counts = [positions.len(), normals.len(), uvs.len()].map(|n| n as u64);
    Some((
        counts.into_iter().chain(numbers.map(f64::to_bits)).collect(),
        mesh.triangles,
    ))
}

/// The library triangulates all polygons as fans.
fn fans_in_pieces(bytes: &[u8], size: usize) -> Result<RawMesh, crate::Flaw> {
    fans(bytes, &obj_text::read(bytes, size)?)
}

/// Same bits, wherever the text is cut.
#[test]
fn files_are_read_as_the_library_reads_them() {
    let mut good = [0; 2];
    for seed in 0..4000 {
        let wild = seed % 2 == 1;
        let text = random_file(seed, wild);
        let expected = bits(obj_reference::read(text.as_bytes()));
        good[usize::from(wild)] += usize::from(expected.is_some());
        for size in [1, 40, 200, PIECE] {
            let read = fans_in_pieces(text.as_bytes(), size);
            let flaw = read.as_ref().err().map(|flaw| flaw.message.clone());
            assert!(
                bits(read) == expected,
                "seed {seed}, pieces of {size}: {flaw:?}\n{text}"
            );
        }
    }
    assert!(good[0] > 1900 && good[1] > 600, "{good:?}");
}

#[test]
fn damaged_files_are_read_as_the_library_reads_them() {
    let mut files = vec![OBJ.as_bytes().to_vec()];
    files.extend((0..6).map(|seed| random_file(seed, seed % 2 == 1).into_bytes()));
    crate::damage::damage(&files, |bytes| {
        // The library refuses a `usemtl` without a name.
        let text = String::from_utf8_lossy(bytes);
        if text.lines().any(|line| line.trim() == "usemtl") {
            return;
        }
        let expected = bits(obj_reference::read(bytes));
        assert!(bits(fans_in_pieces(bytes, 30)) == expected, "{text}");
    });
}

#[test]
fn meshes_do_not_depend_on_threads() {
    let mut text = String::new();
    for i in 0..20_000 {
        let _ = writeln!(
            text,
            "v {} {} {}\nvt {} 0.5",
            i % 100,
            i / 100,
            i % 7,
            f64::from(i) / 3.0
        );
    }
    for i in 0..19_000 {
        let _ = match i % 1000 {
            0 => writeln!(text, "vn 0 0 1\ng {i}\nf -2 -1 -100"),
            _ => writeln!(
                text,
                "f {}/{}/1 {i_1}/{i_1}/1 {}/1/1",
                i + 1,
                i % 17 + 1,
                i + 101,
                i_1 = i + 2
            ),
        };
    }
    let on = |threads: usize, text: &str| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| read_in_pieces(text.as_bytes(), 1 << 12, true).map_err(|flaw| (flaw.line, flaw.message)))
    };
    let one = on(1, &text);
    assert_eq!(one.as_ref().unwrap().triangles.len(), 19_000);
    assert!([2, 3, 7].into_iter().all(|threads| on(threads, &text) == one));
    // The first of several errors.
    let bad = text.replace("v 5 ", "v x ");
    assert_eq!(on(1, &bad).unwrap_err().0, Some(11));
    assert!([2, 3, 7].into_iter().all(|threads| on(threads, &bad) == on(1, &bad)));
}

/// One vertex per corner at one position, which must not lead to long searches.
#[test]
fn a_position_may_have_very_many_vertices() {
    let mut text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned();
    for i in 1..=100_000 {
        let _ = writeln!(text, "vt {i} 0\nf 1/{i} 2/{i} 3/{i}\nf 1/{i} 2/{i} 3/1");
    }
    let mesh = RawMesh::read("a.obj", text.as_bytes()).unwrap();
    assert_eq!(mesh.positions.len(), 300_000);
    assert_eq!(mesh.triangles[1], [0, 1, 2]);
    assert_eq!(mesh.triangles[199_999], [299_997, 299_998, 2]);
}

#[test]
fn damage_does_not_panic() {
    crate::damage::damage(&[OBJ.as_bytes().to_vec()], |bytes| {
        let _ = RawMesh::read("a.obj", bytes);
    });
}

/// In sRGB, wherever the text is cut, also with vertices shared by several faces and out of order.
#[test]
fn vertices_have_the_colours_after_their_positions() {
    let text = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 0.5 1.5 -1\nf 4 1 2\nf 4 2 3\n";
    for size in [1, 40, PIECE] {
        let mesh = read_in_pieces(text.as_bytes(), size, true).unwrap();
        let by_position = |x: f64, y: f64| {
            let at = mesh.positions.iter().position(|p| (p.x, p.y) == (x, y)).unwrap();
            mesh.colors[at].to_array()
        };
        assert_eq!(mesh.colors.len(), 4);
        assert_eq!(by_position(0.0, 0.0), [1.0, 0.0, 0.0]);
        assert_eq!(by_position(1.0, 0.0), [0.0, 1.0, 0.0]);
        assert_eq!(by_position(1.0, 1.0), [0.0, 0.0, 1.0]);
        let [r, g, b] = by_position(0.0, 1.0);
        assert!((r - 0.214_041).abs() < 1e-6 && (g, b) == (1.0, 0.0), "{r} {g} {b}");
        assert!(read_in_pieces(text.as_bytes(), size, false).unwrap().colors.is_empty());
    }
    // Only some vertices have colours.
    let text = text
        .replace("v 0 1 0 0.5 1.5 -1", "v 0 1 0")
        .replace("f 4 1 2\nf 4 2 3", "f 1 2 3");
    assert!(read_in_pieces(text.as_bytes(), PIECE, true).unwrap().colors.is_empty());
}
