//! Shapes, objects, and the rays that find them.

pub mod accel;
pub mod mesh;
pub mod shape;

pub use accel::{Geometry, bounds, spawn_ray};
pub use mesh::Mesh;
pub use shape::{Placement, Shape, SurfaceHit, SurfacePoint};

use crate::math::Vec3;
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

/// `point` moved along the unit vector `n` by a distance that grows with the coordinates' rounding error (Wächter and
/// Binder 2019, A fast and robust method for avoiding self-intersection).
#[inline]
pub fn offset_point(point: Vec3, n: Vec3) -> Vec3 {
    const ORIGIN: f32 = 1.0 / 32.0;
    const FLOAT_SCALE: f32 = 1.0 / 65536.0;
    const INT_SCALE: f32 = 256.0;
    let shift = |p: f32, n: f32| {
        if p.abs() < ORIGIN {
            p + FLOAT_SCALE * n
        } else {
            let steps = (INT_SCALE * n) as i32;
            let steps = if p < 0.0 { -steps } else { steps };
            f32::from_bits((p.to_bits() as i32).wrapping_add(steps) as u32)
        }
    };
    Vec3::new(
        shift(point.x, n.x),
        shift(point.y, n.y),
        shift(point.z, n.z),
    )
}
