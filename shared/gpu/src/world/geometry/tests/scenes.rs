//! Objects for ray tests.

use super::*;
use glam::{Affine3A, Quat};

/// Objects, and targets for rays.
pub struct Scene {
    pub name: String,
    pub objects: Vec<Object>,
    /// Half the width of a box around most of it.
    pub scale: f32,
    /// Vertices, and points on edges and shapes.
    pub targets: Vec<Vec3>,
    /// Edges of meshes, in render space.
    pub edges: Vec<[Vec3; 2]>,
}

impl Scene {
    fn new(name: &str, scale: f32) -> Self {
        Self {
            name: name.to_owned(),
            objects: Vec::new(),
            scale,
            targets: vec![Vec3::ZERO],
            edges: Vec::new(),
        }
    }

    fn add(&mut self, shape: Shape) {
        let (placement, mesh) = match &shape {
            Shape::Mesh { placement, mesh } => (placement, Some(mesh.clone())),
            Shape::Sphere { placement, .. }
            | Shape::Disc { placement, .. }
            | Shape::Cylinder { placement, .. }
            | Shape::Strands { placement, .. } => (placement, None),
        };
        let map = placement.render_from_object;
        match mesh {
            None => {
                let points = [
                    Vec3::ZERO,
                    Vec3::Z,
                    Vec3::X,
                    Vec3::new(0.6, 0.8, 0.5),
                    Vec3::new(-0.3, 0.2, 0.0),
                ];
                self.targets.extend(points.map(|p| map.transform_point3(p)));
            }
            Some(mesh) => {
                for [a, b, _] in &mesh.triangles {
                    let [a, b] = [a, b].map(|i| map.transform_point3(mesh.positions[*i as usize]));
                    self.targets.extend([a, a.midpoint(b)]);
                    self.edges.push([a, b]);
                }
            }
        }
        self.objects.push(Object {
            name: format!("object {}", self.objects.len()),
            ..Object::new(shape)
        });
    }

    fn add_mesh(&mut self, mesh: &Arc<Mesh>, placement: Placement) {
        let mesh = mesh.clone();
        self.add(Shape::Mesh { mesh, placement });
    }
}

fn placed(map: Affine3A) -> Placement {
    Placement {
        render_from_object: map,
        object_from_render: map.inverse(),
    }
}

/// Randomly rotated, stretched and moved.
fn anywhere(random: &mut Random, size: f32, scale: f32) -> Placement {
    let turn = Quat::from_xyzw(random.unit() - 0.5, random.unit() - 0.5, random.unit() - 0.5, 0.7).normalize();
    let stretch = (Vec3::splat(0.6) + 0.8 * Vec3::new(random.unit(), random.unit(), random.unit())) * size * scale;
    let at = random.point() * scale;
    // The determinant of a tiny or huge map is not representable.
    let back = Affine3A::from_scale(stretch.recip()) * Affine3A::from_quat(turn.inverse());
    Placement {
        render_from_object: Affine3A::from_scale_rotation_translation(stretch, turn, at),
        object_from_render: back * Affine3A::from_translation(-at),
    }
}

fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Arc<Mesh> {
    Arc::new(Mesh {
        positions,
        triangles,
        ..Mesh::default()
    })
}

/// A closed mesh of about 2 n^2 triangles around the origin, randomly rough.
fn rough_ball(random: &mut Random, n: u32, size: f32) -> Arc<Mesh> {
    // Rings of n vertices each, and two poles.
    let rings = n - 1;
    let mut positions = Vec::new();
    for ring in 1..=rings {
        for at in 0..n {
            let (sin, cos) = beamfarm_render::math::sin_cos(std::f32::consts::PI * ring as f32 / n as f32);
            let (y, x) = beamfarm_render::math::sin_cos(std::f32::consts::TAU * at as f32 / n as f32);
            positions.push(Vec3::new(sin * x, sin * y, cos) * (size * (0.9 + 0.2 * random.unit())));
        }
    }
    let poles = [positions.len() as u32, positions.len() as u32 + 1];
    positions.extend([Vec3::Z * size, Vec3::NEG_Z * size]);
    let vertex = |ring: u32, at: u32| (ring - 1) * n + at % n;
    let mut triangles = Vec::new();
    for at in 0..n {
        triangles.push([poles[0], vertex(1, at), vertex(1, at + 1)]);
        triangles.push([poles[1], vertex(rings, at + 1), vertex(rings, at)]);
        for ring in 1..rings {
            let [a, b] = [vertex(ring, at), vertex(ring, at + 1)];
            let [c, d] = [vertex(ring + 1, at), vertex(ring + 1, at + 1)];
            triangles.extend([[a, c, b], [b, c, d]]);
        }
    }
    mesh(positions, triangles)
}

