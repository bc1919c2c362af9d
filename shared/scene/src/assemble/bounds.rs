//! The scene's bounding sphere.

use beamfarm_render::world::geometry::{Mesh, Object, Shape, bounds};
use beamfarm_render::world::light::SceneBounds;
use glam::{Affine3A, DVec3, Vec3};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Instances of meshes with more vertices than this are bounded by the corners of the mesh's box.
const MANY_VERTICES: usize = 256;

/// Bounds of a shape, render space.
enum Hull<'a> {
    /// Points in object space.
    Points(&'a [Vec3], Affine3A),
    /// A box, and the radius of a ball around its centre.
    Ball(DVec3, DVec3, f64),
}

impl Hull<'_> {
    fn corners(&self) -> (DVec3, DVec3) {
        match self {
            Self::Points(points, map) => points
                .iter()
                .map(|p| map.transform_point3(*p).as_dvec3())
                .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
                    (low.min(p), high.max(p))
                }),
            Self::Ball(low, high, _) => (*low, *high),
        }
    }

    /// Radius around a point that contains all of it.
    fn reach(&self, from: DVec3) -> f64 {
        match self {
            Self::Points(points, map) => points
                .iter()
                .map(|p| map.transform_point3(*p).as_dvec3().distance(from))
                .fold(0.0, f64::max),
            Self::Ball(low, high, radius) => {
                let center = 0.5 * (*low + *high);
                let farthest_corner = (from - center).abs() + 0.5 * (*high - *low);
                (center.distance(from) + radius).min(farthest_corner.length())
            }
        }
    }
}

/// The sphere around all objects and points, a little larger than needed.
pub fn around(objects: &[Object], points: &[DVec3]) -> SceneBounds {
    let mut boxes = BTreeMap::new();
    for object in objects {
        if let Shape::Mesh { mesh, .. } = &object.shape
            && mesh.positions.len() > MANY_VERTICES
        {
            boxes.entry(Arc::as_ptr(mesh)).or_insert_with(|| box_corners(mesh));
        }
    }
    let hulls: Vec<Hull<'_>> = objects.iter().map(|o| hull(&o.shape, &boxes)).collect();

    let corners = hulls.iter().map(Hull::corners);
    let (low, high) = corners
        .chain(points.iter().map(|p| (*p, *p)))
        .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
        .unwrap_or_default();
    let center = (0.5 * (low + high)).as_vec3();
    let from = center.as_dvec3();
    let radius = hulls
        .iter()
        .map(|hull| hull.reach(from))
        .chain(points.iter().map(|p| p.distance(from)))
        .fold(0.0, f64::max);
    SceneBounds {
        center,
        // A scene that is one point still needs a size for lights from infinity.
        radius: if radius > 1e-15 { radius * 1.001 } else { 1.0 } as f32,
    }
}

fn hull<'a>(shape: &'a Shape, boxes: &'a BTreeMap<*const Mesh, [Vec3; 8]>) -> Hull<'a> {
    match shape {
        Shape::Mesh { mesh, placement } => {
            let map = placement.render_from_object;
            let corners = boxes.get(&Arc::as_ptr(mesh));
            match corners.filter(|_| map != Affine3A::IDENTITY) {
                Some(corners) => Hull::Points(corners, map),
                None => Hull::Points(&mesh.positions, map),
            }
        }
        Shape::Strands { .. } => {
            let (low, high) = bounds(shape);
            let (low, high) = (low.as_dvec3(), high.as_dvec3());
            Hull::Ball(low, high, 0.5 * low.distance(high))
        }
        Shape::Sphere { placement, .. } | Shape::Disc { placement, .. } | Shape::Cylinder { placement, .. } => {
            // Radius around its centre, in its own space.
            let from_center = match shape {
                Shape::Cylinder { .. } => 1.25f64.sqrt(),
                _ => 1.0,
            };
            let (low, high) = bounds(shape);
            // The greatest stretch is bounded by the row sums of the Gram matrix (exactly, for similarities).
            let m = placement.render_from_object.matrix3;
            let gram = m.transpose() * m;
            let sum = gram.x_axis.abs() + gram.y_axis.abs() + gram.z_axis.abs();
            let stretch = f64::from(sum.max_element()).sqrt();
            Hull::Ball(low.as_dvec3(), high.as_dvec3(), stretch * from_center)
        }
    }
}

fn box_corners(mesh: &Mesh) -> [Vec3; 8] {
    let [low, high] = mesh.box_corners();
    std::array::from_fn(|i| {
        let pick = |bit: usize, axis: usize| match i & bit {
            0 => low[axis],
            _ => high[axis],
        };
        Vec3::new(pick(1, 0), pick(2, 1), pick(4, 2))
    })
}
