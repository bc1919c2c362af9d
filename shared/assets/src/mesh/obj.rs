//! Wavefront OBJ: all objects and groups as one mesh; materials are ignored.

use super::RawMesh;
use crate::{Flaw, line_of};
use glam::{DVec2, DVec3};
use std::borrow::Cow;
use std::io::Cursor;
use tobj::LoadOptions;

/// Read a mesh. Polygons become fans of triangles; points and lines are skipped.
pub fn read(bytes: &[u8]) -> Result<RawMesh, Flaw> {
    // Comments and names in the code pages of old programs.
    let text = String::from_utf8_lossy(bytes);
    if let Some(flaw) = backward_flaw(&text) {
        return Err(flaw);
    }
    let bytes = text.as_bytes();
    // Some groups may have UVs where others have none: then each has vertices of its own.
    if let Some(joined) = without_groups(bytes)
        && let Ok(mesh) = read_objects(&joined)
    {
        return Ok(mesh);
    }
    let read = read_objects(bytes);
    match read {
        Err(flaw) => split_by_kind(&text)
            .and_then(|split| read_objects(split.as_bytes()).ok())
            .ok_or(flaw),
        Ok(mesh) => Ok(mesh),
    }
}

/// A file in which some faces of one object have UVs or normals and some have none, each kind made an object of its
/// own.
fn split_by_kind(text: &str) -> Option<String> {
    let mut split = String::with_capacity(text.len() + 64);
    let mut last = None;
    let mut is_mixed = false;
    for line in text.lines() {
        let mut words = line.split_whitespace();
        if words.next() == Some("f") {
            let parts = words.next().into_iter().flat_map(|word| word.split('/'));
            let kind: Vec<bool> = parts.map(|part| !part.is_empty()).collect();
            if last.as_ref().is_some_and(|last| *last != kind) {
                is_mixed = true;
                split.push_str("o kind\n");
            }
            last = Some(kind);
        }
        split.push_str(line);
        split.push('\n');
    }
    is_mixed.then_some(split)
}

/// The first index that counts back to before the file's start: the library computes with what it makes of it.
fn backward_flaw(text: &str) -> Option<Flaw> {
    let keywords = ["v", "vt", "vn"];
    let mut defined = [0u64; 3];
    for (i, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        let keyword = words.next();
        if let Some(kind) = keywords.iter().position(|name| keyword == Some(name)) {
            defined[kind] += 1;
        }
        if !matches!(keyword, Some("f" | "l" | "p")) || !line.contains('-') {
            continue;
        }
        let indices = words.flat_map(|word| word.split('/').zip(defined));
        for (index, defined) in indices.filter(|(index, _)| index.starts_with('-')) {
            // What is no number is left to the library to refuse.
            let back = index.parse::<i64>().map_or(0, i64::unsigned_abs);
            if back > defined {
                return Some(Flaw {
                    line: Some(i + 1),
                    message: format!("a face counts back to {index}, but there are {defined} before it"),
                });
            }
        }
    }
    None
}

/// A file without normals, its groups' names made comments: so faces of several groups share their vertices, and the
/// normals that are made of them are smooth from one group to the next.
fn without_groups(bytes: &[u8]) -> Option<Cow<'_, [u8]>> {
    let mut joined = Cow::Borrowed(bytes);
    let mut at = 0;
    for line in bytes.split(|byte| *byte == b'\n') {
        let start = line.iter().take_while(|b| b.is_ascii_whitespace()).count();
        let rest = &line[start..];
        let end = rest.iter().take_while(|b| !b.is_ascii_whitespace()).count();
        match &rest[..end] {
            b"vn" => return None,
            b"o" | b"g" => joined.to_mut()[at + start] = b'#',
            _ => {}
        }
        at += line.len() + 1;
    }
    Some(joined)
}

/// Objects and groups one after the other.
fn read_objects(bytes: &[u8]) -> Result<RawMesh, Flaw> {
    let options = LoadOptions {
        single_index: true,
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
    };
    let mut cursor = Cursor::new(bytes);
    let no_materials = |_: &std::path::Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut cursor, &options, no_materials)
        .map_err(|e| flaw(e, bytes, cursor.position() as usize))?;
    let mut mesh = RawMesh::default();
    for model in models {
        append(&mut mesh, &model.name, &model.mesh)?;
    }
    Ok(mesh)
}

/// `position`: where the reader stood when it gave up.
fn flaw(error: tobj::LoadError, bytes: &[u8], position: usize) -> Flaw {
    use tobj::LoadError::{FaceNormalOutOfBounds, FaceTexCoordOutOfBounds, FaceVertexOutOfBounds};
    let found_late = match error {
        FaceVertexOutOfBounds => Some((0, "v", "vertex")),
        FaceTexCoordOutOfBounds => Some((1, "vt", "UV")),
        FaceNormalOutOfBounds => Some((2, "vn", "normal")),
        _ => None,
    };
    match found_late {
        Some((part, keyword, what)) => index_flaw(bytes, part, keyword, what),
        None => Flaw {
            line: Some(line_of(bytes, position.saturating_sub(1))),
            message: error.to_string(),
        },
    }
}

