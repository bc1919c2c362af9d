//! Ray queries: a tree over everything that lies in render space, and one for each placed mesh.

use super::Object;
use super::item::{Item, Items, Near};
use super::mesh::{Mesh, MeshTree};

use super::primitives::{bounds, intersect_shape};
use super::shape::{Placement, RawHit, Shape, SurfaceHit, in_object_space};
use super::tree::{ItemTree, TreeHit};
use crate::math::{Ray, Vec2, Vec3};
use crate::parallel;
use crate::wide::Around;
use glam::Vec3A;
use std::collections::HashSet;
use std::sync::Arc;

/// Triangles from which a mesh gets its own hierarchy when scenes follow each other: building it takes a tenth of a
/// second, and rays have to search two hierarchies instead of one.
const LARGE: usize = 1 << 16;

/// The objects of a scene, ready for rays.
pub struct Geometry {
    hierarchy: Arc<Hierarchy>,
    /// By object: whether the UV of its hits matter.
    has_uv: Vec<bool>,
}

/// Depends on shapes only; scenes that differ in other respects share it.
struct Hierarchy {
    /// The triangles of meshes without a placement, and the other objects by number.
    tree: ItemTree,
    /// By object: its mesh's tree, in object space, if the mesh has a placement or is kept apart.
    placed: Vec<Option<MeshTree>>,
}

/// The items in render space, by object.
#[derive(Default)]
struct Parts<'a> {
    list: Vec<Part<'a>>,
    /// By part: the number of items up to its end.
    ends: Vec<usize>,
}

enum Part<'a> {
    /// A mesh's triangles, by the object's number.
    Mesh(u32, &'a Mesh),
    /// Another object, by number, and the corners of its bounding box.
    Other(u32, [Vec3; 2]),
}

impl<'a> Parts<'a> {
    fn push(&mut self, part: Part<'a>, items: usize) {
        self.ends.push(self.count() + items);
        self.list.push(part);
    }
}

impl Items for Parts<'_> {
    fn count(&self) -> usize {
        self.ends.last().copied().unwrap_or(0)
    }
    fn item(&self, index: usize) -> Item {
        let part = self.ends.partition_point(|end| *end <= index);
        let first = part.checked_sub(1).map_or(0, |before| self.ends[before]);
        match self.list[part] {
            Part::Mesh(number, mesh) => mesh.item(number, (index - first) as u32),
            Part::Other(number, corners) => Item::Other(number, corners),
        }
    }
}

impl std::fmt::Debug for Geometry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Geometry({} objects)", self.hierarchy.placed.len())
    }
}

impl Geometry {
    /// Builds the hierarchies. Deterministic: the same objects give the same trees.
    pub fn new(objects: &[Object]) -> Self {
        let boxes: Vec<_> = objects.iter().map(|object| bounds(&object.shape)).collect();
        Self::in_boxes(objects, &boxes, false)
    }

    /// As [`Self::new`]. `boxes`: the [`bounds`] of each object. A placed mesh gets its own hierarchy; with `apart`, so
    /// does a large mesh without a placement. This may decide which of two hits at the same distance counts, so it must
    /// be the same wherever bits have to agree.
    pub(crate) fn in_boxes(objects: &[Object], boxes: &[(Vec3, Vec3)], apart: bool) -> Self {
        let stays = |shape: &Shape| match shape {
            Shape::Mesh { mesh, placement } => {
                *placement == Placement::IDENTITY && !(apart && mesh.triangles.len() >= LARGE)
            }
            Shape::Sphere { .. } | Shape::Disc { .. } | Shape::Cylinder { .. } | Shape::Strands { .. } => false,
        };
        // Per-triangle work runs in parallel, and once for a mesh that several objects share.
        let mut met = HashSet::new();
        let mut meshes = |apart: bool| -> Vec<&Mesh> {
            let shapes = objects.iter().map(|object| &object.shape);
            let meshes = shapes.filter(|shape| stays(shape) != apart).filter_map(Shape::mesh);
            let once = meshes.filter(|mesh| met.insert((Arc::as_ptr(mesh), apart)));
            once.map(|mesh| &**mesh).collect()
        };
        let apart = meshes(true);
        parallel::each(apart.len(), &|i| {
            apart[i].tree();
        });
        for object in objects {
            if let Shape::Strands { strands, .. } = &object.shape {
                strands.prepare();
            }
        }
        let mut items = Parts::default();
        let mut placed = Vec::with_capacity(objects.len());
        for ((number, object), (min, max)) in (0..).zip(objects).zip(boxes) {
            let mesh = object.shape.mesh();
            placed.push(match mesh.filter(|_| stays(&object.shape)) {
                Some(mesh) => {
                    items.push(Part::Mesh(number, mesh), mesh.triangles.len());
                    None
                }
                None => {
                    items.push(Part::Other(number, [*min, *max]), 1);
                    mesh.map(|mesh| mesh.tree().clone())
                }
            });
        }
        let tree = ItemTree::new(&items);
        // After the tree, whose temporary memory is free again.
        let together = meshes(false);
        parallel::each(together.len(), &|i| together[i].prepare_hits());
        Self {
            hierarchy: Arc::new(Hierarchy { tree, placed }),
            has_uv: vec![true; objects.len()],
        }
    }

