//! Ray queries: obvhs hierarchies over objects and, below them, over the triangles of each mesh.

use super::Object;
use super::mesh::Mesh;
use super::shape::{Placement, RawHit, Shape, SurfaceHit};
use crate::math::{Ray, Vec2, Vec3};
use glam::Vec3A;
use obvhs::Boundable;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh};
use obvhs::ray::RayHit;
use std::sync::Arc;
use std::time::Duration;

/// The objects of a scene, ready for rays.
pub struct Geometry {
    objects: Bvh2,
    /// By object: index into `meshes`, when it is one.
    mesh_of: Vec<Option<usize>>,
    meshes: Vec<MeshBvh>,
}

struct MeshBvh {
    mesh: Arc<Mesh>,
    /// Of the mesh enlarged by `scale`.
    bvh: CwBvh,
    scale: f32,
}

/// Size that a mesh is given in its hierarchy. obvhs 0.4 takes no box of a wide hierarchy that a ray leaves before its
/// parameter is 1e-4, whatever is in it: in a mesh of this size, that is less than its coordinates' rounding.
const SIZE_IN_BVH: f32 = 131_072.0;

/// The power of two at or below a number, within bounds that nothing real comes near; 1 for 0 and what is no number.
fn power_of_two(x: f32) -> f32 {
    let power = f32::from_bits(x.to_bits() & 0x7f80_0000);
    if power.is_finite() && power > 0.0 {
        power.clamp(1e-30, 1e30)
    } else {
        1.0
    }
}

struct Bounds(Aabb);

impl Boundable for Bounds {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

/// A box grown by a few roundings, so that rays along its faces and flat boxes are not missed.
fn padded(min: Vec3, max: Vec3) -> Bounds {
    let pad = (min.abs().max(max.abs()).max_element() * 1e-6).max(1e-30);
    Bounds(Aabb::new(Vec3A::from(min - pad), Vec3A::from(max + pad)))
}

impl std::fmt::Debug for Geometry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Geometry({} objects)", self.mesh_of.len())
    }
}

impl Geometry {
    /// Build the hierarchies. Deterministic: the same objects give the same trees.
    pub fn new(objects: &[Object]) -> Self {
        let mut meshes: Vec<MeshBvh> = Vec::new();
        let mut mesh_of = Vec::with_capacity(objects.len());
        for object in objects {
            mesh_of.push(match &object.shape {
                Shape::Mesh { mesh, .. } => {
                    let known = meshes.iter().position(|m| Arc::ptr_eq(&m.mesh, mesh));
                    Some(known.unwrap_or_else(|| {
                        meshes.push(MeshBvh::new(mesh));
                        meshes.len() - 1
                    }))
                }
                _ => None,
            });
        }
        let bounds: Vec<Bounds> = objects
            .iter()
            .map(|object| {
                let (min, max) = bounds(&object.shape);
                padded(min, max)
            })
            .collect();
        Self {
            objects: build_bvh2(
                &bounds,
                BvhBuildParams {
                    max_prims_per_leaf: 1,
                    ..BvhBuildParams::medium_build()
                },
                &mut Duration::default(),
            ),
            mesh_of,
            meshes,
        }
    }

    /// The closest hit in (0, t_max), if any. `ignore` gives objects to pass through.
    pub fn intersect(
        &self,
        objects: &[Object],
        ray: &Ray,
        t_max: f32,
        ignore: impl Fn(u32) -> bool,
    ) -> Option<SurfaceHit> {
        let raw = self.search(objects, ray, t_max, ignore, false)?;
        let shape = &objects[raw.object as usize].shape;
        Some(shape.finish(raw, ray.origin, ray.dir))
    }

    /// Whether anything is hit in (0, t_max).
    pub fn occluded(
        &self,
        objects: &[Object],
        ray: &Ray,
        t_max: f32,
        ignore: impl Fn(u32) -> bool,
    ) -> bool {
        self.search(objects, ray, t_max, ignore, true).is_some()
    }

