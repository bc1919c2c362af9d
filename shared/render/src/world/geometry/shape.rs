//! Shapes: what a hit on them looks like, and how to draw points on them. The search for hits is in `accel`.

use super::mesh::{self, Mesh, SurfacePoint};
use super::strands::{Basis, StrandHit, Strands};
use super::{Boundary, Object};
use crate::math::{PI, Ray, Rgb, Vec2, Vec3, acos, atan2, sin_cos};
use crate::warp;
use crate::world::texture::TexturePoint;
use crate::world::texture::graph::Place;
use glam::Affine3A;
use std::sync::Arc;

/// A shape in render space. Rectangles and cubes are meshes.
#[derive(Clone, Debug)]
pub enum Shape {
    /// A sphere of radius 1 around the origin under `placement`.
    Sphere {
        /// Its position and orientation.
        placement: Placement,
        /// The surface's outside faces inwards.
        flip: bool,
    },
    /// The disc of radius 1 in the xy plane, normal +z, under `placement`.
    Disc {
        /// Its position and orientation.
        placement: Placement,
        /// Its normal is -z.
        flip: bool,
    },
    /// The side of the cylinder of radius 1 around the z axis from z = 0 to 1, open at both ends, under `placement`.
    Cylinder {
        /// Its position and orientation.
        placement: Placement,
        /// Its normal points to the axis.
        flip: bool,
    },
    /// A mesh; instances share it.
    Mesh {
        /// Vertices in object space.
        mesh: Arc<Mesh>,
        /// Its position and orientation. The determinant is positive, so that triangles keep their winding.
        placement: Placement,
    },
    /// Curves, which rays meet from outside only, or balls; instances share them. They do not emit.
    Strands {
        /// In object space.
        strands: Arc<Strands>,
        /// Their position and orientation.
        placement: Placement,
    },
}

/// An invertible affine map and its inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Object to render space.
    pub render_from_object: Affine3A,
    /// Render to object space.
    pub object_from_render: Affine3A,
}

impl Placement {
    /// Nothing moves.
    pub const IDENTITY: Self = Self {
        render_from_object: Affine3A::IDENTITY,
        object_from_render: Affine3A::IDENTITY,
    };

    /// The direction, not normalised, of the normal with object-space direction `n`.
    #[inline]
    pub fn normal(&self, n: Vec3) -> Vec3 {
        let m = &self.object_from_render.matrix3;
        Vec3::new(
            Vec3::from(m.x_axis).dot(n),
            Vec3::from(m.y_axis).dot(n),
            Vec3::from(m.z_axis).dot(n),
        )
    }

    /// Largest absolute coordinate that a point of the unit cube may get.
    #[inline]
    pub fn scale(&self) -> f32 {
        let m = &self.render_from_object;
        let axes = m.matrix3.x_axis.abs() + m.matrix3.y_axis.abs() + m.matrix3.z_axis.abs();
        (axes + m.translation.abs()).max_element()
    }

    /// The scale factor, if the map is a similarity up to rounding.
    pub fn uniform_scale(&self) -> Option<f32> {
        let m = &self.render_from_object.matrix3;
        let length2 = m.x_axis.length_squared();
        let tolerance = 1e-5 * length2;
        let even = (m.y_axis.length_squared() - length2).abs() <= 2.0 * tolerance
            && (m.z_axis.length_squared() - length2).abs() <= 2.0 * tolerance
            && m.x_axis.dot(m.y_axis).abs() <= tolerance
            && m.y_axis.dot(m.z_axis).abs() <= tolerance
            && m.z_axis.dot(m.x_axis).abs() <= tolerance;
        even.then(|| length2.sqrt())
    }

    /// Factor by which a small area with object-space unit normal `n` grows.
    #[inline]
    fn area_stretch(&self, n: Vec3) -> f32 {
        self.render_from_object.matrix3.determinant().abs() * self.normal(n).length()
    }