/// The first face whose index of this part (of v/vt/vn) no line with `keyword` defines.
fn index_flaw(bytes: &[u8], part: usize, keyword: &str, what: &str) -> Flaw {
    let text = String::from_utf8_lossy(bytes);
    let defined = text
        .lines()
        .filter(|line| line.split_whitespace().next() == Some(keyword))
        .count();
    for (i, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        if words.next() != Some("f") {
            continue;
        }
        let mut indices = words.filter_map(|word| word.split('/').nth(part)?.parse::<i64>().ok());
        if let Some(index) = indices.find(|index| index.unsigned_abs() as usize > defined || *index == 0) {
            return Flaw {
                line: Some(i + 1),
                message: format!("the face names {what} {index}, but there are {defined}"),
            };
        }
    }
    format!("a face names a {what} that does not exist").into()
}

fn append(mesh: &mut RawMesh, name: &str, part: &tobj::Mesh) -> Result<(), Flaw> {
    let count = part.positions.len() / 3;
    let has = |values: &[f64], size: usize, what: &str| match values.len() {
        0 => Ok(false),
        n if n == size * count => Ok(true),
        _ => Err(format!("some faces of `{name}` have {what} and some have none")),
    };
    let (has_normals, has_uvs) = (has(&part.normals, 3, "normals")?, has(&part.texcoords, 2, "UVs")?);
    let vectors = |values: &[f64]| -> Vec<DVec3> { values.chunks_exact(3).map(DVec3::from_slice).collect() };
    let first = mesh.positions.len();
    if first + part.indices.len() > u32::MAX as usize {
        return Err("the mesh has more than 2^32 vertices".into());
    }
    let positions = vectors(&part.positions);
    let indices: Vec<[u32; 3]> = part.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    let shifted = |t: &[u32; 3]| t.map(|v| v + first as u32);
    if first > 0 && mesh.uvs.is_empty() && has_uvs {
        mesh.uvs.resize(first, DVec2::ZERO);
    }
    if first > 0 && mesh.normals.is_empty() && has_normals {
        // Zero normals are replaced by the faces' own after the file is read.
        mesh.normals.resize(first, DVec3::ZERO);
    }
    mesh.positions.extend(positions);
    mesh.triangles.extend(indices.iter().map(shifted));
    if has_normals {
        mesh.normals.extend(vectors(&part.normals));
    } else if !mesh.normals.is_empty() {
        mesh.normals.resize(mesh.positions.len(), DVec3::ZERO);
    }
    if has_uvs {
        mesh.uvs.extend(part.texcoords.chunks_exact(2).map(DVec2::from_slice));
    } else if !mesh.uvs.is_empty() {
        mesh.uvs.resize(mesh.positions.len(), DVec2::ZERO);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::mesh::RawMesh;
    use glam::{DVec2, DVec3};

    const OBJ: &str = "# two objects\nmtllib none.mtl\no first\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 100000.03125\n\
        vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 2\nusemtl red\nf 1/1/1 2/2/1 3/3/1\no second\nf -4 -2 -1\nl 1 2\n";

    #[test]
    fn names_may_be_of_any_code_page() {
        let mut bytes = b"# \xfcber\ng \xe9t\xe9\n".to_vec();
        bytes.extend(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        let mesh = RawMesh::read("a.obj", &bytes).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
    }

    /// Faces without UVs have (0, 0).
    #[test]
    fn some_faces_of_an_object_have_uvs() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 1\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1\nf 1//1 2//1 3//1\nf 3/1/1 2/1/1 1/1/1\n";
        let mesh = RawMesh::read("a.obj", text.as_bytes()).unwrap();
        let uvs: Vec<[DVec2; 3]> = mesh.triangles.iter().map(|t| t.map(|v| mesh.uvs[v as usize])).collect();
        let some = DVec2::new(0.5, 1.0);
        assert_eq!(uvs, [[some; 3], [DVec2::ZERO; 3], [some; 3]]);
        // What is wrong with a file is told with its own lines.
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
        // The second object has no normals: it gets those of its triangle.
        assert_eq!(mesh.normals[0], DVec3::Z);
        let [a, b, c] = [3, 4, 5].map(|i| mesh.positions[i]);
        assert_eq!(mesh.normals[3], (b - a).cross(c - a).normalize());
    }

    /// Unless they have normals, or UVs that others lack.
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

    #[test]
    fn damage_does_not_panic() {
        crate::damage::damage(&[OBJ.as_bytes().to_vec()], |bytes| {
            let _ = RawMesh::read("a.obj", bytes);
        });
    }
}