    /// The same hierarchies for other objects with the same shapes.
    pub(crate) fn shared(&self) -> Self {
        Self {
            hierarchy: self.hierarchy.clone(),
            has_uv: vec![true; self.has_uv.len()],
        }
    }

    /// Whether both share one hierarchy.
    pub(crate) fn is_shared_with(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.hierarchy, &other.hierarchy)
    }

    /// Hits of objects for which `has_uv` is false get zero UV, which saves computing them.
    pub fn with_uv(self, has_uv: Vec<bool>) -> Self {
        Self { has_uv, ..self }
    }

    /// Whether anything reads the UV of hits on an object.
    pub fn has_uv(&self, object: u32) -> bool {
        self.has_uv[object as usize]
    }

    /// The closest hit in (0, t_max), if any. `ignore` names objects to pass through; it is no type parameter, to avoid
    /// compiling the whole traversal once per caller.
    pub fn intersect(
        &self,
        objects: &[Object],
        ray: &Ray,
        t_max: f32,
        ignore: &dyn Fn(u32) -> bool,
    ) -> Option<SurfaceHit> {
        let other = |object: u32, t_max: f32| {
            if ignore(object) {
                return None;
            }
            let (t, primitive, uv) = match &objects[object as usize].shape {
                Shape::Mesh { placement, .. } => {
                    let (origin, dir) = in_object_space(placement, ray);
                    match self
                        .placed(object)?
                        .nearest::<()>(origin, dir, t_max, &|_| false, |_, _| None)?
                    {
                        TreeHit::Triangle(hit) => (hit.t, hit.id.triangle, hit.uv),
                        TreeHit::Other(()) => return None,
                    }
                }
                Shape::Strands { strands, placement } => {
                    let hit = strands.nearest(in_object_space(placement, ray), t_max)?;
                    (hit.t, hit.piece, Vec2::new(hit.u, 0.0))
                }
                shape => {
                    let (t, uv) = intersect_shape(shape, ray, t_max)?;
                    (t, 0, uv)
                }
            };
            let hit = RawHit {
                t,
                object,
                primitive,
                uv,
            };
            Some((t, hit))
        };
        let hit = (self.hierarchy.tree).nearest::<RawHit>(ray.origin, ray.dir, t_max, ignore, other)?;
        let raw = match hit {
            TreeHit::Triangle(hit) => RawHit {
                t: hit.t,
                object: hit.id.object,
                primitive: hit.id.triangle,
                uv: hit.uv,
            },
            TreeHit::Other(hit) => hit,
        };
        let object = raw.object as usize;
        let of = &objects[object];
        let is_where_it_is = || matches!(&of.shape, Shape::Mesh { placement, .. } if *placement == Placement::IDENTITY);
        let is_placed = self.hierarchy.placed[object].is_some() && !is_where_it_is();
        Some(Shape::finish(of, raw, ray, is_placed, self.has_uv[object]))
    }

    /// Whether anything is hit in (0, t_max).
    pub fn occluded(&self, objects: &[Object], ray: &Ray, t_max: f32, ignore: &dyn Fn(u32) -> bool) -> bool {
        let other = |object: u32, t_max: f32| {
            if ignore(object) {
                return false;
            }
            match &objects[object as usize].shape {
                Shape::Mesh { placement, .. } => self.placed(object).is_some_and(|tree| {
                    let (origin, dir) = in_object_space(placement, ray);
                    tree.any(origin, dir, t_max, &|_| false, |_, _| false)
                }),
                Shape::Strands { strands, placement } => strands.any(in_object_space(placement, ray), t_max),
                shape => intersect_shape(shape, ray, t_max).is_some(),
            }
        };
        self.hierarchy.tree.any(ray.origin, ray.dir, t_max, ignore, other)
    }

    /// Prepares a search for some of the objects.
    pub(crate) fn subset(&self, objects: Vec<bool>) -> Subset {
        Subset {
            nodes: self.hierarchy.tree.leading_to(&objects),
            objects,
        }
    }

    /// Everything of some objects near a segment, and possibly more: triangles with their corners, round shapes by
    /// their objects only.
    pub(crate) fn near(&self, objects: &[Object], of: &Subset, around: &Around, found: &mut impl FnMut(Near)) {
        let leads = |node: u32| of.nodes[node as usize];
        self.hierarchy.tree.near(around, &leads, &mut |near| {
            let (Near::Triangle(object, _) | Near::Other(object)) = near;
            if !of.has(object) {
                return;
            }
            let placed = (matches!(near, Near::Other(_)).then(|| self.placed(object))).flatten();
            let (Some(tree), Shape::Mesh { placement, .. }) = (placed, &objects[object as usize].shape) else {
                return found(near);
            };
            tree.near(&in_space_of(placement, around), &|_| true, &mut |near| {
                if let Near::Triangle(_, corners) = near {
                    let back = |corner: Vec3| placement.render_from_object.transform_point3(corner);
                    found(Near::Triangle(object, corners.map(back)));
                }
            });
        });
    }

    /// The tree over items in render space, and by object its mesh's own tree, if any.
    pub(super) fn parts(&self) -> (&ItemTree, impl Iterator<Item = Option<&ItemTree>>) {
        let placed = (self.hierarchy.placed.iter()).map(|tree| tree.as_ref().map(|tree| &*tree.0));
        (&self.hierarchy.tree, placed)
    }

    /// The tree of a mesh that has a placement.
    fn placed(&self, object: u32) -> Option<&ItemTree> {
        self.hierarchy.placed[object as usize].as_ref().map(|tree| &*tree.0)
    }
}