    /// Factor by which a small area shrinks in object space; `normal`: its unit normal in render space.
    #[inline]
    fn area_shrink(&self, normal: Vec3) -> f32 {
        let m = &self.render_from_object.matrix3;
        let n = Vec3::new(
            Vec3::from(m.x_axis).dot(normal),
            Vec3::from(m.y_axis).dot(normal),
            Vec3::from(m.z_axis).dot(normal),
        );
        // The inverse transpose maps n / |n| to a vector of length 1 / |n|.
        n.length() / m.determinant().abs()
    }
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceHit {
    /// Distance along the ray.
    pub t: f32,
    /// The point, placed on the surface itself rather than at `origin + t dir`.
    pub point: Vec3,
    /// Unit geometric normal, pointing outside.
    pub ng: Vec3,
    /// Unit shading normal, in the hemisphere of `ng`.
    pub ns: Vec3,
    /// Position for texture lookups.
    pub at: TexturePoint,
    /// Index into the scene's objects.
    pub object: u32,
    /// Index into the scene's materials, at the hit.
    pub material: u32,
    /// Media on the two sides at the hit; `None`: the surrounding medium continues inside.
    pub boundary: Option<Boundary>,
    /// Triangle within a mesh.
    pub primitive: u32,
    /// Derivative of the shading normal with displacement along the surface: `dn = curvature * dp`. 1/radius for
    /// spheres, half of that for cylinders, zero for flat facets, the mean over the edges for interpolated normals.
    pub curvature: f32,
    /// Distance to move off the surface so as not to meet it again: some tens of roundings of the numbers involved.
    pub clearance: f32,
}

impl SurfaceHit {
    /// The ray that leaves the surface towards the unit vector `dir`.
    #[inline]
    pub fn spawn_ray(&self, dir: Vec3) -> Ray {
        let side = if self.ng.dot(dir) < 0.0 {
            -self.clearance
        } else {
            self.clearance
        };
        Ray {
            origin: self.point + self.ng * side,
            dir,
        }
    }

    /// A ray from the hit to the point at `distance` (may be infinite) in direction `dir`, and that point's distance
    /// from the ray's start. The ray is aimed afresh after moving off the surface; otherwise it would miss near points.
    #[inline]
    pub fn ray_to(&self, dir: Vec3, distance: f32) -> (Ray, f32) {
        let ray = self.spawn_ray(dir);
        let way = self.point + dir * distance - ray.origin;
        let length = way.length();
        if !(length > 0.0 && length < f32::INFINITY) {
            return (ray, distance);
        }
        let dir = way / length;
        (Ray { dir, ..ray }, length)
    }
}

/// Distances are the same in object space, where directions have any length.
#[inline]
pub(super) fn in_object_space(placement: &Placement, ray: &Ray) -> (Vec3, Vec3) {
    let map = &placement.object_from_render;
    (map.transform_point3(ray.origin), map.transform_vector3(ray.dir))
}

/// A clearance for coordinates of magnitude `scale`.
#[inline]
pub(crate) fn clearance(scale: f32) -> f32 {
    (scale * 4e-6).max(1e-30)
}

/// A hit as the search finds it.
#[derive(Clone, Copy, Debug)]
pub(super) struct RawHit {
    pub t: f32,
    pub object: u32,
    pub primitive: u32,
    /// Barycentric weights of the second and third corner; the point in object space's x and y for discs; for strands
    /// the position along the piece.
    pub uv: Vec2,
}

impl Shape {
    /// Extent of a round shape along a direction: the largest dot product with any of its points. None for meshes and
    /// strands.
    pub(crate) fn reach(&self, along: Vec3) -> Option<f32> {
        let by = |placement: &Placement| {
            let m = &placement.render_from_object;
            let axes = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(|axis| Vec3::from(axis).dot(along));
            (Vec3::from(m.translation).dot(along), axes)
        };
        match self {
            Self::Mesh { .. } | Self::Strands { .. } => None,
            Self::Sphere { placement, .. } => {
                let (middle, [x, y, z]) = by(placement);
                Some(middle + (x * x + y * y + z * z).sqrt())
            }
            Self::Disc { placement, .. } => {
                let (middle, [x, y, _]) = by(placement);
                Some(middle + (x * x + y * y).sqrt())
            }
            Self::Cylinder { placement, .. } => {
                let (middle, [x, y, z]) = by(placement);
                Some(middle + (x * x + y * y).sqrt() + z.max(0.0))
            }
        }
    }

