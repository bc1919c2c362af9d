//! Vertices of meshes, and placements of shapes: the data of points that rays meet. `kernels/surface.wgsl` has the same
//! structs.

use super::list;
use super::reason::{Of, Reason, Why};
use crate::device::{Buffer, Device};
use crate::error::Result;
use beamfarm_render::world::Scene;
use beamfarm_render::world::geometry::{Mesh, Object, Placement, Shape};
use bytemuck::{Pod, Zeroable};
use std::collections::HashMap;
use std::sync::Arc;

const FLIPPED: u32 = 1;
const PLACED: u32 = 1 << 1;
const HAS_UV: u32 = 1 << 2;
const HAS_NORMALS: u32 = 1 << 3;
const HAS_OWN_UV: u32 = 1 << 4;
const AMONG_BOUNDARIES: u32 = 1 << 5;
const HAS_COLORS: u32 = 1 << 6;
const HAS_TANGENTS: u32 = 1 << 7;

/// The map from an object's own space to render space, by columns, and properties of its points.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct PlacedShape {
    /// Column of the map.
    pub x_axis: [f32; 3],
    /// Properties of its points, as bits.
    pub bits: u32,
    /// Column of the map.
    pub y_axis: [f32; 3],
    /// First triangle of its mesh.
    pub first_triangle: u32,
    /// Column of the map.
    pub z_axis: [f32; 3],
    /// Largest absolute coordinate that a point of the unit cube may get.
    pub scale: f32,
    /// Column of the map.
    pub translation: [f32; 3],
    /// If vertex colours are used: the texel that the first of all [vertices](Vertex) would have.
    pub first_color: u32,
    /// The same for tangents from files: unit vectors, or twice that length if the y of maps goes to the other side.
    pub first_tangent: u32,
    padding: [u32; 3],
}

/// A corner of triangles, in its mesh's own space.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Vertex {
    /// Position.
    pub position: [f32; 3],
    /// Texture coordinate, zero without one.
    pub u: f32,
    /// Shading normal as in the mesh, zero without one.
    pub normal: [f32; 3],
    /// Texture coordinate.
    pub v: f32,
}

/// All shapes of a scene.
#[derive(Debug)]
pub struct FlatShapes {
    /// By object number.
    pub shapes: Vec<PlacedShape>,
    /// Vertices of all meshes, each mesh once.
    pub vertices: Vec<Vertex>,
    /// Numbers of vertices.
    pub triangles: Vec<[u32; 3]>,
}

/// The meshes of objects, each once.
fn meshes(objects: &[Object]) -> impl Iterator<Item = &Arc<Mesh>> {
    let mut known = HashMap::new();
    let meshes = objects.iter().filter_map(|object| object.shape.mesh());
    meshes.filter(move |mesh| known.insert(Arc::as_ptr(mesh), ()).is_none())
}

/// Number of vertices with a colour.
pub(super) fn colors(objects: &[Object]) -> u64 {
    meshes(objects).map(|mesh| mesh.colors.len() as u64).sum()
}

/// Number of vertices with a given tangent.
pub(super) fn tangents(objects: &[Object]) -> u64 {
    meshes(objects).map(|mesh| mesh.given_tangents.len() as u64).sum()
}

/// Reasons why vertices do not fit a device whose largest buffer has this many bytes.
pub(super) fn reasons(objects: &[Object], largest: u64) -> Vec<Reason> {
    let [mut vertices, mut triangles] = [0; 2];
    for mesh in meshes(objects) {
        vertices += mesh.positions.len() as u64;
        triangles += mesh.triangles.len() as u64;
    }
    let lists = [
        ("vertices", vertices, size_of::<Vertex>()),
        ("corners of triangles", triangles, size_of::<[u32; 3]>()),
        ("places of objects", objects.len() as u64, size_of::<PlacedShape>()),
    ];
    let of_scene = |field, why| Reason {
        of: Of::Scene,
        field,
        why,
    };
    let reason = |(field, count, size): (&'static str, u64, usize)| {
        let bytes = count * size as u64;
        let most = u64::from(u32::MAX);
        match () {
            () if bytes > largest => Some(of_scene(field, Why::Large { bytes, most: largest })),
            () if count > most => Some(of_scene(field, Why::Many { count, most })),
            () => None,
        }
    };
    let strands = objects
        .iter()
        .filter(|object| matches!(object.shape, Shape::Strands { .. }));
    let of_strands = strands.map(|object| Reason {
        of: Of::Object(object.name.clone()),
        field: "type",
        why: Why::Missing("curves and points"),
    });
    lists.into_iter().filter_map(reason).chain(of_strands).collect()
}

impl FlatShapes {
    /// Lays out a scene that passes [`reasons`].
    pub(super) fn new(scene: &Scene) -> Self {
        let objects = &scene.description().objects;
        let mut flat = Self {
            shapes: Vec::with_capacity(objects.len()),
            vertices: Vec::new(),
            triangles: Vec::new(),
        };
        let mut first_of = HashMap::new();
        for mesh in meshes(objects) {
            first_of.insert(Arc::as_ptr(mesh), flat.add(mesh));
        }
        let is_null = |object: &Object| scene.description().materials[object.material as usize].is_null();
        let of_all = u32::from(objects.iter().any(is_null)) * AMONG_BOUNDARIES;
        for (number, object) in (0..).zip(objects) {
            let of_uv = u32::from(scene.geometry().has_uv(number)) * HAS_UV;
            let first = object.shape.mesh().and_then(|mesh| first_of.get(&Arc::as_ptr(mesh)));
            let first = first.copied().unwrap_or_default();
            flat.shapes.push(placed_shape(&object.shape, first, of_all | of_uv));
        }
        flat
    }

