//! How a surface's points move with its UV.

use super::mesh::Mesh;
use super::shape::{Placement, Shape, SurfaceHit};
use crate::math::{Frame, PI, Vec3, acos};
use glam::Vec4;

impl Shape {
    /// Derivatives of a hit's point by its UV, as in Mitsuba (on a disc, by arc length). Any two tangents where there
    /// is no UV. On strands the first is along them, of any length.
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
                (mesh.derivatives(hit.primitive)).map_or_else(any, |tangents| place(placement, tangents))
            }
        }
    }

    /// Directions of a normal map's x and y at a hit, of any length, if the mesh's file gives them. Placements do not
    /// mirror.
    #[inline]
    pub fn given_tangents(&self, hit: &SurfaceHit) -> Option<[Vec3; 2]> {
        match self {
            Self::Mesh { mesh, placement } if !mesh.given_tangents.is_empty() => mesh.given_at(hit, placement),
            _ => None,
        }
    }

    /// A tangent along u at a hit, of any length and either sign, that is continuous where the shading normal is. None
    /// where there is no UV.
    pub fn smooth_tangent(&self, hit: &SurfaceHit) -> Option<Vec3> {
        let Self::Mesh { mesh, placement } = self else {
            return Some(self.tangents(hit)[0]);
        };
        if mesh.uvs.is_empty() {
            return None;
        }
        let [du, _] = mesh.derivatives(hit.primitive).unwrap_or_default();
        let own = match mesh.normals.is_empty() {
            true => du,
            false => {
                let point = placement.object_from_render.transform_point3(hit.point);
                mesh.interpolated_tangent(hit.primitive, point, du)
            }
        };
        Some(placement.render_from_object.transform_vector3(own))
    }
}

impl Mesh {
    /// Derivatives of a triangle's points by its UV. None if it has no area in UV.
    fn derivatives(&self, triangle: u32) -> Option<[Vec3; 2]> {
        let [a, b, c] = self.corners(triangle);
        let uv = self.triangles[triangle as usize].map(|i| self.uvs[i as usize]);
        let (p1, p2) = (b - a, c - a);
        let (uv1, uv2) = (uv[1] - uv[0], uv[2] - uv[0]);
        let inverse = 1.0 / uv1.perp_dot(uv2);
        let du = (p1 * uv2.y - p2 * uv1.y) * inverse;
        let dv = (p2 * uv1.x - p1 * uv2.x) * inverse;
        inverse.is_finite().then_some([du, dv])
    }

    /// Interpolates the given tangents of a triangle's vertices. None if nothing but the normal is left.
    #[inline(never)]
    fn given_at(&self, hit: &SurfaceHit, placement: &Placement) -> Option<[Vec3; 2]> {
        let map = &placement.render_from_object;
        let own = self.corners(hit.primitive);
        let [a, b, c] = match *placement == Placement::IDENTITY {
            true => own,
            false => own.map(|p| map.transform_point3(p)),
        };
        let n = (b - a).cross(c - a);
        let area = n.dot(n);
        let weight = |of: f32| if area > 0.0 { (of / area).clamp(0.0, 1.0) } else { 0.0 };
        // Rounding may move a point over the edge.
        let v = weight((a - c).cross(hit.point - c).dot(n));
        let w = weight((b - a).cross(hit.point - a).dot(n));
        let at = self.triangles[hit.primitive as usize].map(|i| self.given_tangents[i as usize]);
        let [at_a, at_b, at_c] = at.map(Vec4::truncate);
        let along = map.transform_vector3(at_a * (1.0 - v - w).max(0.0) + at_b * v + at_c * w);
        let across = hit.ns.cross(along);
        (across.dot(across) > LEAST_ACROSS).then(|| [along, across * at[0].w])
    }

    /// Interpolates the tangents of a triangle's vertices. `du`: of the triangle, or zero.
    fn interpolated_tangent(&self, triangle: u32, point: Vec3, du: Vec3) -> Vec3 {
        let [a, b, c] = self.corners(triangle);
        let (p1, p2, p) = (b - a, c - a, point - a);
        // Barycentric weights, from areas seen along the normal.
        let normal = p1.cross(p2);
        let area = normal.length_squared();
        let (v, w) = match area > 0.0 {
            true => (p.cross(p2).dot(normal) / area, p1.cross(p).dot(normal) / area),
            false => (0.0, 0.0),
        };
        let tangents = self.vertex_tangents();
        let at = self.triangles[triangle as usize].map(|i| tangents[i as usize]);
        let along = if du == Vec3::ZERO { at[0] } else { du };
        let [at_a, at_b, at_c] = at.map(|t| facing(t, along));
        (at_a * (1.0 - v - w) + at_b * v + at_c * w).normalize_or(du)
    }