/// Thousands of long thin triangles around one point, at odd angles.
fn fan(count: u32) -> Arc<Mesh> {
    let turn = Quat::from_rotation_arc(Vec3::Z, Vec3::new(1.0, 0.7, 0.4).normalize());
    let rim = |i: u32| {
        let (y, x) = beamfarm_render::math::sin_cos(std::f32::consts::TAU * i as f32 / count as f32);
        turn * Vec3::new(x, y, 0.2)
    };
    let positions = std::iter::once(Vec3::ZERO).chain((0..count).map(rim)).collect();
    let triangles = (0..count).map(|i| [0, i + 1, (i + 1) % count + 1]).collect();
    mesh(positions, triangles)
}

/// All shapes, meshes with and without a placement, some of them nested.
pub fn mixed(random: &mut Random, scale: f32) -> Scene {
    let mut scene = Scene::new(&format!("all shapes at {scale:e}"), scale);
    let (own, shared) = (rough_ball(random, 12, 0.4 * scale), rough_ball(random, 9, 1.0));
    scene.add_mesh(&own, Placement::IDENTITY);
    for _ in 0..6 {
        let flip = random.unit() < 0.5;
        let placement = anywhere(random, 0.3, scale);
        scene.add(Shape::Sphere { placement, flip });
        let placement = anywhere(random, 0.4, scale);
        scene.add(Shape::Disc { placement, flip });
        let placement = anywhere(random, 0.3, scale);
        scene.add(Shape::Cylinder { placement, flip });
        scene.add_mesh(&shared, anywhere(random, 0.3, scale));
    }
    // Two coincide: which of two hits at the same distance counts.
    let placement = anywhere(random, 0.5, scale);
    scene.add(Shape::Disc { placement, flip: false });
    scene.add(Shape::Disc { placement, flip: true });
    scene
}

/// Slivers with and without a placement, in a room.
fn slivers(random: &mut Random) -> Scene {
    let mut scene = Scene::new("slivers", 1.0);
    let (own, shared) = (fan(3000), fan(1500));
    scene.add_mesh(&own, Placement::IDENTITY);
    for _ in 0..3 {
        scene.add_mesh(&shared, anywhere(random, 0.5, 1.0));
    }
    let geometry = Geometry::new(&scene.objects);
    let trees = geometry.hierarchies().trees;
    assert!(trees.len() == 2 && trees.iter().all(|tree| tree.slivers().len() > 0));
    scene
}

/// Many instances of a mesh with many triangles.
fn forest(random: &mut Random) -> Scene {
    let mut scene = Scene::new("forest", 1.0);
    let tree = rough_ball(random, 60, 1.0);
    for _ in 0..80 {
        scene.add_mesh(&tree, anywhere(random, 0.2, 1.0));
    }
    scene
}

/// Triangles on top of each other, with zero area, and in a single point.
fn degenerate(random: &mut Random) -> Scene {
    let mut scene = Scene::new("degenerate", 1.0);
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..200u32 {
        let (a, b) = (random.point(), random.point());
        let c = match i % 4 {
            0 => a,
            1 => a.midpoint(b),
            _ => random.point(),
        };
        positions.extend([a, if i % 8 == 0 { a } else { b }, c]);
        triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
        if i % 3 == 0 {
            triangles.push([3 * i + 2, 3 * i, 3 * i + 1]);
        }
    }
    let mesh = mesh(positions, triangles);
    scene.add_mesh(&mesh, Placement::IDENTITY);
    scene.add_mesh(&mesh, Placement::IDENTITY);
    scene
}

