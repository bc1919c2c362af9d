//! A sphere around everything.

use crate::light::SceneBounds;
use glam::{DAffine3, DVec3};

/// A sphere around one thing.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    pub center: DVec3,
    pub radius: f64,
}

impl Sphere {
    pub fn point(center: DVec3) -> Self {
        Self {
            center,
            radius: 0.0,
        }
    }

    /// Around the unit sphere under a map. The radius is the map's greatest stretch, which the row sums of its Gram
    /// matrix bound (exactly, for similarities).
    pub fn of_unit_sphere(map: &DAffine3) -> Self {
        let gram = map.matrix3.transpose() * map.matrix3;
        let sum = gram.x_axis.abs() + gram.y_axis.abs() + gram.z_axis.abs();
        Self {
            center: map.translation,
            radius: sum.max_element().sqrt(),
        }
    }

    /// Around points: the centre is that of their box.
    pub fn around(points: impl Iterator<Item = DVec3> + Clone) -> Self {
        let (low, high) = points
            .clone()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
                (low.min(p), high.max(p))
            });
        let center = 0.5 * (low + high);
        let radius = points.map(|p| p.distance(center)).fold(0.0, f64::max);
        Self { center, radius }
    }
}

/// The sphere around all of them, a little larger than needed.
pub fn around(extents: &[Sphere]) -> SceneBounds {
    let corners = extents
        .iter()
        .flat_map(|e| [e.center - e.radius, e.center + e.radius]);
    let center = Sphere::around(corners).center.as_vec3();
    let reach = |e: &Sphere| e.center.distance(center.as_dvec3()) + e.radius;
    let radius = extents.iter().map(reach).fold(0.0, f64::max);
    SceneBounds {
        center,
        // A scene that is one point still needs a size for lights from infinity.
        radius: if radius > 1e-15 { radius * 1.001 } else { 1.0 } as f32,
    }
}
