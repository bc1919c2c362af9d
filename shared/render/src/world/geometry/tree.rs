//! A tree over triangles and other items, for rays.

use super::crowds;
use super::item::{Item, Items, Near};
use super::pieces::{Piece, pieces};
use super::slivers::{SliverTree, taken_out};
use super::triangles::{Four, FourHit, ShearedRay};
use crate::math::Vec3;
use crate::parallel;
use crate::wide::{Around, WideTree};
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::{Boundable, BvhBuildParams};
use std::time::Duration;

/// Most items in a single tree build. Larger sets are cut into pieces of at most this size, whose trees are built in
/// parallel: each needs little memory and stays in the cache.
const PIECE: usize = 1 << 16;

/// The tree.
#[derive(Default)]
pub(super) struct ItemTree {
    boxes: WideTree,
    leaves: Vec<Leaf>,
    fours: Vec<Four>,
    slivers: Vec<SliverTree>,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Leaf {
    Four(u32),
    Slivers(u32),
    Other(u32),
}

/// A hit.
#[derive(Clone, Copy, Debug)]
pub(super) enum TreeHit<T> {
    Triangle(FourHit),
    Other(T),
}

impl ItemTree {
    /// Builds the tree in parallel on the threads of the current pool. Deterministic for any number of threads.
    pub fn new(items: &impl Items) -> Self {
        Self::of_pieces(items, PIECE)
    }

    /// Its boxes.
    pub fn boxes(&self) -> &WideTree {
        &self.boxes
    }

    /// By leaf number of [`Self::boxes`].
    pub fn leaves(&self) -> &[Leaf] {
        &self.leaves
    }

    /// By number in [`Leaf::Four`].
    pub fn fours(&self) -> &[Four] {
        &self.fours
    }

    /// By number in [`Leaf::Slivers`].
    pub fn slivers(&self) -> &[SliverTree] {
        &self.slivers
    }

    /// The number of trees of slivers.
    #[cfg(test)]
    pub fn of_slivers(&self) -> usize {
        self.slivers.len()
    }

    pub(super) fn of_pieces(items: &impl Items, largest: usize) -> Self {
        if items.count() <= largest {
            let items: Vec<Item> = (0..items.count()).map(|i| items.item(i)).collect();
            return Self::whole(items);
        }
        let pieces = pieces(items.count(), |i| items.item(i).aabb(), largest);
        let boxes: Vec<Aabb> = pieces.iter().map(|piece| piece.bounds).collect();
        let binary = binary_tree(&boxes);
        let is_leaf: Vec<bool> = binary.nodes.iter().map(|node| node.is_leaf()).collect();
        let (boxes, places) = WideTree::over_trees(&binary, &is_leaf);
        let mut tree = Self {
            boxes,
            ..Self::default()
        };
        // A few at a time: a finished part exists twice until it is joined to the others.
        let at_once = 4 * rayon::current_num_threads();
        for (pieces, places) in pieces.chunks(at_once).zip(places.chunks(at_once)) {
            let build = |piece: &Piece| {
                let items: Vec<Item> = piece.items.iter().map(|i| items.item(*i as usize)).collect();
                Self::whole(items)
            };
            let trees = parallel::map(pieces.len(), |i| build(&pieces[i]));
            for (part, place) in trees.into_iter().zip(places) {
                let (leaves, fours) = (tree.leaves.len() as u32, tree.fours.len() as u32);
                let slivers = tree.slivers.len() as u32;
                tree.boxes.put(*place, part.boxes, leaves);
                tree.leaves.extend(part.leaves.into_iter().map(|leaf| match leaf {
                    Leaf::Four(i) => Leaf::Four(i + fours),
                    Leaf::Slivers(i) => Leaf::Slivers(i + slivers),
                    other => other,
                }));
                tree.fours.extend(part.fours);
                tree.slivers.extend(part.slivers);
            }
        }
        tree
    }

    fn whole(items: Vec<Item>) -> Self {
        if items.is_empty() {
            return Self::default();
        }
        let (items, slivers) = taken_out(crowds::without_repeats(items));
        let binary = binary_tree(&items);
        let mut tree = Self {
            slivers,
            ..Self::default()
        };
        let mut builder = Builder {
            items: &items,
            binary: &binary,
            is_leaf: vec![false; binary.nodes.len()],
        };
        builder.merge(0);
        tree.boxes = WideTree::new(&binary, &builder.is_leaf, |index| {
            let leaf = builder.leaf(index, &mut tree.fours);
            tree.leaves.push(leaf);
            (tree.leaves.len() - 1) as u32
        });
        tree
    }