    /// Adds a mesh. Returns the number of its first triangle.
    fn add(&mut self, mesh: &Mesh) -> u32 {
        let first_triangle = self.triangles.len() as u32;
        let first = self.vertices.len() as u32;
        let numbers = |corners: &[u32; 3]| corners.map(|corner| first + corner);
        self.triangles.extend(mesh.triangles.iter().map(numbers));
        let vertex = |(number, position): (usize, &beamfarm_render::math::Vec3)| {
            let [u, v] = mesh.uvs.get(number).copied().unwrap_or_default().to_array();
            Vertex {
                position: position.to_array(),
                u,
                normal: mesh.normals.get(number).copied().unwrap_or_default().to_array(),
                v,
            }
        };
        self.vertices.extend(mesh.positions.iter().enumerate().map(vertex));
        first_triangle
    }

    /// Adds vertex colours to the texels, by mesh.
    pub(super) fn add_colors(&mut self, objects: &[Object], texels: &mut Vec<[f32; 3]>) {
        let mut known = HashMap::new();
        for (shape, object) in self.shapes.iter_mut().zip(objects) {
            let Some(mesh) = object.shape.mesh().filter(|mesh| !mesh.colors.is_empty()) else {
                continue;
            };
            let first = *known.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
                let first = texels.len() as u32;
                texels.extend(mesh.colors.iter().map(|color| color.to_array()));
                first
            });
            let first_vertex = (mesh.triangles.first()).map_or(0, |corners| {
                self.triangles[shape.first_triangle as usize][0] - corners[0]
            });
            shape.bits |= HAS_COLORS;
            shape.first_color = first.wrapping_sub(first_vertex);
        }
    }

    /// Adds tangents from files to the texels, by mesh.
    pub(super) fn add_tangents(&mut self, objects: &[Object], texels: &mut Vec<[f32; 3]>) {
        let mut known = HashMap::new();
        for (shape, object) in self.shapes.iter_mut().zip(objects) {
            let Some(mesh) = object.shape.mesh().filter(|mesh| !mesh.given_tangents.is_empty()) else {
                continue;
            };
            let first = *known.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
                let first = texels.len() as u32;
                let length = |w: f32| if w < 0.0 { 2.0 } else { 1.0 };
                texels.extend(
                    mesh.given_tangents
                        .iter()
                        .map(|t| (t.truncate() * length(t.w)).to_array()),
                );
                first
            });
            let first_vertex = (mesh.triangles.first()).map_or(0, |corners| {
                self.triangles[shape.first_triangle as usize][0] - corners[0]
            });
            shape.bits |= HAS_TANGENTS;
            shape.first_tangent = first.wrapping_sub(first_vertex);
        }
    }

    /// Uploads them to a device.
    ///
    /// # Errors
    /// Device errors.
    pub(super) fn upload(&self, device: &Device, there: Option<(&Self, &ShapeBuffers)>) -> Result<ShapeBuffers> {
        let shapes = there.map(|(flat, on)| (&flat.shapes[..], &on.shapes));
        let vertices = there.map(|(flat, on)| (&flat.vertices[..], &on.vertices));
        let triangles = there.map(|(flat, on)| (&flat.triangles[..], &on.triangles));
        Ok(ShapeBuffers {
            shapes: list(device, "places of objects", &self.shapes, shapes)?,
            vertices: list(device, "vertices", &self.vertices, vertices)?,
            triangles: list(device, "corners of triangles", &self.triangles, triangles)?,
        })
    }
}

/// Shapes on a device.
pub struct ShapeBuffers {
    /// Binding 35.
    pub shapes: Buffer,
    /// Binding 36.
    pub vertices: Buffer,
    /// Binding 37.
    pub triangles: Buffer,
}

impl ShapeBuffers {
    /// In binding order, from 35.
    #[must_use]
    pub fn in_order(&self) -> [&Buffer; 3] {
        [&self.shapes, &self.vertices, &self.triangles]
    }
}

fn placed_shape(shape: &Shape, first_triangle: u32, bits: u32) -> PlacedShape {
    let when = |bit: u32, holds: bool| u32::from(holds) * bit;
    let (placement, own) = match shape {
        Shape::Sphere { placement, flip } | Shape::Disc { placement, flip } | Shape::Cylinder { placement, flip } => {
            (placement, when(FLIPPED, *flip))
        }
        Shape::Mesh { mesh, placement } => (
            placement,
            when(PLACED, *placement != Placement::IDENTITY)
                | when(HAS_NORMALS, !mesh.normals.is_empty())
                | when(HAS_OWN_UV, !mesh.uvs.is_empty()),
        ),
        // Such scenes are refused.
        Shape::Strands { placement, .. } => (placement, 0),
    };
    let map = &placement.render_from_object;
    PlacedShape {
        x_axis: map.matrix3.x_axis.to_array(),
        bits: bits | own,
        y_axis: map.matrix3.y_axis.to_array(),
        first_triangle,
        z_axis: map.matrix3.z_axis.to_array(),
        scale: placement.scale(),
        translation: map.translation.to_array(),
        first_color: 0,
        first_tangent: 0,
        padding: [0; 3],
    }
}
