//! Where a graph is evaluated, and for which viewer.

use crate::math::Vec3;
use glam::Affine3A;

/// An object's position data for graphs.
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    /// Offset from render space to world space.
    pub world_from_render: Vec3,
    /// World space to the object's own coordinates.
    pub own_from_world: Affine3A,
    /// Lowest and highest corner of the object in its own coordinates.
    pub bounds: [Vec3; 2],
    /// A number in [0, 1], almost certainly unique to the object.
    pub random: f32,
    /// The object's number.
    pub index: f32,
    /// The object's location in the world.
    pub location: Vec3,
    /// Distance between height lookups for slopes, scene units.
    pub step: f32,
}

/// The viewer of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Viewer {
    /// The camera, directly or through hidden objects.
    Camera,
    /// A shadow ray.
    Shadow,
    /// A photon.
    Photon,
    /// A camera path that has turned, or any other viewer.
    #[default]
    Other,
}

/// The inputs of a graph at a point, except UV and vertex colours.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// World coordinates.
    pub world: Vec3,
    /// The object's own coordinates.
    pub own: Vec3,
    /// Coordinates in the object's bounding box, from (0, 0, 0) to (1, 1, 1).
    pub generated: Vec3,
    /// Unit shading normal, on the viewer's side.
    pub normal: Vec3,
    /// Unit geometric normal, on that side.
    pub true_normal: Vec3,
    /// Unit shading normal in the object's own coordinates, outwards.
    pub own_normal: Vec3,
    /// The object's location.
    pub location: Vec3,
    /// Unit vector to the viewer.
    pub wo: Vec3,
    /// The object's random number.
    pub random: f32,
    /// The object's number.
    pub index: f32,
    /// The surface is seen from inside.
    pub is_behind: bool,
    /// The viewer.
    pub viewer: Viewer,
}

impl Place {
    /// The origin, seen from there.
    pub const NOWHERE: Self = Self {
        world: Vec3::ZERO,
        own: Vec3::ZERO,
        generated: Vec3::ZERO,
        normal: Vec3::ZERO,
        true_normal: Vec3::ZERO,
        own_normal: Vec3::ZERO,
        location: Vec3::ZERO,
        wo: Vec3::ZERO,
        random: 0.0,
        index: 0.0,
        is_behind: false,
        viewer: Viewer::Other,
    };
}

impl Space {
    /// A point of render space with these unit normals, the geometric one outwards, seen from `wo`.
    pub fn place(&self, point: Vec3, ng: Vec3, ns: Vec3, wo: Vec3) -> Place {
        let is_behind = ng.dot(wo) < 0.0;
        let world = point + self.world_from_render;
        let own = self.own_from_world.transform_point3(world);
        Place {
            world,
            own,
            generated: self.generated(own),
            normal: if is_behind { -ns } else { ns },
            true_normal: if is_behind { -ng } else { ng },
            own_normal: self.normal(ns),
            location: self.location,
            wo,
            random: self.random,
            index: self.index,
            is_behind,
            viewer: Viewer::Other,
        }
    }

    /// Transforms a world-space normal to the object's own coordinates, with the transpose of the inverse map.
    fn normal(&self, n: Vec3) -> Vec3 {
        let back = self.own_from_world.matrix3.inverse();
        Vec3::from(back.transpose() * glam::Vec3A::from(n)).normalize_or_zero()
    }

    /// The tangent at a place, of any length, of circles around an axis of the object's bounding box (Cycles's radial
    /// tangents).
    pub fn around(&self, axis: usize, place: &Place) -> Vec3 {
        let mut unit = Vec3::ZERO;
        unit[axis] = 1.0;
        let own = unit.cross(place.generated - 0.5);
        Vec3::from(self.own_from_world.matrix3.transpose() * glam::Vec3A::from(own))
    }

    /// The same place, displaced in the world.
    pub fn moved(&self, place: &Place, by: Vec3) -> Place {
        let own = place.own + self.own_from_world.transform_vector3(by);
        Place {
            world: place.world + by,
            own,
            generated: self.generated(own),
            ..*place
        }
    }

    fn generated(&self, own: Vec3) -> Vec3 {
        let [low, high] = self.bounds;
        let size = high - low;
        // Flat extents map to the middle.
        let along = |p: f32, low: f32, size: f32| if size > 0.0 { (p - low) / size } else { 0.5 };
        Vec3::new(
            along(own.x, low.x, size.x),
            along(own.y, low.y, size.y),
            along(own.z, low.z, size.z),
        )
    }
}