    /// The mesh, if the shape is one.
    #[inline]
    pub fn mesh(&self) -> Option<&Arc<Mesh>> {
        match self {
            Self::Mesh { mesh, .. } => Some(mesh),
            Self::Sphere { .. } | Self::Disc { .. } | Self::Cylinder { .. } | Self::Strands { .. } => None,
        }
    }

    /// Whether rays see the same shape: meshes and strands must be identical objects.
    pub fn is_same(&self, other: &Self) -> bool {
        let parts = |shape: &Self| match shape {
            Self::Sphere { placement, flip } | Self::Disc { placement, flip } | Self::Cylinder { placement, flip } => {
                (*placement, *flip, None)
            }
            Self::Mesh { mesh, placement } => (*placement, false, Some(Arc::as_ptr(mesh).cast::<()>())),
            Self::Strands { strands, placement } => (*placement, false, Some(Arc::as_ptr(strands).cast::<()>())),
        };
        std::mem::discriminant(self) == std::mem::discriminant(other) && parts(self) == parts(other)
    }

    /// Area in render space. Exact for meshes, discs, round cylinders, and spheres under similarities; by quadrature
    /// for the others.
    pub fn area(&self) -> f32 {
        match self {
            Self::Sphere { placement, .. } => {
                const N: usize = 64;
                let mut sum = 0.0;
                for i in 0..N {
                    for j in 0..N {
                        let u = Vec2::new(i as f32 + 0.5, j as f32 + 0.5) / N as f32;
                        sum += placement.area_stretch(warp::uniform_sphere(u)) as f64;
                    }
                }
                4.0 * PI * (sum / (N * N) as f64) as f32
            }
            Self::Disc { placement, .. } => PI * placement.area_stretch(Vec3::Z),
            Self::Cylinder { placement, .. } => {
                const N: usize = 4096;
                let stretch = |i: usize| {
                    let (sin, cos) = sin_cos(2.0 * PI * (i as f32 / N as f32));
                    placement.area_stretch(Vec3::new(cos, sin, 0.0)) as f64
                };
                let sum: f64 = (0..N).map(stretch).sum();
                2.0 * PI * (sum / N as f64) as f32
            }
            Self::Mesh { mesh, .. } => mesh.area_sums().last().copied().unwrap_or(0.0) as f32,
            // Strands do not emit.
            Self::Strands { .. } => 0.0,
        }
    }

