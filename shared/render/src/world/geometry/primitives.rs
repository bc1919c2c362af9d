//! Ray tests of spheres, discs and cylinders, and boxes around shapes of every kind.

use super::shape::{Placement, Shape, in_object_space};
use crate::math::{Ray, Vec2, Vec3};

/// Where a shape is hit, and the point in object space's x and y for discs.
pub(super) type ShapeHit = Option<(f32, Vec2)>;

/// Shapes made of neither triangles nor strands.
pub(super) fn intersect_shape(shape: &Shape, ray: &Ray, t_max: f32) -> ShapeHit {
    match shape {
        Shape::Sphere { placement, .. } => intersect_sphere(placement, ray, t_max),
        Shape::Disc { placement, .. } => intersect_disc(placement, ray, t_max),
        Shape::Cylinder { placement, .. } => intersect_cylinder(placement, ray, t_max),
        Shape::Mesh { .. } | Shape::Strands { .. } => None,
    }
}

/// Corners of the box around a shape in render space.
pub fn bounds(shape: &Shape) -> (Vec3, Vec3) {
    let extent = |p: &Placement, axes: &[Vec3]| {
        // The maximum of a linear map over the unit ball is the norm of its row.
        let mut sum = Vec3::ZERO;
        for axis in axes {
            let v = p.render_from_object.transform_vector3(*axis);
            sum += v * v;
        }
        let center = Vec3::from(p.render_from_object.translation);
        let half = Vec3::new(sum.x.sqrt(), sum.y.sqrt(), sum.z.sqrt());
        (center - half, center + half)
    };
    match shape {
        Shape::Sphere { placement, .. } => extent(placement, &[Vec3::X, Vec3::Y, Vec3::Z]),
        Shape::Disc { placement, .. } => extent(placement, &[Vec3::X, Vec3::Y]),
        Shape::Cylinder { placement, .. } => {
            let (low, high) = extent(placement, &[Vec3::X, Vec3::Y]);
            let axis = placement.render_from_object.transform_vector3(Vec3::Z);
            (low + axis.min(Vec3::ZERO), high + axis.max(Vec3::ZERO))
        }
        Shape::Strands { strands, placement } => {
            let ends = strands.corners();
            let corner = |i: usize| Vec3::from_array(std::array::from_fn(|axis| ends[i >> axis & 1][axis]));
            let corners = (0..8).map(|i| placement.render_from_object.transform_point3(corner(i)));
            corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| {
                (low.min(p), high.max(p))
            })
        }
        Shape::Mesh { mesh, placement } if *placement == Placement::IDENTITY => {
            let [min, max] = mesh.box_corners();
            (min, max)
        }
        Shape::Mesh { mesh, placement } => {
            mesh.positions
                .iter()
                .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), &p| {
                    let p = placement.render_from_object.transform_point3(p);
                    (min.min(p), max.max(p))
                })
        }
    }
}

/// Ray-sphere test without cancellation (Haines, Günther, Akenine-Möller 2019, Precision improvements for ray/sphere
/// intersection).
fn intersect_sphere(placement: &Placement, ray: &Ray, t_max: f32) -> ShapeHit {
    let (o, d) = in_object_space(placement, ray);
    let a = d.length_squared();
    let b = -o.dot(d);
    let nearest = o + d * (b / a);
    let discriminant = 1.0 - nearest.length_squared();
    if discriminant < 0.0 {
        return None;
    }
    let c = o.length_squared() - 1.0;
    let root = (a * discriminant).sqrt();
    let q = if b >= 0.0 { b + root } else { b - root };
    let (t0, t1) = if q == 0.0 { (0.0, 0.0) } else { (c / q, q / a) };
    let (near, far) = if t0 < t1 { (t0, t1) } else { (t1, t0) };
    let t = if near > 0.0 { near } else { far };
    (t > 0.0 && t < t_max).then_some((t, Vec2::ZERO))
}

/// The same for the cylinder's circular cross-section; then keeps the hits between its ends.
fn intersect_cylinder(placement: &Placement, ray: &Ray, t_max: f32) -> ShapeHit {
    let (o, d) = in_object_space(placement, ray);
    let (o2, d2) = (o.truncate(), d.truncate());
    let a = d2.length_squared();
    if a == 0.0 {
        return None;
    }
    let b = -o2.dot(d2);
    let nearest = o2 + d2 * (b / a);
    let discriminant = 1.0 - nearest.length_squared();
    if discriminant.is_nan() || discriminant < 0.0 {
        return None;
    }
    let c = o2.length_squared() - 1.0;
    let root = (a * discriminant).sqrt();
    let q = if b >= 0.0 { b + root } else { b - root };
    let (t0, t1) = if q == 0.0 { (0.0, 0.0) } else { (c / q, q / a) };
    let (near, far) = if t0 < t1 { (t0, t1) } else { (t1, t0) };
    let hits = |t: &f32| *t > 0.0 && *t < t_max && (0.0..=1.0).contains(&(o.z + d.z * t));
    let t = [near, far].into_iter().find(hits)?;
    Some((t, Vec2::ZERO))
}

fn intersect_disc(placement: &Placement, ray: &Ray, t_max: f32) -> ShapeHit {
    let (o, d) = in_object_space(placement, ray);
    if d.z == 0.0 {
        return None;
    }
    let t = -o.z / d.z;
    let p = (o + d * t).truncate();
    (t > 0.0 && t < t_max && p.length_squared() <= 1.0).then_some((t, p))
}