    /// Unit tangents along u by vertex, perpendicular to its normal, or zero: angle-weighted means over the adjacent
    /// triangles. Where images are mirrored along an edge, both signs count as one.
    fn vertex_tangents(&self) -> &[Vec3] {
        if let Some(tangents) = self.tangents.get() {
            return tangents;
        }
        // Outside the lock: see `tree`.
        let mut tangents = vec![Vec3::ZERO; self.positions.len()];
        for (triangle, vertices) in (0..).zip(&self.triangles) {
            let corners = self.corners(triangle);
            let Some(du) = self.derivatives(triangle).and_then(|[du, _]| du.try_normalize()) else {
                continue;
            };
            for i in 0..3 {
                let to = |j: usize| (corners[(i + j) % 3] - corners[i]).normalize_or_zero();
                let sum = &mut tangents[vertices[i] as usize];
                *sum += facing(du, *sum) * acos(to(1).dot(to(2)).clamp(-1.0, 1.0));
            }
        }
        for (tangent, normal) in tangents.iter_mut().zip(&self.normals) {
            let normal = normal.normalize_or_zero();
            *tangent = (*tangent - normal * normal.dot(*tangent)).normalize_or_zero();
        }
        self.tangents.get_or_init(|| tangents)
    }
}

/// Least squared component of a given tangent perpendicular to the shading normal.
const LEAST_ACROSS: f32 = 1e-12;

/// The tangent or its negative, whichever is nearer to another.
fn facing(tangent: Vec3, other: Vec3) -> Vec3 {
    if tangent.dot(other) < 0.0 { -tangent } else { tangent }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::texture::TexturePoint;

    /// A drum of few sides with the normals of a round one: tangents turn as evenly as normals, from triangle to
    /// triangle and across the edge where half of its UV is mirrored.
    #[test]
    fn tangents_are_as_smooth_as_normals() {
        let sides = 12;
        let around = |i: u32| {
            let (sin, cos) = libm::sincosf(2.0 * PI * i as f32 / sides as f32);
            Vec3::new(cos, sin, 0.0)
        };
        let mut mesh = Mesh::default();
        for i in 0..=sides {
            let n = around(i);
            // Up to half way and back.
            let u = i.min(sides - i) as f32 / sides as f32;
            for z in [0.0, 1.0] {
                mesh.positions.push(n + Vec3::Z * z);
                mesh.normals.push(n);
                mesh.uvs.push(Vec2::new(u, z));
            }
        }
        for i in 0..sides {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| 2 * i + k);
            mesh.triangles.extend([[a, c, d], [a, d, b]]);
        }
        let placement = Placement {
            render_from_object: Affine3A::from_scale(Vec3::splat(2.0)),
            object_from_render: Affine3A::from_scale(Vec3::splat(0.5)),
        };
        let shape = Shape::Mesh {
            mesh: Arc::new(mesh),
            placement,
        };
        let Shape::Mesh { mesh, .. } = &shape else {
            unreachable!()
        };
        for triangle in 0..2 * sides {
            let corners = mesh.corners(triangle);
            let normals = mesh.triangles[triangle as usize].map(|i| mesh.normals[i as usize]);
            for w in [
                [0.98, 0.01, 0.01],
                [0.01, 0.98, 0.01],
                [0.3, 0.5, 0.2],
                [0.01, 0.01, 0.98],
            ] {
                let at = |of: [Vec3; 3]| of[0] * w[0] + of[1] * w[1] + of[2] * w[2];
                let n = at(normals).normalize();
                let hit = SurfaceHit {
                    t: 0.0,
                    point: at(corners) * 2.0,
                    ng: n,
                    ns: n,
                    at: TexturePoint::default(),
                    object: 0,
                    material: 0,
                    boundary: None,
                    primitive: triangle,
                    curvature: 0.0,
                    clearance: 0.0,
                };
                let along = Frame::along(shape.smooth_tangent(&hit).unwrap(), n).s;
                // Seams have the tangents of one side, so interpolation on the other side's triangles is slightly off.
                let off = along.cross(Vec3::Z.cross(n)).length();
                assert!(off < 0.15, "{triangle} {w:?}: {along} {n} {off}");
                let is_seam = [0, sides - 1].contains(&(triangle / 2));
                assert!(is_seam || off < 1e-2, "{triangle} {w:?}: {along} {n} {off}");
            }
        }
    }

    use crate::math::{Ray, Vec2};
    use crate::world::geometry::{Geometry, Mesh, Object};
    use glam::Affine3A;
    use std::sync::Arc;

    /// Neighbouring hits differ by the tangents times the difference of their UV; on a disc, whose second tangent has
    /// unit length in object space, by that over 2 pi times the radius.
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
            let objects = [Object::new(shape)];
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
