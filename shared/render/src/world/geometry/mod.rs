//! Shapes, objects, and the rays that find them.

pub mod accel;
mod coincident;
mod crowds;
pub mod flat;
mod item;
pub mod mesh;
mod pieces;
mod primitives;
pub mod rectangle;
pub mod shape;
mod slivers;
pub mod strands;
mod tangents;
mod tree;
mod triangles;

pub use accel::Geometry;
pub(crate) use accel::Subset;
pub use coincident::{Faces, coincident};
pub(crate) use item::Near;
pub use mesh::{Mesh, SurfacePoint};
pub use primitives::bounds;
pub(crate) use shape::clearance;
pub use shape::{Placement, Shape, SurfaceHit};
pub use strands::Strands;

use crate::math::Vec3;
use crate::world::medium::MediumId;
use crate::world::texture::graph::Space;
use std::sync::Arc;

/// An object of the scene: a shape, its material, and the media it bounds.
#[derive(Clone, Debug)]
pub struct Object {
    /// Name in the scene file, for messages.
    pub name: String,
    /// Geometry in render space.
    pub shape: Shape,
    /// Index into the scene's materials.
    pub material: u32,
    /// Media on its two sides; `None`: the surrounding medium continues inside.
    pub boundary: Option<Boundary>,
    /// Index into the scene's lights, if it emits.
    pub light: Option<u32>,
    /// Where objects overlap, the one with the higher priority counts; 0 where the scene sets none.
    pub priority: Option<i32>,
    /// Position data for texture graphs, if some read it.
    pub space: Option<Arc<Space>>,
}

impl Object {
    /// A shape without a name, of the scene's first material, and nothing else.
    pub fn new(shape: Shape) -> Self {
        Self {
            name: String::new(),
            shape,
            material: 0,
            boundary: None,
            light: None,
            priority: None,
            space: None,
        }
    }
}

/// The media on the sides of a surface. Inside is the side that the geometric normal points away from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Boundary {
    /// Medium inside.
    pub interior: MediumId,
    /// Medium outside.
    pub exterior: MediumId,
}

impl Boundary {
    /// The medium that a ray in direction `dir` enters at a surface with normal `ng`.
    #[inline]
    pub fn medium_towards(&self, ng: Vec3, dir: Vec3) -> MediumId {
        if ng.dot(dir) < 0.0 {
            self.interior
        } else {
            self.exterior
        }
    }
}
