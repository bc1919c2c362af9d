//! How a surface's points move with its UV.

use super::shape::{Placement, Shape, SurfaceHit};
use crate::math::{Frame, PI, Vec3};

impl Shape {
    /// Derivatives of a hit's point by its UV, as Mitsuba has them (those of a disc are by the length of an arc). Any
    /// two tangents where there is no UV. Of strands, the first is along them, of any length.
    pub fn tangents(&self, hit: &SurfaceHit) -> [Vec3; 2] {
        let place = |placement: &Placement, tangents: [Vec3; 2]| {
            tangents.map(|t| placement.render_from_object.transform_vector3(t))
        };
        let any = || {
            let frame = Frame::from_normal(hit.ng);
            [frame.s, frame.t]
        };
        match self {
            Self::Sphere { placement, .. } => {
                let p = placement.object_from_render.transform_point3(hit.point);
                let r = p.truncate().length();
                let (cos, sin) = if r > 0.0 { (p.x / r, p.y / r) } else { (1.0, 0.0) };
                let du = if r > 0.0 { Vec3::new(-p.y, p.x, 0.0) } else { Vec3::Y };
                let dv = Vec3::new(p.z * cos, p.z * sin, -r);
                place(placement, [du * (2.0 * PI), dv * PI])
            }
            Self::Cylinder { placement, .. } => {
                let p = placement.object_from_render.transform_point3(hit.point);
                place(placement, [Vec3::new(-p.y, p.x, 0.0) * (2.0 * PI), Vec3::Z])
            }
            Self::Disc { placement, .. } => {
                let p = placement.object_from_render.transform_point3(hit.point);
                let out = Vec3::new(p.x, p.y, 0.0).normalize_or(Vec3::X);
                place(placement, [out, Vec3::Z.cross(out)])
            }
            Self::Mesh { mesh, .. } if mesh.uvs.is_empty() => any(),
            Self::Strands { strands, placement } => {
                let along = strands.tangent(hit.primitive, hit.at.uv.x);
                let du = placement.render_from_object.transform_vector3(along);
                [du, hit.ng.cross(du)]
            }
            Self::Mesh { mesh, placement } => {
                let [a, b, c] = mesh.corners(hit.primitive);
                let uv = mesh.triangles[hit.primitive as usize].map(|i| mesh.uvs[i as usize]);
                let (p1, p2) = (b - a, c - a);
                let (uv1, uv2) = (uv[1] - uv[0], uv[2] - uv[0]);
                let inverse = 1.0 / uv1.perp_dot(uv2);
                if !inverse.is_finite() {
                    return any();
                }
                let du = (p1 * uv2.y - p2 * uv1.y) * inverse;
                let dv = (p2 * uv1.x - p1 * uv2.x) * inverse;
                place(placement, [du, dv])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Ray, Vec2};
    use crate::world::geometry::{Geometry, Mesh, Object};
    use glam::Affine3A;
    use std::sync::Arc;

    /// Neighbouring hits differ by the tangents times the difference of their UV; on a disc, whose second tangent is of
    /// unit length in its own space, by that over 2 pi times the radius.
    #[test]
    fn tangents_are_derivatives_of_points() {
        let render_from_object = Affine3A::from_scale_rotation_translation(
            Vec3::new(1.5, 0.8, 1.1),
            glam::Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.7),
            Vec3::new(0.2, -0.1, 0.3),
        );
        let placement = Placement {
            render_from_object,
            object_from_render: render_from_object.inverse(),
        };
        let mesh = Mesh {
            positions: vec![
                Vec3::new(-2.0, -2.0, 0.3),
                Vec3::new(3.0, -1.0, 0.0),
                Vec3::new(0.0, 3.0, 0.1),
            ],
            uvs: vec![Vec2::ZERO, Vec2::new(0.7, 0.2), Vec2::new(-0.1, 0.9)],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        for shape in [
            Shape::Sphere { placement, flip: false },
            Shape::Cylinder { placement, flip: true },
            Shape::Disc { placement, flip: false },
            Shape::Mesh {
                mesh: Arc::new(mesh),
                placement,
            },
        ] {
            let disc = matches!(shape, Shape::Disc { .. });
            let objects = [Object {
                name: String::new(),
                shape,
                material: 0,
                boundary: None,
                light: None,
                priority: None,
                space: None,
            }];
            let geometry = Geometry::new(&objects);
            let along = placement
                .render_from_object
                .transform_vector3(Vec3::new(-1.2, -0.3, -0.9));
            let hit = |x: f32, y: f32| {
                let target = Vec3::new(0.35 + x, 0.25 + y, 0.5);
                let target = placement.render_from_object.transform_point3(target);
                let dir = along.normalize();
                let origin = target - dir * 5.0;
                let ray = Ray { origin, dir };
                geometry.intersect(&objects, &ray, f32::INFINITY, &|_| false)
            };
            let here = hit(0.0, 0.0).expect("a hit");
            let [du, dv] = objects[0].shape.tangents(&here);
            for (x, y) in [(2e-3, 0.0), (0.0, 2e-3)] {
                let there = hit(x, y).expect("a hit");
                let uv = there.at.uv - here.at.uv;
                let object = placement.object_from_render.transform_point3(here.point);
                let arc = match disc {
                    true => 2.0 * PI * object.truncate().length(),
                    false => 1.0,
                };
                let expected = du * uv.x + dv * (uv.y * arc);
                let moved = there.point - here.point;
                assert!(
                    (moved - expected).length() < 0.02 * moved.length(),
                    "{:?}: {moved} {expected}",
                    objects[0].shape
                );
            }
        }
    }
}
