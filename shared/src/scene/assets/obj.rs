//! Wavefront OBJ: all objects and groups as one mesh; materials are ignored.

use super::Flaw;
use super::mesh::RawMesh;
use crate::scene::source::line_of;
use glam::{DVec2, DVec3};
use std::io::Cursor;
use tobj::LoadOptions;

/// Read a mesh. Polygons become fans of triangles; points and lines are skipped.
pub fn read(bytes: &[u8]) -> Result<RawMesh, Flaw> {
    let options = LoadOptions {
        single_index: true,
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
    };
    let mut cursor = Cursor::new(bytes);
    let no_materials = |_: &std::path::Path| Ok(Default::default());
    let (models, _) =
        tobj::load_obj_buf(&mut cursor, &options, no_materials).map_err(|e| Flaw {
            // The reader stands behind the line that was refused, except for errors found when all lines were read.
            line: match e {
                tobj::LoadError::FaceVertexOutOfBounds
                | tobj::LoadError::FaceTexCoordOutOfBounds
                | tobj::LoadError::FaceNormalOutOfBounds => None,
                _ => Some(line_of(
                    bytes,
                    (cursor.position() as usize).saturating_sub(1),
                )),
            },
            message: e.to_string(),
        })?;
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
        _ => Err(format!(
            "some faces of `{name}` have {what} and some have none"
        )),
    };
    let (has_normals, has_uvs) = (
        has(&part.normals, 3, "normals")?,
        has(&part.texcoords, 2, "UVs")?,
    );
    let vectors =
        |values: &[f64]| -> Vec<DVec3> { values.chunks_exact(3).map(DVec3::from_slice).collect() };
    let first = mesh.positions.len();
    if first + part.indices.len() > u32::MAX as usize {
        return Err("the mesh has more than 2^32 vertices".into());
    }
    let positions = vectors(&part.positions);
    let indices: Vec<[u32; 3]> = part
        .indices
        .chunks_exact(3)
        .map(|t| [t[0], t[1], t[2]])
        .collect();
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
        mesh.uvs
            .extend(part.texcoords.chunks_exact(2).map(DVec2::from_slice));
    } else if !mesh.uvs.is_empty() {
        mesh.uvs.resize(mesh.positions.len(), DVec2::ZERO);
    }
    Ok(())
}