    /// The nearest hit in (0, t_max). `ignore`: objects whose triangles are skipped. `other`: the distance at which
    /// another item is hit before a given distance.
    #[inline(always)]
    pub fn nearest<T: Copy>(
        &self,
        origin: Vec3,
        dir: Vec3,
        t_max: f32,
        ignore: &dyn Fn(u32) -> bool,
        mut other: impl FnMut(u32, f32) -> Option<(f32, T)>,
    ) -> Option<TreeHit<T>> {
        let sheared = ShearedRay::new(origin, dir);
        let mut best = None;
        self.boxes.along_ray(origin, dir, t_max, |leaf, t_max| {
            let hit = match self.leaves[leaf as usize] {
                Leaf::Four(i) => self.fours[i as usize]
                    .intersect(&sheared, t_max, ignore)
                    .map(|hit| (hit.t, TreeHit::Triangle(hit))),
                Leaf::Slivers(i) => self.slivers[i as usize]
                    .nearest((origin, dir, &sheared), t_max, ignore)
                    .map(|hit| (hit.t, TreeHit::Triangle(hit))),
                Leaf::Other(i) => other(i, t_max).map(|(t, hit)| (t, TreeHit::Other(hit))),
            };
            match hit {
                Some((t, hit)) => {
                    best = Some(hit);
                    t
                }
                None => t_max,
            }
        });
        best
    }

    /// Whether anything is hit in (0, t_max). `other`: whether another item is hit before a distance.
    #[inline(always)]
    pub fn any(
        &self,
        origin: Vec3,
        dir: Vec3,
        t_max: f32,
        ignore: &dyn Fn(u32) -> bool,
        mut other: impl FnMut(u32, f32) -> bool,
    ) -> bool {
        let sheared = ShearedRay::new(origin, dir);
        self.boxes
            .any_along_ray(origin, dir, t_max, |leaf| match self.leaves[leaf as usize] {
                Leaf::Four(i) => self.fours[i as usize].intersect(&sheared, t_max, ignore).is_some(),
                Leaf::Slivers(i) => self.slivers[i as usize].any((origin, dir, &sheared), t_max, ignore),
                Leaf::Other(i) => other(i, t_max),
            })
    }

    /// By node: whether any of the wanted objects is below it.
    pub fn leading_to(&self, objects: &[bool]) -> Vec<bool> {
        self.boxes.leading_to(|leaf| match self.leaves[leaf as usize] {
            Leaf::Four(i) => (self.fours[i as usize].objects()).any(|object| objects[object as usize]),
            Leaf::Slivers(i) => (self.slivers[i as usize].objects()).any(|object| objects[object as usize]),
            Leaf::Other(object) => objects[object as usize],
        })
    }

    /// Everything near a segment, and possibly more. `leads`: whether to open a node.
    pub fn near(&self, around: &Around, leads: &impl Fn(u32) -> bool, found: &mut impl FnMut(Near)) {
        self.boxes.near(around, leads, |leaf| match self.leaves[leaf as usize] {
            Leaf::Four(i) => (self.fours[i as usize].near(around))
                .for_each(|(object, corners)| found(Near::Triangle(object, corners))),
            Leaf::Slivers(i) => self.slivers[i as usize].near(around, found),
            Leaf::Other(i) => found(Near::Other(i)),
        });
    }
}

fn binary_tree(things: &[impl Boundable]) -> Bvh2 {
    crowds::apart(things, built).unwrap_or_else(|| built(things))
}

pub(super) fn built<T: Boundable>(things: &[T]) -> Bvh2 {
    let params = BvhBuildParams {
        max_prims_per_leaf: 1,
        ..BvhBuildParams::medium_build()
    };
    build_bvh2(things, params, &mut Duration::default())
}

struct Builder<'a> {
    items: &'a [Item],
    binary: &'a Bvh2,
    /// By node of the binary tree: whether it becomes a leaf.
    is_leaf: Vec<bool>,
}

/// Cost of a part of the binary tree.
struct Part {
    /// Number of triangles; `None` if it contains anything else, or more than four.
    triangles: Option<usize>,
    /// Expected tests, times the surface of its box.
    cost: f32,
}

/// A node test's cost in tests of four triangles, shared among the binary nodes that it covers.
const NODE_COST: f32 = 0.2;