    /// Draws a point by area (for emitting meshes, which are never instanced). `u_primitive` chooses a triangle.
    pub fn sample_area(&self, u: Vec2, u_primitive: f32) -> SurfacePoint {
        match self {
            Self::Sphere { placement, flip } => {
                let n = warp::uniform_sphere(u);
                let normal = placement.normal(n).normalize();
                SurfacePoint {
                    point: placement.render_from_object.transform_point3(n),
                    normal: if *flip { -normal } else { normal },
                    pdf_area: 1.0 / (4.0 * PI * placement.area_stretch(n)),
                    primitive: 0,
                    weights: Vec2::ZERO,
                }
            }
            Self::Disc { placement, flip } => {
                let p = warp::concentric_disk(u);
                let normal = placement.normal(Vec3::Z).normalize();
                SurfacePoint {
                    point: placement.render_from_object.transform_point3(p.extend(0.0)),
                    normal: if *flip { -normal } else { normal },
                    pdf_area: 1.0 / (PI * placement.area_stretch(Vec3::Z)),
                    primitive: 0,
                    weights: Vec2::ZERO,
                }
            }
            Self::Cylinder { placement, flip } => {
                let (sin, cos) = sin_cos(2.0 * PI * u.x);
                let n = Vec3::new(cos, sin, 0.0);
                let normal = placement.normal(n).normalize();
                SurfacePoint {
                    point: placement.render_from_object.transform_point3(n.with_z(u.y)),
                    normal: if *flip { -normal } else { normal },
                    pdf_area: 1.0 / (2.0 * PI * placement.area_stretch(n)),
                    primitive: 0,
                    weights: Vec2::ZERO,
                }
            }
            Self::Mesh { mesh, .. } => {
                let sums = mesh.area_sums();
                let total = sums.last().copied().unwrap_or(0.0);
                let x = u_primitive as f64 * total;
                let triangle = sums.partition_point(|&s| s <= x).min(sums.len() - 1) as u32;
                mesh.point_in(triangle, u, (1.0 / total) as f32)
            }
            // Zero area: points drawn here count for nothing.
            Self::Strands { strands, placement } => {
                let [low, high] = strands.corners();
                SurfacePoint {
                    point: placement.render_from_object.transform_point3(0.5 * (low + high)),
                    normal: Vec3::Z,
                    pdf_area: f32::INFINITY,
                    primitive: 0,
                    weights: Vec2::ZERO,
                }
            }
        }
    }

    /// Density of [`Self::sample_area`] at a point with this unit geometric normal, in render space.
    pub fn pdf_area(&self, normal: Vec3) -> f32 {
        match self {
            Self::Sphere { placement, .. } => placement.area_shrink(normal) / (4.0 * PI),
            Self::Cylinder { placement, .. } => placement.area_shrink(normal) / (2.0 * PI),
            Self::Disc { placement, .. } => 1.0 / (PI * placement.area_stretch(Vec3::Z)),
            Self::Mesh { mesh, .. } => (1.0 / mesh.area_sums().last().copied().unwrap_or(0.0)) as f32,
            Self::Strands { .. } => f32::INFINITY,
        }
    }

    /// Position for texture lookups at a point on the shape. On a mesh: in this triangle, by the weights of its second
    /// and third corner. `place`: position data for texture graphs.
    pub fn texture_point(&self, point: Vec3, primitive: u32, weights: Vec2, place: Place) -> TexturePoint {
        let own = |placement: &Placement| placement.object_from_render.transform_point3(point);
        let uv = match self {
            Self::Sphere { placement, .. } => sphere_uv(own(placement).normalize()),
            Self::Disc { placement, .. } => disc_uv(own(placement).truncate()),
            Self::Cylinder { placement, .. } => {
                let p = own(placement);
                Vec2::new(turn(p.truncate().normalize()), p.z.clamp(0.0, 1.0))
            }
            Self::Mesh { mesh, .. } => mesh_uv(mesh, primitive, weights),
            Self::Strands { .. } => weights,
        };
        TexturePoint {
            uv,
            color: self.color_at(primitive, weights),
            place,
        }
    }

    /// Whether no part of its outside, or of its `two_sides`, hides another part from any point, as far as a quick test
    /// can tell. Shadow rays then need not test the emitter that they go to, which they might otherwise hit one
    /// rounding early.
    pub fn never_shadows_itself(&self, two_sides: bool) -> bool {
        match self {
            Self::Sphere { flip, .. } | Self::Cylinder { flip, .. } => !flip && !two_sides,
            Self::Disc { .. } => true,
            Self::Mesh { mesh, .. } => mesh.is_convex() && (!two_sides || mesh.is_flat()),
            Self::Strands { .. } => false,
        }
    }

    /// Whether it has an inside.
    pub fn is_closed(&self) -> bool {
        match self {
            Self::Sphere { .. } => true,
            Self::Disc { .. } | Self::Cylinder { .. } | Self::Strands { .. } => false,
            Self::Mesh { mesh, .. } => mesh.is_closed(),
        }
    }