/// Some of the objects of a scene.
#[derive(Debug)]
pub(crate) struct Subset {
    objects: Vec<bool>,
    /// By node of the hierarchy: whether any of the objects is below it.
    nodes: Vec<bool>,
}

impl Subset {
    #[inline]
    pub fn has(&self, object: u32) -> bool {
        self.objects[object as usize]
    }
}

/// A segment and its surroundings in a shape's own space; the surroundings grow slightly.
fn in_space_of(placement: &Placement, around: &Around) -> Around {
    let (origin, dir) = (placement.object_from_render.transform_point3(around.origin), around.dir);
    let from = &placement.render_from_object;
    let scale = placement.most_stretched();
    Around {
        origin,
        dir: placement.object_from_render.transform_vector3(dir),
        radius: around.radius * scale,
        planes: around.planes.map(|[x, y, z, at]| {
            let n = Vec3::new(x, y, z);
            let along = |axis: Vec3A| Vec3::from(axis).dot(n);
            let m = &from.matrix3;
            [
                along(m.x_axis),
                along(m.y_axis),
                along(m.z_axis),
                at - along(from.translation),
            ]
        }),
        ..*around
    }
}

impl Placement {
    /// Upper bound, barely above the true value, of the stretch from render space to object space.
    pub fn most_stretched(&self) -> f32 {
        let to = &self.object_from_render.matrix3;
        most_stretched([to.x_axis, to.y_axis, to.z_axis])
    }
}