    fn search(
        &self,
        objects: &[Object],
        ray: &Ray,
        t_max: f32,
        ignore: impl Fn(u32) -> bool,
        any: bool,
    ) -> Option<RawHit> {
        let mut best: Option<RawHit> = None;
        let obvhs_ray = obvhs_ray(ray.origin, ray.dir, t_max);
        let mut unused = RayHit::none();
        self.objects.ray_traverse(obvhs_ray, &mut unused, |r, i| {
            let object = self.objects.primitive_indices[i];
            if ignore(object) {
                return f32::INFINITY;
            }
            let hit = match &objects[object as usize].shape {
                Shape::Sphere { placement, .. } => intersect_sphere(placement, ray, r.tmax),
                Shape::Disc { placement, .. } => intersect_disc(placement, ray, r.tmax),
                Shape::Cylinder { placement, .. } => intersect_cylinder(placement, ray, r.tmax),
                Shape::Mesh { placement, .. } => self.mesh_of[object as usize]
                    .and_then(|m| self.meshes[m].intersect(placement, ray, r.tmax, any)),
            };
            match hit {
                Some((t, primitive, uv)) => {
                    best = Some(RawHit {
                        t,
                        object,
                        primitive,
                        uv,
                    });
                    // Any hit will do: an empty range ends the traversal.
                    if any { -1.0 } else { t }
                }
                None => f32::INFINITY,
            }
        });
        best
    }
}

type ShapeHit = Option<(f32, u32, Vec2)>;

fn obvhs_ray(origin: Vec3, dir: Vec3, t_max: f32) -> obvhs::ray::Ray {
    // The hierarchies take a negative zero for a direction to nowhere. Adding zero makes it a positive one.
    obvhs::ray::Ray::new(
        Vec3A::from(origin),
        Vec3A::from(dir) + Vec3A::ZERO,
        0.0,
        t_max,
    )
}