/// No shape, one shape, an empty mesh.
fn small(random: &mut Random) -> [Scene; 3] {
    let nothing = Scene::new("nothing", 1.0);
    let mut ball = Scene::new("one ball", 1.0);
    let placement = anywhere(random, 0.5, 1.0);
    ball.add(Shape::Sphere { placement, flip: false });
    let mut empty = Scene::new("empty mesh", 1.0);
    empty.add_mesh(&mesh(Vec::new(), Vec::new()), Placement::IDENTITY);
    empty.add(Shape::Sphere { placement, flip: false });
    [nothing, ball, empty]
}

/// Each triangle next to all smaller ones: a deep tree, with and without a placement.
pub fn deep(count: u32) -> Scene {
    let mut scene = Scene::new("deep", 1.0);
    let mut positions = Vec::new();
    let mut size = 1.0;
    for _ in 0..count {
        positions.extend([Vec3::X, Vec3::Y, Vec3::Z].map(|p| (p + 0.1) * size));
        size *= 0.6;
    }
    let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh = mesh(positions, triangles);
    scene.add_mesh(&mesh, Placement::IDENTITY);
    scene.add_mesh(&mesh, placed(Affine3A::from_translation(Vec3::NEG_ONE)));
    scene
}

/// One of each kind.
pub fn all(random: &mut Random) -> Vec<Scene> {
    let mut scenes = vec![mixed(random, 1.0), slivers(random), forest(random), degenerate(random)];
    scenes.push(deep(90));
    scenes.extend(small(random));
    scenes
}

/// Touching cubes with integer corners, with or without a placement.
pub fn cubes(is_placed: bool) -> Scene {
    let mut scene = Scene::new("cubes", 4.0);
    let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32);
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles: Vec<[u32; 3]> = quads
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]])
        .collect();
    let cube = mesh((0..8).map(corner).collect(), triangles.clone());
    for i in -2..2 {
        for j in -2..2 {
            let at = Vec3::new(i as f32, j as f32, ((i + j) & 1) as f32);
            if is_placed {
                scene.add_mesh(&cube, placed(Affine3A::from_translation(at)));
            } else {
                let moved = mesh((0..8).map(|i| corner(i) + at).collect(), triangles.clone());
                scene.add_mesh(&moved, Placement::IDENTITY);
            }
        }
    }
    scene
}

/// A closed mesh around the origin.
pub fn closed(random: &mut Random, is_placed: bool) -> Scene {
    let mut scene = Scene::new("closed", 1.0);
    let ball = rough_ball(random, 40, 1.0);
    let turn = Affine3A::from_quat(Quat::from_xyzw(0.3, -0.2, 0.5, 0.7).normalize());
    let placement = if is_placed { placed(turn) } else { Placement::IDENTITY };
    scene.add_mesh(&ball, placement);
    scene
}

/// Most children that can wait at once when a ray meets all boxes, in any order.
pub fn longest_wait(flat: &FlatGeometry) -> u64 {
    fn below(flat: &FlatGeometry, children: [u32; 4], turned: bool) -> u64 {
        let there = || children.into_iter().filter(|child| *child != NOTHING);
        let count = there().count() as u64;
        let longest = there().map(|child| {
            let number = (child & ((1 << NUMBER_BITS) - 1)) as usize;
            match child & (LEAF | 3 << NUMBER_BITS) {
                OF_FOUR => 0,
                OF_SLIVERS => {
                    let root = flat.sliver_trees[number].root as usize;
                    below(flat, flat.turned_nodes[root].children, true).max(1)
                }
                OF_OBJECT if flat.objects[number].root == NOTHING => 0,
                OF_OBJECT => {
                    let root = flat.objects[number].root as usize;
                    below(flat, flat.nodes[root].children, false).max(1)
                }
                _ if turned => below(flat, flat.turned_nodes[child as usize].children, true),
                _ => below(flat, flat.nodes[child as usize].children, false),
            }
        });
        count.max(longest.max().unwrap_or(0) + count.saturating_sub(1))
    }
    below(flat, flat.nodes[0].children, false)
}

/// Those that beams are sent through.
pub fn near(random: &mut Random) -> impl Iterator<Item = Scene> {
    let all = [
        mixed(random, 1.0),
        slivers(random),
        degenerate(random),
        cubes(true),
        cubes(false),
    ];
    all.into_iter()
}