    /// Whether the inside of a closed shape is everything around it.
    pub fn is_inside_out(&self) -> bool {
        match self {
            Self::Sphere { flip, .. } | Self::Disc { flip, .. } | Self::Cylinder { flip, .. } => *flip,
            Self::Mesh { mesh, .. } => mesh.signed_volume() < 0.0,
            Self::Strands { .. } => false,
        }
    }

    /// Interpolated vertex colour of a mesh in a triangle, by the weights of its second and third corner, if it has
    /// colours.
    #[inline]
    fn color_at(&self, primitive: u32, w: Vec2) -> Rgb {
        let Some(mesh) = self.mesh().filter(|mesh| !mesh.colors.is_empty()) else {
            return Rgb::ZERO;
        };
        let [a, b, c] = mesh.triangles[primitive as usize].map(|i| mesh.colors[i as usize]);
        a * (1.0 - w.x - w.y) + b * w.x + c * w.y
    }

    /// Completes a hit of a ray on an object. `is_placed`: otherwise a mesh counts as untransformed. `has_uv`:
    /// otherwise UV are zero.
    #[inline]
    pub(super) fn finish(object: &Object, hit: RawHit, ray: &Ray, is_placed: bool, has_uv: bool) -> SurfaceHit {
        let shape = &object.shape;
        let (point, ng, ns, uv, curvature, scale) = match shape {
            Self::Sphere { placement, flip } => {
                let p = (placement.object_from_render.transform_point3(ray.origin)
                    + placement.object_from_render.transform_vector3(ray.dir) * hit.t)
                    .normalize();
                let sign = if *flip { -1.0 } else { 1.0 };
                let n = placement.normal(p);
                let curvature = n.length();
                let n = n * (sign / curvature);
                let point = placement.render_from_object.transform_point3(p);
                let scale = placement.scale();
                (point, n, n, has_uv.then(|| sphere_uv(p)), sign * curvature, scale)
            }
            Self::Disc { placement, flip } => {
                let n = placement.normal(Vec3::Z).normalize();
                let n = if *flip { -n } else { n };
                let point = placement.render_from_object.transform_point3(hit.uv.extend(0.0));
                (point, n, n, has_uv.then(|| disc_uv(hit.uv)), 0.0, placement.scale())
            }
            Self::Cylinder { placement, flip } => {
                let p = placement.object_from_render.transform_point3(ray.origin)
                    + placement.object_from_render.transform_vector3(ray.dir) * hit.t;
                let on_circle = p.truncate().normalize();
                let p = on_circle.extend(p.z.clamp(0.0, 1.0));
                let sign = if *flip { -1.0 } else { 1.0 };
                let n = placement.normal(on_circle.extend(0.0));
                let length = n.length();
                let n = n * (sign / length);
                let point = placement.render_from_object.transform_point3(p);
                let uv = has_uv.then(|| Vec2::new(turn(on_circle), p.z));
                (point, n, n, uv, sign * 0.5 * length, placement.scale())
            }
            Self::Mesh { mesh, placement } => {
                let facet = mesh.facet(hit.primitive);
                let [a, b, c] = mesh.corners(hit.primitive);
                let w = hit.uv;
                let interpolated = |[a, b, c]: [Vec3; 3]| a * (1.0 - w.x - w.y) + b * w.x + c * w.y;
                let p = interpolated([a, b, c]);
                let towards = |n: [Vec3; 3], ng: Vec3| {
                    let ns = interpolated(n).normalize_or(ng);
                    if ns.dot(ng) < 0.0 { -ns } else { ns }
                };
                let uv = has_uv.then(|| mesh_uv(mesh, hit.primitive, w));
                if !is_placed {
                    let ng = facet.normal.normalize();
                    let ns = mesh.unit_normals_of(hit.primitive).map_or(ng, |n| towards(n, ng));
                    (p, ng, ns, uv, facet.curvature, facet.extent)
                } else {
                    let place = |p| placement.render_from_object.transform_point3(p);
                    let ng = placement.normal(facet.normal).normalize();
                    let (ns, curvature) = match mesh.normals_of(hit.primitive) {
                        None => (ng, 0.0),
                        Some(normals) => {
                            let n = normals.map(|n| placement.normal(n).normalize_or_zero());
                            (towards(n, ng), mesh::edge_curvature([a, b, c].map(place), n))
                        }
                    };
                    let scale = placement.scale() * facet.extent.max(1.0);
                    (place(p), ng, ns, uv, curvature, scale)
                }
            }
            Self::Strands { strands, placement } => {
                return Self::finish_strands(object, (strands, placement), hit, ray);
            }
        };
        SurfaceHit {
            t: hit.t,
            point,
            ng,
            ns,
            at: TexturePoint {
                uv: uv.unwrap_or_default(),
                color: if has_uv {
                    shape.color_at(hit.primitive, hit.uv)
                } else {
                    Rgb::ZERO
                },
                place: match &object.space {
                    Some(space) if has_uv => space.place(point, ng, ns, -ray.dir),
                    _ => Place::NOWHERE,
                },
            },
            object: hit.object,
            material: object.material,
            boundary: object.boundary,
            primitive: hit.primitive,
            curvature,
            clearance: clearance(scale.max(point.abs().max_element())),
        }
    }