/// Corners of the box around a shape in render space.
pub fn bounds(shape: &Shape) -> (Vec3, Vec3) {
    let extent = |p: &Placement, axes: &[Vec3]| {
        // The extreme of a linear map over the unit ball spanned by the axes is the norm of its row.
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

/// Sphere and ray without cancellation (Haines, Günther, Akenine-Möller 2019, Precision improvements for ray/sphere
/// intersection).
fn intersect_sphere(placement: &Placement, ray: &Ray, t_max: f32) -> ShapeHit {
    let o = placement.object_from_render.transform_point3(ray.origin);
    let d = placement.object_from_render.transform_vector3(ray.dir);
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
    (t > 0.0 && t < t_max).then_some((t, 0, Vec2::ZERO))
}

/// The same for the circle that the cylinder is across its axis; then which of the two lie between its ends.
fn intersect_cylinder(placement: &Placement, ray: &Ray, t_max: f32) -> ShapeHit {
    let o = placement.object_from_render.transform_point3(ray.origin);
    let d = placement.object_from_render.transform_vector3(ray.dir);
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
    Some((t, 0, Vec2::ZERO))
}

fn intersect_disc(placement: &Placement, ray: &Ray, t_max: f32) -> ShapeHit {
    let o = placement.object_from_render.transform_point3(ray.origin);
    let d = placement.object_from_render.transform_vector3(ray.dir);
    if d.z == 0.0 {
        return None;
    }
    let t = -o.z / d.z;
    let p = (o + d * t).truncate();
    (t > 0.0 && t < t_max && p.length_squared() <= 1.0).then_some((t, 0, p))
}

impl MeshBvh {
    fn new(mesh: &Arc<Mesh>) -> Self {
        let extent = mesh
            .positions
            .iter()
            .fold(0.0, |extent: f32, p| extent.max(p.abs().max_element()));
        // Powers of two, so that nothing is rounded on the way there and back.
        let scale = SIZE_IN_BVH / power_of_two(extent);
        let bounds: Vec<Bounds> = (0..mesh.triangles.len())
            .map(|i| {
                let [a, b, c] = mesh.corners(i as u32).map(|corner| corner * scale);
                padded(a.min(b).min(c), a.max(b).max(c))
            })
            .collect();
        Self {
            mesh: mesh.clone(),
            bvh: build_cwbvh(
                &bounds,
                BvhBuildParams::medium_build(),
                &mut Duration::default(),
            ),
            scale,
        }
    }

    fn intersect(&self, placement: &Placement, ray: &Ray, t_max: f32, any: bool) -> ShapeHit {
        let (origin, dir) = if *placement == Placement::IDENTITY {
            (ray.origin, ray.dir)
        } else {
            (
                placement.object_from_render.transform_point3(ray.origin),
                placement.object_from_render.transform_vector3(ray.dir),
            )
        };
        let sheared = ShearedRay::new(origin, dir);
        let mut best = None;
        let mut unused = RayHit::none();
        // In the hierarchy directions are about as long as one, and so parameters larger by:
        let length = power_of_two(dir.abs().max_element());
        let stretch = self.scale * length;
        let ray = obvhs_ray(origin * self.scale, dir / length, t_max * stretch);
        self.bvh.ray_traverse(ray, &mut unused, |r, i| {
            let triangle = self.bvh.primitive_indices[i];
            match sheared.intersect(self.mesh.corners(triangle), r.tmax / stretch) {
                Some((t, w)) => {
                    best = Some((t, triangle, w));
                    if any { -1.0 } else { t * stretch }
                }
                None => f32::INFINITY,
            }
        });
        best
    }
}

/// A ray sheared so that it runs along +z: triangle tests without leaks along edges (Woop, Benthin, Wald 2013,
/// Watertight ray/triangle intersection).
struct ShearedRay {
    origin: Vec3,
    axes: [usize; 3],
    shear: Vec3,
}

impl ShearedRay {
    fn new(origin: Vec3, dir: Vec3) -> Self {
        let z = dir.abs().max_position();
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let (x, y) = if dir[z] < 0.0 { (y, x) } else { (x, y) };
        Self {
            origin,
            axes: [x, y, z],
            shear: Vec3::new(dir[x] / dir[z], dir[y] / dir[z], 1.0 / dir[z]),
        }
    }

    #[inline]
    fn project(&self, p: Vec3) -> Vec3 {
        let p = p - self.origin;
        let [x, y, z] = self.axes;
        Vec3::new(
            p[x] - self.shear.x * p[z],
            p[y] - self.shear.y * p[z],
            self.shear.z * p[z],
        )
    }

    /// Distance and barycentric weights of the second and third corner.
    #[inline]
    fn intersect(&self, corners: [Vec3; 3], t_max: f32) -> Option<(f32, Vec2)> {
        let [a, b, c] = corners.map(|p| self.project(p));
        let mut u = c.x * b.y - c.y * b.x;
        let mut v = a.x * c.y - a.y * c.x;
        let mut w = b.x * a.y - b.y * a.x;
        if u == 0.0 || v == 0.0 || w == 0.0 {
            // On an edge as far as single precision can tell: decide in double, where the products are exact.
            let cross =
                |p: Vec3, q: Vec3| (p.x as f64 * q.y as f64 - p.y as f64 * q.x as f64) as f32;
            u = cross(c, b);
            v = cross(a, c);
            w = cross(b, a);
        }
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let det = u + v + w;
        if det == 0.0 {
            return None;
        }
        let t = (u * a.z + v * b.z + w * c.z) / det;
        (t > 0.0 && t < t_max).then(|| (t, Vec2::new(v / det, w / det)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Object;
    use glam::Affine3A;

    /// A box whose walls a ray meets at once when it starts near them, of any size, in its place or put there.
    #[test]
    fn near_surfaces_are_hit_at_any_scale() {
        let corner = |i: u32| {
            let side = |bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            Vec3::new(side(0), side(1), side(2))
        };
        let triangles = vec![
            [0, 2, 1],
            [1, 2, 3],
            [4, 5, 6],
            [5, 7, 6],
            [0, 1, 4],
            [1, 5, 4],
            [2, 6, 3],
            [3, 6, 7],
            [0, 4, 2],
            [2, 4, 6],
            [1, 3, 5],
            [3, 7, 5],
        ];
        for exponent in -9..=9 {
            let size = libm::exp10f(exponent as f32);
            for placed in [false, true] {
                let mesh_size = if placed { 1.0 } else { size };
                let positions = (0..8).map(|i| corner(i) * mesh_size).collect();
                let mesh = Mesh {
                    positions,
                    triangles: triangles.clone(),
                    ..Mesh::default()
                };
                let placement = match placed {
                    true => Placement {
                        render_from_object: Affine3A::from_scale(Vec3::splat(size)),
                        object_from_render: Affine3A::from_scale(Vec3::splat(1.0 / size)),
                    },
                    false => Placement::IDENTITY,
                };
                let objects = [Object {
                    name: String::new(),
                    shape: Shape::Mesh {
                        mesh: Arc::new(mesh),
                        placement,
                    },
                    material: 0,
                    boundary: None,
                    light: None,
                }];
                let geometry = Geometry::new(&objects);
                for near in [1e-5f32, 1e-3, 0.5] {
                    for axis in 0..3 {
                        let mut origin = Vec3::new(0.3, 0.2, -0.1);
                        origin[axis] = 1.0 - near;
                        let mut dir = Vec3::new(0.01, -0.02, 0.015);
                        dir[axis] = 1.0;
                        let ray = Ray {
                            origin: origin * size,
                            dir: dir.normalize(),
                        };
                        let hit = geometry.intersect(&objects, &ray, f32::INFINITY, |_| false);
                        let t = hit.map_or(f32::NAN, |hit| hit.t / size);
                        let expected = near * dir.length();
                        assert!(
                            (t - expected).abs() < 1e-6 + 1e-3 * expected,
                            "size {size}, placed {placed}, {near}: {t}"
                        );
                    }
                }
            }
        }
    }
}
