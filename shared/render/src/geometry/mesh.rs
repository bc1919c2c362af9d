//! Triangle meshes.

use crate::math::{Vec2, Vec3};
use std::sync::OnceLock;

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
    /// Running sum of triangle areas, made when first asked for.
    pub area_sums: OnceLock<Vec<f64>>,
    /// What hits ask for, made when first asked for.
    pub facets: OnceLock<Facets>,
}

/// What all hits of a mesh that is where it is have in common.
#[derive(Clone, Debug)]
pub struct Facets {
    of_triangle: Vec<Facet>,
    /// Unit normals by vertex, or zero; none where the mesh has none.
    normals: Vec<Vec3>,
}

/// What all hits of a triangle have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facet {
    /// Unit geometric normal; zero when it has no area.
    pub normal: Vec3,
    /// The largest coordinate of a corner.
    pub extent: f32,
    /// See [`SurfaceHit::curvature`](super::SurfaceHit::curvature).
    pub curvature: f32,
}

impl Mesh {
    /// The corners of a triangle.
    #[inline]
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        let [a, b, c] = self.triangles[triangle as usize];
        let at = |i: u32| self.positions[i as usize];
        [at(a), at(b), at(c)]
    }

    /// Unit geometric normal of a triangle; zero when it has no area.
    #[inline]
    pub fn normal(&self, triangle: u32) -> Vec3 {
        normal_of(self.corners(triangle))
    }

    /// The shading normals at the corners of a triangle, if there are any.
    #[inline]
    pub(super) fn normals_of(&self, triangle: u32) -> Option<[Vec3; 3]> {
        if self.normals.is_empty() {
            return None;
        }
        let [a, b, c] = self.triangles[triangle as usize];
        let at = |i: u32| self.normals[i as usize];
        Some([at(a), at(b), at(c)])
    }

    /// What all hits of a triangle have in common.
    #[inline]
    pub(super) fn facet(&self, triangle: u32) -> &Facet {
        &self.facets().of_triangle[triangle as usize]
    }

    /// The unit shading normals at the corners of a triangle, or zero, if there are any.
    #[inline]
    pub(super) fn unit_normals_of(&self, triangle: u32) -> Option<[Vec3; 3]> {
        let normals = &self.facets().normals;
        if normals.is_empty() {
            return None;
        }
        Some(self.triangles[triangle as usize].map(|i| normals[i as usize]))
    }

    fn facets(&self) -> &Facets {
        self.facets.get_or_init(|| {
            let normals: Vec<Vec3> = self.normals.iter().map(|n| n.normalize_or_zero()).collect();
            let facet = |triangle| {
                let corners = self.corners(triangle);
                let [a, b, c] = corners.map(Vec3::abs);
                let at = |i: u32| normals[i as usize];
                Facet {
                    normal: normal_of(corners),
                    extent: a.max(b).max(c).max_element(),
                    curvature: match normals.is_empty() {
                        true => 0.0,
                        false => edge_curvature(corners, self.triangles[triangle as usize].map(at)),
                    },
                }
            };
            Facets {
                of_triangle: (0..self.triangles.len() as u32).map(facet).collect(),
                normals,
            }
        })
    }

    /// Whether all vertices lie on or behind the planes of all triangles. Large meshes are not looked at.
    pub fn is_convex(&self) -> bool {
        const MAX_TRIANGLES: usize = 256;
        let extent = self
            .positions
            .iter()
            .fold(0.0, |max: f32, p| max.max(p.abs().max_element()));
        let tolerance = 1e-5 * extent;
        self.triangles.len() <= MAX_TRIANGLES
            && (0..self.triangles.len() as u32).all(|triangle| {
                let normal = self.normal(triangle);
                let [corner, _, _] = self.corners(triangle);
                self.triangles
                    .iter()
                    .flatten()
                    .all(|&i| (self.positions[i as usize] - corner).dot(normal) <= tolerance)
            })
    }

    /// Running sums of the triangles' areas, in order; the last one is the mesh's area, object space.
    pub fn area_sums(&self) -> &[f64] {
        self.area_sums.get_or_init(|| {
            let mut sum = 0.0;
            let area = |i: usize| {
                let [a, b, c] = self.corners(i as u32).map(|p| p.as_dvec3());
                0.5 * (b - a).cross(c - a).length()
            };
            (0..self.triangles.len())
                .map(|i| {
                    sum += area(i);
                    sum
                })
                .collect()
        })
    }
}

/// Mean over the edges of how fast the interpolated normal turns.
pub(super) fn edge_curvature(p: [Vec3; 3], n: [Vec3; 3]) -> f32 {
    let mut sum = 0.0;
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        let edge = p[j] - p[i];
        sum += (n[j] - n[i]).dot(edge) / edge.length_squared().max(f32::MIN_POSITIVE);
    }
    sum / 3.0
}

/// Unit normal of the triangle with these corners; zero when it has no area.
#[inline]
fn normal_of([a, b, c]: [Vec3; 3]) -> Vec3 {
    (b - a).cross(c - a).normalize_or_zero()
}
