use crate::math::{Vec2, Vec3};
use crate::sampler::{Purpose, Sampler};
use crate::warp;
use crate::wide::Around;
use crate::world::geometry::item::{Item, Near};
use crate::world::geometry::tree::{ItemTree, TreeHit};
use crate::world::geometry::triangles::{Four, ShearedRay, TriangleId};
use glam::Quat;
use std::collections::HashSet;

fn items(triangles: impl IntoIterator<Item = [Vec3; 3]>) -> Vec<Item> {
    let item = |(number, corners): (usize, [Vec3; 3])| {
        let id = TriangleId {
            object: number as u32 % 3,
            triangle: number as u32,
        };
        Item::Triangle(id, corners)
    };
    triangles.into_iter().enumerate().map(item).collect()
}

/// A cone without its base, or a disc if it has no height.
fn fan(count: usize, height: f32) -> Vec<[Vec3; 3]> {
    let rim = |i: usize| {
        let angle = std::f32::consts::TAU * (i % count) as f32 / count as f32;
        Vec3::new(libm::cosf(angle), libm::sinf(angle), 0.0)
    };
    (0..count).map(|i| [Vec3::Z * height, rim(i), rim(i + 1)]).collect()
}

/// Blades that all lean roughly alike.
fn hair(count: usize, sampler: &mut Sampler) -> Vec<[Vec3; 3]> {
    let blade = |_| {
        let (root, lean) = (sampler.next_2d(), sampler.next_2d());
        let root = Vec3::new(root.x, root.y, 0.0);
        let side = Vec3::new(0.7, -0.7, 0.0) * 0.002;
        [
            root - side,
            root + side,
            root + Vec3::new(0.7, 0.6, 0.8) + lean.extend(0.0) * 0.1,
        ]
    };
    (0..count).map(blade).collect()
}

fn turned(triangles: &[[Vec3; 3]], by: Quat, to: Vec3) -> Vec<[Vec3; 3]> {
    triangles.iter().map(|t| t.map(|p| by * p + to)).collect()
}

fn square(side: usize) -> Vec<[Vec3; 3]> {
    let at = |x: usize, y: usize| Vec3::new(x as f32, y as f32, 0.0) * (2.0 / side as f32) - Vec3::new(1.0, 1.0, 0.0);
    let cell = |i: usize| {
        let (x, y) = (i % side, i / side);
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
        [[a, b, c], [b, d, c]]
    };
    (0..side * side).flat_map(cell).collect()
}

