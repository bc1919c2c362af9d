//! Triangle meshes.

use super::item::{Item, Items};
use super::rectangle::Rectangle;
use super::tree::ItemTree;
use super::triangles::TriangleId;
use crate::math::{Rgb, Vec2, Vec3};
use crate::parallel;
use crate::warp;
use glam::Vec4;
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// A point drawn uniformly by area.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// The point.
    pub point: Vec3,
    /// Unit geometric normal, pointing outside.
    pub normal: Vec3,
    /// Density per area.
    pub pdf_area: f32,
    /// The triangle within a mesh.
    pub primitive: u32,
    /// Within the triangle: the weights of its second and third corner.
    pub weights: Vec2,
}

/// Triangles with optional normals and UVs per vertex. Counter-clockwise seen from outside.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Shading normals, one per vertex, or none at all.
    pub normals: Vec<Vec3>,
    /// UVs, one per vertex, or none at all.
    pub uvs: Vec<Vec2>,
    /// Linear colours, one per vertex, if something reads them, or none at all.
    pub colors: Vec<Rgb>,
    /// The x direction of normal maps, unit vectors or zero; the fourth component is the sign, 1 or -1, of their y
    /// along the cross product of the shading normal with it. One per vertex, if a file gives them and something uses
    /// them, or none at all.
    pub given_tangents: Vec<Vec4>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
    /// Running sum of triangle areas, made on first use.
    pub area_sums: OnceLock<Vec<f64>>,
    /// The rectangle that the mesh forms, if any, found on first use.
    pub rectangle: OnceLock<Option<Rectangle>>,
    /// Per-triangle and per-vertex data of hits, made on first use.
    pub facets: OnceLock<Facets>,
    /// Unit tangents along u by vertex, or zero, made on first use: see `tangents.rs`.
    pub tangents: OnceLock<Vec<Vec3>>,
    /// Whether the mesh is closed, found on first use.
    pub closed: OnceLock<bool>,
    /// Lowest and highest corner of the bounding box, found on first use.
    pub corners: OnceLock<[Vec3; 2]>,
    /// The mesh's hierarchy, built on first placement.
    pub tree: OnceLock<MeshTree>,
}

/// The hierarchy over a mesh's triangles.
#[derive(Clone)]
pub struct MeshTree(pub(super) Arc<ItemTree>);

impl std::fmt::Debug for MeshTree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("MeshTree")
    }
}

/// Shared by all hits of a mesh without a placement.
#[derive(Clone, Debug)]
pub struct Facets {
    of_triangle: Vec<Facet>,
    /// Unit normals by vertex, or zero; empty if the mesh has none.
    normals: Vec<Vec3>,
}

