//! Shapes: how rays meet them and how points on them are drawn.

use super::Mesh;
use crate::math::{Vec2, Vec3};
use glam::Affine3A;
use std::sync::Arc;

/// A shape in render space. Rectangles and cubes are meshes.
#[derive(Clone, Debug)]
pub enum Shape {
    /// A sphere of radius 1 around the origin under `render_from_object` (which may be any invertible map).
    Sphere {
        /// Object to render space.
        render_from_object: Affine3A,
        /// Its inverse.
        object_from_render: Affine3A,
    },
    /// The disc of radius 1 in the xy plane, normal +z, under `render_from_object`.
    Disc {
        /// Object to render space.
        render_from_object: Affine3A,
        /// Its inverse.
        object_from_render: Affine3A,
    },
    /// A mesh; instances share it.
    Mesh {
        /// Vertices in object space.
        mesh: Arc<Mesh>,
        /// Object to render space.
        render_from_object: Affine3A,
        /// Its inverse.
        object_from_render: Affine3A,
    },
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceHit {
    /// Distance along the ray.
    pub t: f32,
    /// The point, placed on the surface itself rather than at `origin + t dir`.
    pub point: Vec3,
    /// Unit geometric normal, pointing outside.
    pub ng: Vec3,
    /// Unit shading normal, in the hemisphere of `ng`.
    pub ns: Vec3,
    /// Surface parameters.
    pub uv: Vec2,
    /// Index into the scene's objects.
    pub object: u32,
    /// Triangle within a mesh.
    pub primitive: u32,
    /// Derivative of the shading normal by a displacement on the surface: `dn = curvature * dp`. 1/radius for spheres,
    /// zero for flat facets, the interpolated normals' mean for meshes.
    pub curvature: f32,
}

/// A point drawn uniformly by area.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// The point.
    pub point: Vec3,
    /// Unit geometric normal, pointing outside.
    pub normal: Vec3,
    /// Surface parameters.
    pub uv: Vec2,
    /// Density per area.
    pub pdf_area: f32,
}