/// Rays from near and far, many through the middle, meet what a test of every single triangle meets; and everything
/// near a segment is found.
#[test]
fn slivers_are_hit_as_one_by_one() {
    let mut sampler = Sampler::new(3, 0, Purpose::Test, 0);
    let lean = Quat::from_rotation_x(0.7) * Quat::from_rotation_y(0.3);
    let mut among_others = fan(1200, 0.5);
    among_others.extend(turned(&square(20), lean, Vec3::X));
    among_others.extend(fan(700, 0.0));
    let scenes = [
        (fan(2000, 0.0), 1),
        (turned(&fan(1500, 1.5), lean, Vec3::ZERO), 1),
        (hair(2000, &mut sampler), 1),
        (turned(&fan(1000, 0.0), lean, Vec3::new(40.0, -30.0, 7.0)), 1),
        (among_others, 1),
    ];
    for (scene, (triangles, least)) in scenes.into_iter().enumerate() {
        let middle = triangles.iter().flatten().sum::<Vec3>() / (3 * triangles.len()) as f32;
        let items = items(triangles);
        let tree = ItemTree::new(&items);
        assert!(tree.of_slivers() >= least, "scene {scene}");
        let (mut met, mut same) = (0, 0);
        for number in 0..400 {
            let far = [1.5, 30.0, 1000.0][number % 3];
            let origin = middle + far * warp::uniform_sphere(sampler.next_2d());
            let Vec2 { x, y } = sampler.next_2d();
            let aim = middle + (Vec3::new(x, y, sampler.next_1d()) - 0.5) * if number % 4 == 0 { 0.0 } else { 1.5 };
            let dir = (aim - origin).normalize();
            let t_max = if number % 5 == 0 { far } else { f32::INFINITY };
            let ignore = |object: u32| object == 2;
            let sheared = ShearedRay::new(origin, dir);
            let mut nearest: Option<f32> = None;
            for item in &items {
                let Item::Triangle(id, corners) = item else { continue };
                let mut four = Four::EMPTY;
                four.set(0, *id, *corners);
                if let Some(hit) = four.intersect(&sheared, nearest.unwrap_or(t_max), &ignore) {
                    nearest = Some(hit.t);
                }
            }
            let t = match tree.nearest::<()>(origin, dir, t_max, &ignore, |_, _| None) {
                Some(TreeHit::Triangle(hit)) => Some(hit.t),
                _ => None,
            };
            // A box that begins exactly where another triangle is hit may be skipped.
            let is_near = |(one, other): (f32, f32)| (one - other).abs() <= 2.0 * f32::EPSILON * other;
            assert_eq!(t.is_some(), nearest.is_some(), "scene {scene}, {origin} to {dir}");
            assert!(t.zip(nearest).is_none_or(is_near), "scene {scene}, {origin} to {dir}");
            same += usize::from(t == nearest);
            assert_eq!(tree.any(origin, dir, t_max, &ignore, |_, _| false), nearest.is_some());
            met += usize::from(nearest.is_some());
            if number % 4 > 0 {
                continue;
            }
            let around = Around {
                origin: aim,
                dir: -dir,
                length: 0.4,
                radius: 0.02,
                planes: [Around::NO_PLANE; 2],
            };
            let bits = |corners: [Vec3; 3]| corners.map(|p| p.to_array().map(f32::to_bits));
            let mut found = HashSet::new();
            tree.near(&around, &|_| true, &mut |near| {
                if let Near::Triangle(_, corners) = near {
                    found.insert(bits(corners));
                }
            });
            for item in &items {
                let Item::Triangle(_, corners) = item else { continue };
                let points = (0..=8).flat_map(|i| (0..=8 - i).map(move |j| (i as f32 / 8.0, j as f32 / 8.0)));
                let [a, b, c] = *corners;
                let is_near = |(u, v): (f32, f32)| {
                    let p = a + (b - a) * u + (c - a) * v - around.origin;
                    let along = p.dot(around.dir).clamp(0.0, around.length);
                    (p - around.dir * along).length() < 0.99 * around.radius
                };
                if points.into_iter().any(is_near) {
                    assert!(found.contains(&bits(*corners)), "scene {scene}, {corners:?}");
                }
            }
        }
        assert!(met > 60 && same > 390, "scene {scene}: {met}, {same}");
    }
}

/// No trees where they do not pay.
#[test]
fn other_triangles_keep_their_trees() {
    let mut sampler = Sampler::new(4, 0, Purpose::Test, 0);
    let lean = Quat::from_rotation_x(0.7) * Quat::from_rotation_y(0.3);
    let mut point = || {
        let Vec2 { x, y } = sampler.next_2d();
        Vec3::new(x, y, sampler.next_1d())
    };
    let needles = (0..2000).map(|_| {
        let (a, b) = (point(), point());
        [a, b, a + 0.001 * point()]
    });
    let needles: Vec<_> = needles.collect();
    let soup: Vec<_> = (0..2000).map(|_| [point(), point(), point()]).collect();
    for (name, triangles) in [
        ("a leaning square", turned(&square(60), lean, Vec3::ZERO)),
        ("needles in all directions", needles),
        ("triangles in all directions", soup),
        ("a disc of 64", fan(64, 0.0)),
        ("a leaning cone of 48", turned(&fan(48, 1.0), lean, Vec3::ZERO)),
    ] {
        assert_eq!(ItemTree::new(&items(triangles)).of_slivers(), 0, "{name}");
    }
}

/// A fan is cut for threads like any mesh, and its trees are the same.
#[test]
fn large_fans_are_hit_whatever_the_pieces() {
    let items = items(fan(3000, 0.2));
    let trees = [3000, 400].map(|largest| ItemTree::of_pieces(&items, largest));
    assert!(trees[0].of_slivers() == 1 && trees[1].of_slivers() > 4);
    let mut sampler = Sampler::new(5, 0, Purpose::Test, 0);
    for _ in 0..2000 {
        let Vec2 { x, y } = sampler.next_2d();
        let origin = Vec3::new(2.0 * x - 1.0, 2.0 * y - 1.0, 3.0);
        let dir = (0.3 * warp::uniform_sphere(sampler.next_2d()) - Vec3::Z).normalize();
        let hits = trees.each_ref().map(|tree| {
            match tree.nearest::<()>(origin, dir, f32::INFINITY, &|_| false, |_, _| None) {
                Some(TreeHit::Triangle(hit)) => Some(hit.t),
                _ => None,
            }
        });
        assert_eq!(hits[0], hits[1]);
    }
}