/// Shared by all hits of a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facet {
    /// Unit geometric normal; zero if the triangle has no area.
    pub normal: Vec3,
    /// The largest absolute coordinate of a corner.
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

    /// The point in a triangle for a pair of uniform numbers. `pdf_area`: its density.
    #[inline]
    pub(crate) fn point_in(&self, triangle: u32, u: Vec2, pdf_area: f32) -> SurfacePoint {
        let [a, b, c] = self.corners(triangle);
        let w = warp::uniform_triangle(u);
        SurfacePoint {
            point: a * (1.0 - w.x - w.y) + b * w.x + c * w.y,
            normal: self.facet(triangle).normal,
            pdf_area,
            primitive: triangle,
            weights: w,
        }
    }

    /// Unit geometric normal of a triangle; zero if it has no area.
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

    /// The data shared by all hits of a triangle.
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

    /// Whether each edge is traversed equally often both ways; vertices at the same position count as one.
    pub fn is_closed(&self) -> bool {
        if let Some(closed) = self.closed.get() {
            return *closed;
        }
        // Outside the lock: see `tree`.
        let closed = self.find_closed();
        *self.closed.get_or_init(|| closed)
    }

    /// The volume that the mesh encloses if it is closed, in its own space; negative if its triangles face inwards.
    pub fn signed_volume(&self) -> f64 {
        let of = |triangle: u32| {
            let [a, b, c] = self.corners(triangle).map(|p| p.as_dvec3());
            a.dot(b.cross(c)) / 6.0
        };
        (0..self.triangles.len() as u32).map(of).sum()
    }

    fn find_closed(&self) -> bool {
        // Adding zero turns -0 into +0.
        let key = |v: u32| (self.positions[v as usize] + 0.0).to_array().map(f32::to_bits);
        let edges = |[a, b, c]: &[u32; 3]| {
            [(*a, *b), (*b, *c), (*c, *a)].map(|(from, to)| {
                let (from, to) = (key(from), key(to));
                (from.min(to), from.max(to), from < to)
            })
        };
        let mut edges: Vec<_> = self.triangles.par_iter().flat_map_iter(edges).collect();
        edges.retain(|(from, to, _)| from != to);
        edges.par_sort_unstable();
        let mut all = edges.chunk_by(|one, other| (one.0, one.1) == (other.0, other.1));
        all.all(|edge| 2 * edge.iter().filter(|edge| edge.2).count() == edge.len())
    }

    /// A triangle as an item of an object.
    pub(super) fn item(&self, object: u32, triangle: u32) -> Item {
        Item::Triangle(TriangleId { object, triangle }, self.corners(triangle))
    }

    /// The hierarchy over the triangles, in the mesh's own space.
    pub(super) fn tree(&self) -> &MeshTree {
        if let Some(tree) = self.tree.get() {
            return tree;
        }
        // Outside the lock: a thread that waits for others here may be handed work that waits for the lock.
        let tree = MeshTree(Arc::new(ItemTree::new(self)));
        self.tree.get_or_init(|| tree)
    }

    /// Lowest and highest corner of the box around all vertices, in the mesh's own space; inside out without vertices.
    pub fn box_corners(&self) -> [Vec3; 2] {
        *self.corners.get_or_init(|| {
            let nothing = [Vec3::INFINITY, Vec3::NEG_INFINITY];
            (self.positions.iter()).fold(nothing, |[min, max], &p| [min.min(p), max.max(p)])
        })
    }

    fn facets(&self) -> &Facets {
        match self.facets.get() {
            Some(facets) => facets,
            // Outside the lock: see `tree`.
            None => {
                let facets = self.new_facets();
                self.facets.get_or_init(|| facets)
            }
        }
    }

    /// Makes the data that hits need.
    pub(super) fn prepare_hits(&self) {
        self.facets();
    }

    #[cold]
    #[inline(never)]
    fn new_facets(&self) -> Facets {
        let normals: Vec<Vec3> = parallel::collected(self.normals.par_iter().map(|n| n.normalize_or_zero()));
        let facet = |triangle: &[u32; 3]| {
            let corners = triangle.map(|i| self.positions[i as usize]);
            let [a, b, c] = corners.map(Vec3::abs);
            let at = |i: u32| normals[i as usize];
            Facet {
                normal: normal_of(corners),
                extent: a.max(b).max(c).max_element(),
                curvature: match normals.is_empty() {
                    true => 0.0,
                    false => edge_curvature(corners, triangle.map(at)),
                },
            }
        };
        Facets {
            of_triangle: parallel::collected(self.triangles.par_iter().map(facet)),
            normals,
        }
    }

    /// Whether all vertices lie on or behind the planes of all triangles. Large meshes are not tested.
    pub fn is_convex(&self) -> bool {
        const MAX_TRIANGLES: usize = 256;
        if self.triangles.len() > MAX_TRIANGLES {
            return false;
        }
        let extent = self
            .positions
            .iter()
            .fold(0.0, |max: f32, p| max.max(p.abs().max_element()));
        let tolerance = 1e-5 * extent;
        (0..self.triangles.len() as u32).all(|triangle| {
            let normal = self.normal(triangle);
            let [corner, _, _] = self.corners(triangle);
            self.triangles
                .iter()
                .flatten()
                .all(|&i| (self.positions[i as usize] - corner).dot(normal) <= tolerance)
        })
    }

    /// Whether all triangles face the same way.
    pub fn is_flat(&self) -> bool {
        let first = self.normal(0);
        (0..self.triangles.len() as u32).all(|triangle| self.normal(triangle).dot(first) > 1.0 - 1e-6)
    }

    /// The rectangle that the mesh forms, if any, in its own space.
    #[inline]
    pub fn rectangle(&self) -> Option<&Rectangle> {
        self.rectangle
            .get_or_init(|| match self.triangles.len() {
                2 => Rectangle::of([self.corners(0), self.corners(1)], self.normal(0)),
                _ => None,
            })
            .as_ref()
    }

    /// Running sums of the triangles' areas, in order; the last is the mesh's area, object space.
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

impl Items for Mesh {
    fn count(&self) -> usize {
        self.triangles.len()
    }
    fn item(&self, index: usize) -> Item {
        self.item(0, index as u32)
    }
}

/// Rate at which the interpolated normal turns, averaged over the edges.
pub(super) fn edge_curvature(p: [Vec3; 3], n: [Vec3; 3]) -> f32 {
    let mut sum = 0.0;
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        let edge = p[j] - p[i];
        sum += (n[j] - n[i]).dot(edge) / edge.length_squared().max(f32::MIN_POSITIVE);
    }
    sum / 3.0
}

/// Unit normal of the triangle with these corners; zero if it has no area.
#[inline]
fn normal_of([a, b, c]: [Vec3; 3]) -> Vec3 {
    (b - a).cross(c - a).normalize_or_zero()
}