    /// The same for strands.
    #[cold]
    #[inline(never)]
    fn finish_strands(
        object: &Object,
        (strands, placement): (&Strands, &Placement),
        hit: RawHit,
        ray: &Ray,
    ) -> SurfaceHit {
        let found = StrandHit {
            t: hit.t,
            piece: hit.primitive,
            u: hit.uv.x,
        };
        let on = strands.finish(in_object_space(placement, ray), &found);
        let point = placement.render_from_object.transform_point3(on.point);
        let n = placement.normal(on.normal);
        let length = n.length();
        let n = n / length;
        let bend = match strands.basis() {
            Basis::Balls => 1.0,
            Basis::Linear | Basis::BSpline | Basis::CatmullRom => 0.5,
        };
        // Hairs are so thin that the clearance of other surfaces would jump past the next one.
        let scale = (placement.scale() * strands.extent().max(1.0)).max(point.abs().max_element());
        let off = clearance(scale);
        SurfaceHit {
            t: hit.t,
            point,
            ng: n,
            ns: n,
            at: TexturePoint {
                uv: on.uv,
                color: Rgb::ZERO,
                place: match &object.space {
                    Some(space) => space.place(point, n, n, -ray.dir),
                    None => Place::NOWHERE,
                },
            },
            object: hit.object,
            material: object.material,
            boundary: object.boundary,
            primitive: hit.primitive,
            curvature: bend * length / on.radius,
            clearance: off.min(0.1 * on.radius / length).max(0.125 * off),
        }
    }
}

/// UV of a point on the unit sphere: azimuth around +z and polar angle from +z, both over their ranges (as in Mitsuba).
fn sphere_uv(p: Vec3) -> Vec2 {
    Vec2::new(turn(p.truncate()), acos(p.z) / PI)
}

/// UV of a point of the unit disc: radius and azimuth (as in Mitsuba).
fn disc_uv(p: Vec2) -> Vec2 {
    Vec2::new(p.length(), turn(p))
}

/// Azimuth over a whole turn, from 0 to 1.
fn turn(p: Vec2) -> f32 {
    let phi = atan2(p.y, p.x);
    let phi = if phi < 0.0 { phi + 2.0 * PI } else { phi };
    phi / (2.0 * PI)
}

#[inline]
fn mesh_uv(mesh: &Mesh, triangle: u32, w: Vec2) -> Vec2 {
    if mesh.uvs.is_empty() {
        return w;
    }
    let [a, b, c] = mesh.triangles[triangle as usize];
    let at = |i: u32| mesh.uvs[i as usize];
    let [a, b, c] = [at(a), at(b), at(c)];
    a * (1.0 - w.x - w.y) + b * w.x + c * w.y
}