/// Upper bound of a linear map's stretch, given its columns: barely above its norm where it scales all directions
/// alike. The largest of three values exceeds their mean by at most the square root of two times their standard
/// deviation (Wolkowicz and Styan 1980, Bounds for eigenvalues using traces).
fn most_stretched(columns: [Vec3A; 3]) -> f32 {
    let size = columns
        .map(|column| column.abs().max_element())
        .into_iter()
        .fold(0.0, f32::max);
    // Normalised to one, so that fourth powers stay in the range of floats.
    let columns = columns.map(|column| column / size);
    let products = columns.map(|a| columns.map(|b| a.dot(b)));
    let mean = (products[0][0] + products[1][1] + products[2][2]) / 3.0;
    let squares: f32 = products.iter().flatten().map(|x| x * x).sum();
    let deviation = (squares / 3.0 - mean * mean).max(0.0).sqrt();
    // The margin covers rounding.
    size * (1.001 * mean + std::f32::consts::SQRT_2 * deviation).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Purpose, Sampler};
    use crate::warp;
    use crate::world::geometry::{Mesh, Object};
    use glam::Affine3A;

    /// For spheres and for triangles with and without a placement, a subset's items are found wherever all items are.
    #[test]
    fn a_subset_is_found_as_all_are() {
        let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
        let mut point = || {
            let (u, v) = (sampler.next_2d(), sampler.next_2d());
            Vec3::new(u.x, u.y, v.x)
        };
        let object = |number: usize| {
            let (at, size) = (point(), 0.05);
            let put = Affine3A::from_scale_rotation_translation(Vec3::splat(size), Default::default(), at);
            let placement = Placement {
                render_from_object: put,
                object_from_render: put.inverse(),
            };
            let mesh = |scale: f32, at: Vec3| Mesh {
                positions: [Vec3::X, Vec3::Y, Vec3::Z].map(|p| at + p * scale).to_vec(),
                triangles: vec![[0, 1, 2]],
                ..Mesh::default()
            };
            let shape = match number % 3 {
                0 => Shape::Sphere { placement, flip: false },
                1 => Shape::Mesh {
                    mesh: Arc::new(mesh(size, at)),
                    placement: Placement::IDENTITY,
                },
                _ => Shape::Mesh {
                    mesh: Arc::new(mesh(1.0, Vec3::ZERO)),
                    placement,
                },
            };
            Object::new(shape)
        };
        let objects: Vec<Object> = (0..300).map(object).collect();
        let geometry = Geometry::new(&objects);
        let is_asked = |number: usize| number % 7 == 1 || number > 250;
        let asked = geometry.subset((0..objects.len()).map(is_asked).collect());
        let all = geometry.subset(vec![true; objects.len()]);
        let mut count = 0;
        for _ in 0..100 {
            let (origin, to) = (point(), point());
            let around = Around {
                origin,
                dir: (to - origin).normalize(),
                length: (to - origin).length(),
                radius: 0.05,
                planes: [Around::NO_PLANE; 2],
            };
            let numbers = |of: &Subset| {
                let mut found = Vec::new();
                geometry.near(&objects, of, &around, &mut |near| {
                    let (Near::Triangle(object, _) | Near::Other(object)) = near;
                    found.push(object as usize);
                });
                found.sort_unstable();
                found
            };
            let mut expected = numbers(&all);
            expected.retain(|number| is_asked(*number));
            assert_eq!(numbers(&asked), expected);
            count += expected.len();
        }
        assert!(count > 100, "{count}");
    }

    /// No direction is stretched more, and under a similarity hardly less.
    #[test]
    fn nothing_is_stretched_more() {
        let mut sampler = Sampler::new(4, 0, Purpose::Test, 0);
        let mut vector = || Vec3A::from(warp::uniform_sphere(sampler.next_2d()));
        for number in 0..200 {
            let turned = glam::Quat::from_rotation_arc(vector().into(), vector().into());
            let size = [1.0, 1e-15, 1e15][number % 3];
            let columns = match number % 2 {
                0 => [vector(), vector() * 3.0, vector() * 0.1],
                _ => [Vec3A::X, Vec3A::Y, Vec3A::Z].map(|axis| turned * axis * 7.0),
            };
            let columns = columns.map(|column| column * size);
            let most = most_stretched(columns);
            let lengths = (0..1000).map(|_| {
                let v = vector();
                ((columns[0] * v.x + columns[1] * v.y + columns[2] * v.z) / size).length() * size
            });
            let longest = lengths.fold(0.0, f32::max);
            assert!(longest <= most, "{columns:?}: {longest} {most}");
            assert!(number % 2 == 0 || most < 1.01 * 7.0 * size, "{most}");
        }
    }

    /// Rays that start near a wall of a box meet it at once, at any size, with or without a placement.
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
                let objects = [Object::new(Shape::Mesh {
                    mesh: Arc::new(mesh),
                    placement,
                })];
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
                        let hit = geometry.intersect(&objects, &ray, f32::INFINITY, &|_| false);
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

    /// A large mesh without a placement, next to a ball: rays meet the same with and without its own hierarchy, which
    /// is built once for all scenes that contain the mesh.
    #[test]
    fn large_meshes_can_be_kept_apart() {
        let side = 200u32;
        let height = |x: u32, y: u32| 0.3 * libm::sinf(0.1 * x as f32) * libm::cosf(0.17 * y as f32);
        let vertex = |i: u32| {
            let (x, y) = (i % (side + 1), i / (side + 1));
            Vec3::new(x as f32 * 0.02 - 2.0, height(x, y), y as f32 * 0.02 - 2.0)
        };
        let square = |i: u32| {
            let a = i / side * (side + 1) + i % side;
            [[a, a + side + 1, a + 1], [a + 1, a + side + 1, a + side + 2]]
        };
        let mesh = Arc::new(Mesh {
            positions: (0..(side + 1) * (side + 1)).map(vertex).collect(),
            triangles: (0..side * side).flat_map(square).collect(),
            ..Mesh::default()
        });
        assert!(mesh.triangles.len() >= LARGE);
        let object = Object::new;
        let with_ball_at = |x: f32| {
            let centre = Vec3::new(x, 0.4, 0.0);
            let ball = Shape::Sphere {
                placement: Placement {
                    render_from_object: Affine3A::from_translation(centre),
                    object_from_render: Affine3A::from_translation(-centre),
                },
                flip: false,
            };
            let ground = Shape::Mesh {
                mesh: mesh.clone(),
                placement: Placement::IDENTITY,
            };
            [object(ground), object(ball)]
        };
        let objects = with_ball_at(0.0);
        let boxes: Vec<_> = objects.iter().map(|object| bounds(&object.shape)).collect();
        let [together, apart] = [false, true].map(|apart| Geometry::in_boxes(&objects, &boxes, apart));
        let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
        let mut met = [0; 2];
        for _ in 0..20_000 {
            let (a, b) = (sampler.next_2d(), sampler.next_2d());
            let ray = Ray {
                origin: Vec3::new(6.0 * a.x - 3.0, 3.0 * a.y - 1.0, 6.0 * sampler.next_1d() - 3.0),
                dir: warp::uniform_sphere(b),
            };
            let far = 5.0 * sampler.next_1d();
            let hits = [&together, &apart].map(|geometry| {
                let hit = geometry.intersect(&objects, &ray, far, &|_| false);
                assert_eq!(hit.is_some(), geometry.occluded(&objects, &ray, far, &|_| false));
                hit.map(|hit| (hit.t, hit.object, hit.point, hit.ng, hit.ns, hit.curvature))
            });
            assert_eq!(hits[0], hits[1], "{ray:?}");
            if let Some((_, object, ..)) = hits[0] {
                met[object as usize] += 1;
            }
        }
        assert!(met.iter().all(|met| *met > 500), "{met:?}");
        let objects = with_ball_at(0.5);
        let moved = Geometry::in_boxes(&objects, &boxes, true);
        let of = |geometry: &Geometry| geometry.hierarchy.placed[0].as_ref().map(|tree| tree.0.clone());
        assert!(
            of(&moved)
                .zip(of(&apart))
                .is_some_and(|(one, other)| Arc::ptr_eq(&one, &other))
        );
    }
}