impl Builder<'_> {
    /// Decides which nodes become leaves: up to four triangles, where splitting does not pay (surface area heuristic).
    fn merge(&mut self, index: usize) -> Part {
        let node = &self.binary.nodes[index];
        let area = node.aabb().half_area();
        let first = node.first_index as usize;
        if node.is_leaf() {
            self.is_leaf[index] = true;
            let item = &self.items[self.binary.primitive_indices[first] as usize];
            return Part {
                triangles: matches!(item, Item::Triangle(..)).then_some(1),
                cost: area,
            };
        }
        let (left, right) = (self.merge(first), self.merge(first + 1));
        let split = left.cost + right.cost + NODE_COST * area;
        let triangles = match (left.triangles, right.triangles) {
            (Some(a), Some(b)) if a + b <= 4 => Some(a + b),
            _ => None,
        };
        if triangles.is_some() && area <= split {
            self.is_leaf[index] = true;
            Part { triangles, cost: area }
        } else {
            Part {
                triangles: None,
                cost: split,
            }
        }
    }

    /// The leaf that a node of the binary tree becomes.
    fn leaf(&self, index: usize, fours: &mut Vec<Four>) -> Leaf {
        let mut four = Four::EMPTY;
        let mut placed = 0;
        let mut parts = vec![index];
        while let Some(index) = parts.pop() {
            let node = &self.binary.nodes[index];
            let first = node.first_index as usize;
            if !node.is_leaf() {
                parts.extend([first + 1, first]);
                continue;
            }
            match self.items[self.binary.primitive_indices[first] as usize] {
                Item::Triangle(id, corners) => {
                    four.set(placed, id, corners);
                    placed += 1;
                }
                Item::Slivers(number, ..) => return Leaf::Slivers(number),
                Item::Other(number, ..) => return Leaf::Other(number),
            }
        }
        fours.push(four);
        Leaf::Four((fours.len() - 1) as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec2;
    use crate::sampler::{Purpose, Sampler};
    use crate::warp;
    use crate::world::geometry::triangles::TriangleId;

    /// All bits of a tree, NaN included.
    fn bits(tree: &ItemTree) -> (Vec<u32>, String) {
        (
            tree.boxes.bits(),
            format!("{:?} {:?} {:?}", tree.leaves, tree.fours, tree.slivers),
        )
    }

    /// Small triangles, large ones, and many with the same centre.
    #[test]
    fn trees_do_not_depend_on_threads() {
        let mut sampler = Sampler::new(2, 0, Purpose::Test, 0);
        let mut items = Vec::new();
        for number in 0..30_000 {
            let mut point = || {
                let Vec2 { x, y } = sampler.next_2d();
                Vec3::new(x, y, sampler.next_1d())
            };
            let a = if number % 3 == 0 { Vec3::ONE } else { point() };
            let (b, c) = match number % 3 {
                0 => (a + Vec3::X, a + Vec3::Y),
                _ => (a + 0.01 * point(), a + 0.01 * point()),
            };
            items.push(match number % 50 {
                7 => Item::Other(number, [a.min(b), a.max(b)]),
                _ => Item::Triangle(
                    TriangleId {
                        object: 0,
                        triangle: number,
                    },
                    [a, b, c],
                ),
            });
        }
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| bits(&ItemTree::of_pieces(&items, 1000)))
        };
        let one = on(1);
        assert!([2, 3, 7].into_iter().all(|threads| on(threads) == one));
        let pieces = pieces(items.len(), |i| items[i].aabb(), 1000);
        assert!(pieces.iter().all(|piece| piece.items.len() <= 1000));
        let mut found: Vec<u32> = pieces.into_iter().flat_map(|piece| piece.items).collect();
        found.sort_unstable();
        assert!(found.into_iter().eq(0..30_000));
    }

    impl Items for Vec<Item> {
        fn count(&self) -> usize {
            self.len()
        }
        fn item(&self, index: usize) -> Item {
            match &self[index] {
                Item::Triangle(id, corners) => Item::Triangle(*id, *corners),
                Item::Slivers(number, corners) => Item::Slivers(*number, *corners),
                Item::Other(number, corners) => Item::Other(*number, *corners),
            }
        }
    }

    /// Small and large triangles, scattered and overlapping: the tree finds the same hits as a test of every triangle,
    /// and reports any occlusion that there is.
    #[test]
    fn hits_are_those_of_all_triangles_one_by_one() {
        let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
        let point = |sampler: &mut Sampler| {
            let Vec2 { x, y } = sampler.next_2d();
            Vec3::new(x, y, sampler.next_1d())
        };
        for triangles in [1, 2, 3, 5, 40, 1000] {
            let mut items = Vec::new();
            for number in 0..triangles {
                let a = point(&mut sampler);
                let size = if number % 7 == 0 { 1.0 } else { 0.1 };
                let b = a + (point(&mut sampler) - 0.5) * size;
                // Some are flat along an axis, some coincide.
                let c = a + (point(&mut sampler) - 0.5) * size * Vec3::new(1.0, 1.0, 0.0);
                let id = TriangleId {
                    object: number % 3,
                    triangle: number,
                };
                items.push(Item::Triangle(id, [a, b, c]));
                if number % 11 == 0 {
                    items.push(Item::Triangle(id, [a, b, c]));
                }
            }
            for tree in [ItemTree::new(&items), ItemTree::of_pieces(&items, 30)] {
                let mut met = 0;
                for _ in 0..2000 {
                    let origin = point(&mut sampler) * 3.0 - 1.0;
                    let dir = match sampler.next_1d() < 0.2 {
                        true => Vec3::AXES[sampler.next_u32() as usize % 3],
                        false => warp::uniform_sphere(sampler.next_2d()),
                    };
                    let t_max = 4.0 * sampler.next_1d();
                    let ignore = |object: u32| object == 2;
                    let sheared = ShearedRay::new(origin, dir);
                    let mut nearest: Option<f32> = None;
                    for item in &items {
                        let Item::Triangle(id, corners) = item else {
                            continue;
                        };
                        let mut four = Four::EMPTY;
                        four.set(0, *id, *corners);
                        let t_max = nearest.unwrap_or(t_max);
                        if let Some(hit) = four.intersect(&sheared, t_max, &ignore) {
                            nearest = Some(hit.t);
                        }
                    }
                    let found = tree.nearest::<()>(origin, dir, t_max, &ignore, |_, _| None);
                    let t = found.map(|hit| match hit {
                        TreeHit::Triangle(hit) => hit.t,
                        TreeHit::Other(()) => f32::NAN,
                    });
                    assert_eq!(t, nearest, "{triangles} triangles, {origin} to {dir}");
                    let any = tree.any(origin, dir, t_max, &ignore, |_, _| false);
                    assert_eq!(any, nearest.is_some());
                    met += usize::from(nearest.is_some());
                }
                assert!(met > 0 || triangles < 40);
            }
        }
    }

    fn hit(items: Vec<Item>) -> Option<u32> {
        let tree = ItemTree::of_pieces(&items, 1 << 16);
        let (origin, dir) = (Vec3::new(0.25, 0.25, 3.0), Vec3::NEG_Z);
        match tree.nearest::<u32>(origin, dir, f32::INFINITY, &|_| false, |n, t| {
            (t > 1.0).then_some((1.0, n))
        })? {
            TreeHit::Triangle(hit) => Some(hit.id.triangle),
            TreeHit::Other(number) => Some(number),
        }
    }

    fn triangle(triangle: u32, corners: [Vec3; 3]) -> Item {
        Item::Triangle(TriangleId { object: 0, triangle }, corners)
    }

    /// Equal triangles, others in the same box, and other items there: built in a moment, and all are found.
    #[test]
    fn crowds_are_halved() {
        let flat = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let equal: Vec<Item> = (0..100_000).map(|i| triangle(i, flat)).collect();
        assert!(hit(equal).is_some());
        let few = crowds::without_repeats((0..5000).map(|i| triangle(i, flat)).collect());
        assert_eq!(few.len(), 1);
        assert_eq!(
            crowds::without_repeats((0..500).map(|i| triangle(i, flat)).collect()).len(),
            500
        );
        // In one box, with one different corner.
        let inner = |i: u32| Vec3::new(0.5, (i as f32 + 1.0) / 1e5, 0.0);
        let tilted = |i: u32| [Vec3::new(0.0, 0.0, 1.0), Vec3::new(1.0, 1.0, 0.0), inner(i)];
        let mut others: Vec<Item> = (0..50_000).map(|i| triangle(i, tilted(i))).collect();
        assert_eq!(crowds::crowds(&others).len(), 1);
        others.extend((50_000..55_000).map(|i| Item::Other(i, [Vec3::NEG_ONE, Vec3::ONE])));
        assert_eq!(crowds::crowds(&others).len(), 2);
        let tree = crowds::apart(&others, built).unwrap();
        let mut found = tree.primitive_indices.clone();
        found.sort_unstable();
        assert!(found.into_iter().eq(0..55_000));
        assert!(hit(others).is_some_and(|number| number >= 50_000));
    }
}
