//! The items that trees are built over, and what they find near a segment.

use super::triangles::TriangleId;
use crate::math::Vec3;
use crate::wide::padded;
use obvhs::Boundable;
use obvhs::aabb::Aabb;

/// An item of a tree.
pub(super) enum Item {
    /// A triangle by its corners.
    Triangle(TriangleId, [Vec3; 3]),
    /// A tree of slivers: its number, and the corners of its bounding box.
    Slivers(u32, [Vec3; 2]),
    /// Anything else: a number, and the corners of its bounding box.
    Other(u32, [Vec3; 2]),
}

impl Boundable for Item {
    fn aabb(&self) -> Aabb {
        match self {
            Self::Triangle(_, [a, b, c]) => padded(a.min(*b).min(*c), a.max(*b).max(*c)),
            Self::Slivers(_, [min, max]) | Self::Other(_, [min, max]) => padded(*min, *max),
        }
    }
}

/// Items by number, made on demand: a list of them would take as much memory as the tree.
pub(super) trait Items: Sync {
    /// The number of items.
    fn count(&self) -> usize;
    /// One of them.
    fn item(&self, index: usize) -> Item;
}

/// Something near a segment, by its object.
pub(crate) enum Near {
    Triangle(u32, [Vec3; 3]),
    Other(u32),
}
