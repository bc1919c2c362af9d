//! Shapes, objects, and the rays that find them.

pub mod mesh;
pub mod shape;

pub use mesh::Mesh;
pub use shape::{Shape, SurfaceHit, SurfacePoint};

use crate::medium::MediumId;

/// A thing in the scene: a shape, what it is made of, what it bounds.
#[derive(Clone, Debug)]
pub struct Object {
    /// Name in the scene file, for messages.
    pub name: String,
    /// Geometry in render space.
    pub shape: Shape,
    /// Index into the scene's materials.
    pub material: u32,
    /// Media on its two sides; `None`: whatever is around goes on inside.
    pub boundary: Option<Boundary>,
    /// Index into the scene's lights, when it emits.
    pub light: Option<u32>,
}

/// The media on the sides of a surface. Inside is the side that the geometric normal points away from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Boundary {
    /// Medium inside.
    pub interior: MediumId,
    /// Medium outside.
    pub exterior: MediumId,
}
