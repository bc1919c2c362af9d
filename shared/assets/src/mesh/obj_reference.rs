//! Reads OBJ files with a library, sequentially: the reference for the reader.

use super::RawMesh;
use crate::Flaw;
use glam::{DVec2, DVec3};
use std::borrow::Cow;
use std::io::Cursor;
use tobj::LoadOptions;

/// Read a mesh. Polygons become fans of triangles; points and lines are skipped.
pub fn read(bytes: &[u8]) -> Result<RawMesh, Flaw> {
    // Comments and names may use the code pages of old programs.
    let text = String::from_utf8_lossy(bytes);
    if let Some(flaw) = backward_flaw(&text) {
        return Err(flaw);
    }
    let bytes = text.as_bytes();
    // If only some groups have UVs, each group gets its own vertices.
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

/// A file in which some faces of an object have UVs or normals and some do not, with each kind made a separate object.
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

/// The first index that counts back beyond the file's start; the library would compute with the result.
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
            // The library refuses what is not a number.
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

/// A file without normals, with its group lines commented out, so that groups share vertices and smooth normals
/// continue across groups.
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

/// Read objects and groups one by one.
fn read_objects(bytes: &[u8]) -> Result<RawMesh, Flaw> {
    let options = LoadOptions {
        single_index: true,
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
    };
    let mut cursor = Cursor::new(bytes);
    let no_materials = |_: &std::path::Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut cursor, &options, no_materials).map_err(|e| e.to_string())?;
    let mut mesh = RawMesh::default();
    for model in models {
        append(&mut mesh, &model.name, &model.mesh)?;
    }
    Ok(mesh)
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
        // Zero normals are replaced by face normals after reading.
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
