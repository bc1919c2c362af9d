//! Triangle meshes.

use crate::math::{Vec2, Vec3};

/// Triangles with optional normals and UVs per vertex. Counter-clockwise seen from outside.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Shading normals, one a vertex, or none at all.
    pub normals: Vec<Vec3>,
    /// UVs, one a vertex, or none at all.
    pub uvs: Vec<Vec2>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
}
