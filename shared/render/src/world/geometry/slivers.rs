//! Trees over long thin triangles at odd angles, with boxes oriented like the triangles.
//!
//! Axis-aligned boxes are far larger than such a triangle. In a fan of thousands around one point each ray meets a good
//! part of them, and a tree of such boxes takes long to build. Nodes of these trees cost more than ordinary ones, so
//! they are built only where many slivers lie together and they pay.

use super::item::{Item, Near};
use super::triangles::{Four, FourHit, ShearedRay, TriangleId};
use crate::math::Vec3;
use crate::wide::Around;
use glam::Vec4;
use obvhs::Boundable;
use obvhs::aabb::Aabb;
use std::ops::Range;

/// A triangle is a sliver if half its box's surface is more than this many times twice its own area. Equilateral
/// triangles reach 2.3.
const THIN: f32 = 8.0;
/// Least number of triangles for a tree.
const FEWEST: usize = 64;
/// Expected tests of four triangles, for a ray that meets the box around slivers, above which a tree is considered.
const DEAR: f32 = 8.0;
/// A node's cost in tests of four triangles.
const NODE_COST: f32 = 1.0;
/// Most times that all triangles are examined in the search for trees that pay.
const LOOKS: usize = 8;

/// A tree with four oriented boxes per node.
#[derive(Debug, Default)]
pub(super) struct SliverTree {
    /// The origin of positions.
    pub center: Vec3,
    /// The largest distance of any corner from it.
    pub radius: f32,
    pub nodes: Vec<Node>,
    pub fours: Vec<Four>,
    /// Stack entries that a traversal may need.
    pub stack: usize,
    /// Expected tests of four triangles, times half the surface of the tree's bounding box.
    cost: f32,
}

/// Four boxes, each with its own axes, and their contents.
#[derive(Debug)]
pub(super) struct Node {
    /// By axis and coordinate.
    pub axes: [[Vec4; 3]; 3],
    /// By axis: from and to, along it.
    pub bounds: [[Vec4; 2]; 3],
    /// For a leaf, [`LEAF`] plus its number.
    pub children: [u32; 4],
    /// One bit per existing child.
    pub is_there: u32,
}

/// Marks children that are leaves.
pub(super) const LEAF: u32 = 1 << 31;

/// A box along three axes.
#[derive(Clone, Copy)]
struct TurnedBox {
    axes: [Vec3; 3],
    bounds: [[f32; 2]; 3],
}

impl TurnedBox {
    /// The bounding box along these axes.
    fn along(axes: [Vec3; 3], triangles: &[Triangle], center: Vec3) -> Self {
        let mut bounds = [[f32::INFINITY, f32::NEG_INFINITY]; 3];
        for corner in triangles.iter().flat_map(|(_, corners)| corners) {
            for (axis, [low, high]) in axes.iter().zip(&mut bounds) {
                let at = axis.dot(*corner - center);
                (*low, *high) = (low.min(at), high.max(at));
            }
        }
        Self { axes, bounds }
    }

    /// The smallest of a few: along the axes of space, of the longest triangle, and of all triangles together.
    fn around(triangles: &[Triangle], center: Vec3) -> Self {
        let mut best = Self::along(Vec3::AXES, triangles, center);
        let edges = triangles.iter().map(|(_, corners)| longest_edge(corners));
        let Some((longest, edge)) = edges
            .enumerate()
            .max_by(|a, b| a.1.length_squared().total_cmp(&b.1.length_squared()))
        else {
            return best;
        };
        let along = |one: Vec3, other: Vec3| if one.dot(other) < 0.0 { -one } else { one };
        let normal = normal(&triangles[longest].1);
        let (mut edges, mut normals) = (Vec3::ZERO, Vec3::ZERO);
        for (_, corners) in triangles {
            edges += along(longest_edge(corners), edge);
            normals += along(self::normal(corners), normal);
        }
        for (x, z) in [(edge, normal), (edges, normals)] {
            let Some(x) = x.try_normalize() else { continue };
            let z = (z - x * x.dot(z))
                .try_normalize()
                .unwrap_or_else(|| x.any_orthonormal_vector());
            let turned = Self::along([x, z.cross(x), z], triangles, center);
            if turned.half_area() < best.half_area() {
                best = turned;
            }
        }
        best
    }

    fn half_area(&self) -> f32 {
        let [x, y, z] = self.bounds.map(|[low, high]| high - low);
        (x + y) * z + x * y
    }
}

type Triangle = (TriangleId, [Vec3; 3]);

fn longest_edge([a, b, c]: &[Vec3; 3]) -> Vec3 {
    let longer = |one: Vec3, other: Vec3| match one.length_squared() < other.length_squared() {
        true => other,
        false => one,
    };
    longer(longer(*b - *a, *c - *b), *a - *c)
}

/// Normal with twice the triangle's area as its length.
fn normal([a, b, c]: &[Vec3; 3]) -> Vec3 {
    (*b - *a).cross(*c - *a)
}

fn is_sliver(item: &Item) -> bool {
    match item {
        Item::Triangle(_, corners) => item.aabb().half_area() > THIN * normal(corners).length(),
        Item::Slivers(..) | Item::Other(..) => false,
    }
}

/// Takes slivers out of the items where separate trees pay. Returns the items, with each tree's box in their place, and
/// the trees.
pub(super) fn taken_out(items: Vec<Item>) -> (Vec<Item>, Vec<SliverTree>) {
    let mut slivers: Vec<u32> = (0..items.len() as u32)
        .filter(|i| is_sliver(&items[*i as usize]))
        .collect();
    let mut finder = Finder {
        items: &items,
        looks: LOOKS * slivers.len(),
        is_taken: vec![false; items.len()],
        found: Vec::new(),
    };
    finder.find(&mut slivers);
    let Finder { is_taken, found, .. } = finder;
    if found.is_empty() {
        return (items, Vec::new());
    }
    let kept = items.into_iter().zip(is_taken).filter(|(_, is_taken)| !is_taken);
    let boxes = (0..)
        .zip(&found)
        .map(|(number, (_, bounds))| Item::Slivers(number, *bounds));
    let items = kept.map(|(item, _)| item).chain(boxes).collect();
    (items, found.into_iter().map(|(tree, _)| tree).collect())
}

struct Finder<'a> {
    items: &'a [Item],
    /// Triangles that may still be examined.
    looks: usize,
    /// By item.
    is_taken: Vec<bool>,
    /// Trees, and the corners of the boxes around them.
    found: Vec<(SliverTree, [Vec3; 2])>,
}

impl Finder<'_> {
    /// Puts all these items into one tree, or else treats each half separately.
    fn find(&mut self, slivers: &mut [u32]) {
        if slivers.len() < FEWEST {
            return;
        }
        let boxes = || slivers.iter().map(|i| self.items[*i as usize].aabb());
        let bounds = boxes().fold(Aabb::empty(), |all, one| all.union(&one));
        // Cost of axis-aligned boxes, however good the tree: a triangle is tested wherever its box is met, four at
        // once.
        let cost = 0.25 * boxes().map(|one| one.half_area()).sum::<f32>();
        if cost > DEAR * bounds.half_area() && self.looks >= slivers.len() {
            self.looks -= slivers.len();
            let triangle = |i: &u32| match self.items[*i as usize] {
                Item::Triangle(id, corners) => Some((id, corners)),
                _ => None,
            };
            let tree = SliverTree::new(slivers.iter().filter_map(triangle).collect(), &bounds);
            if tree.cost < 0.5 * cost {
                slivers.iter().for_each(|i| self.is_taken[*i as usize] = true);
                self.found.push((tree, [bounds.min.into(), bounds.max.into()]));
                return;
            }
        }
        let centers = boxes().fold(Aabb::empty(), |mut all, one| *all.extend(one.center()));
        let axis = centers.largest_axis();
        let half = slivers.len() / 2;
        let at = |i: u32| self.items[i as usize].aabb().center()[axis];
        slivers.select_nth_unstable_by(half, |a, b| at(*a).total_cmp(&at(*b)).then(a.cmp(b)));
        let (left, right) = slivers.split_at_mut(half);
        self.find(left);
        self.find(right);
    }
}

struct Builder {
    /// Triangles of a node are consecutive.
    triangles: Vec<Triangle>,
    tree: SliverTree,
}

/// A node's range of triangles, and the box around them.
type Child = (Range<usize>, TurnedBox);

impl Builder {
    fn child(&self, range: Range<usize>) -> Child {
        let around = TurnedBox::around(&self.triangles[range.clone()], self.tree.center);
        (range, around)
    }

    /// Splits along the box axis on which the centres lie farthest apart; fills leaves where possible.
    fn halves(&mut self, (range, around): &Child) -> [Child; 2] {
        let triangles = &mut self.triangles[range.clone()];
        let along = |axis: Vec3, [a, b, c]: &[Vec3; 3]| axis.dot(*a) + axis.dot(*b) + axis.dot(*c);
        let spread = |axis: &Vec3| {
            let all = triangles.iter().map(|(_, corners)| along(*axis, corners));
            let (low, high) = all.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), at| {
                (low.min(at), high.max(at))
            });
            high - low
        };
        let widest = around.axes.iter().map(|axis| (spread(axis), *axis));
        let (_, axis) = widest.fold(
            (f32::NEG_INFINITY, Vec3::X),
            |most, this| {
                if this.0 > most.0 { this } else { most }
            },
        );
        let half = (triangles.len() / 2).next_multiple_of(4).min(triangles.len() - 1);
        triangles.select_nth_unstable_by(half, |one, other| {
            let order = along(axis, &one.1).total_cmp(&along(axis, &other.1));
            order.then((one.0.object, one.0.triangle).cmp(&(other.0.object, other.0.triangle)))
        });
        let middle = range.start + half;
        [self.child(range.start..middle), self.child(middle..range.end)]
    }

    /// Adds a node with these boxes, split further while there is room. Returns the number of levels from here down.
    fn node(&mut self, mut children: Vec<Child>) -> usize {
        while children.len() < 4 {
            let open = (0..children.len())
                .filter(|i| children[*i].0.len() > 4)
                .max_by(|i, j| children[*i].1.half_area().total_cmp(&children[*j].1.half_area()));
            let Some(i) = open else { break };
            let [one, other] = self.halves(&children[i]);
            children[i] = one;
            children.push(other);
        }
        let at = self.tree.nodes.len();
        self.tree.nodes.push(Node {
            axes: [[Vec4::ZERO; 3]; 3],
            bounds: [[Vec4::ZERO; 2]; 3],
            children: [0; 4],
            is_there: (1 << children.len()) - 1,
        });
        let mut levels = 0;
        for (i, (range, around)) in children.into_iter().enumerate() {
            let node = &mut self.tree.nodes[at];
            for axis in 0..3 {
                for coordinate in 0..3 {
                    node.axes[axis][coordinate][i] = around.axes[axis][coordinate];
                }
                for side in 0..2 {
                    node.bounds[axis][side][i] = around.bounds[axis][side];
                }
            }
            let is_leaf = range.len() <= 4;
            self.tree.cost += if is_leaf { 1.0 } else { NODE_COST } * around.half_area();
            let child = if is_leaf {
                let mut four = Four::EMPTY;
                for (place, (id, corners)) in self.triangles[range].iter().enumerate() {
                    four.set(place, *id, *corners);
                }
                self.tree.fours.push(four);
                LEAF + (self.tree.fours.len() - 1) as u32
            } else {
                let number = self.tree.nodes.len() as u32;
                levels = levels.max(self.node(vec![(range, around)]));
                number
            };
            self.tree.nodes[at].children[i] = child;
        }
        levels + 1
    }
}

/// A ray prepared for tests against oriented boxes.
struct TurnedRay {
    origin: [Vec4; 3],
    dir: [Vec4; 3],
    /// Least absolute direction along any axis.
    least: Vec4,
    /// Margin by which boxes are grown.
    grown: Vec4,
}

impl TurnedRay {
    /// Where the ray enters a node's boxes, and which of them it meets before `t_max`.
    #[inline(always)]
    fn enter(&self, node: &Node, t_max: f32) -> (Vec4, u32) {
        // As for axis-aligned boxes.
        const FARTHER: f32 = 1.0 + 4.0 * f32::EPSILON;
        let (mut near, mut far) = (Vec4::ZERO, Vec4::INFINITY);
        for ([x, y, z], [low, high]) in node.axes.iter().zip(&node.bounds) {
            let along = |v: &[Vec4; 3]| *x * v[0] + *y * v[1] + *z * v[2];
            let (at, dir) = (along(&self.origin), along(&self.dir));
            let dir = Vec4::select(dir.abs().cmplt(self.least), self.least.copysign(dir), dir);
            let inverse = dir.recip();
            let low = (*low - self.grown - at) * inverse;
            let high = (*high + self.grown - at) * inverse;
            near = near.max(low.min(high));
            far = far.min(low.max(high));
        }
        let far = (far * FARTHER).min(Vec4::splat(t_max));
        (near, near.cmple(far).bitmask() & node.is_there)
    }
}

impl SliverTree {
    /// The tree over triangles within these bounds.
    fn new(triangles: Vec<Triangle>, bounds: &Aabb) -> Self {
        let center: Vec3 = (0.5 * bounds.min + 0.5 * bounds.max).into();
        let corners = triangles.iter().flat_map(|(_, corners)| corners);
        let mut builder = Builder {
            tree: Self {
                center,
                radius: corners.fold(0.0, |most, corner| corner.distance(center).max(most)),
                ..Self::default()
            },
            triangles,
        };
        let root = builder.child(0..builder.triangles.len());
        builder.tree.cost = NODE_COST * root.1.half_area();
        builder.tree.stack = 3 * builder.node(vec![root]) + 1;
        builder.tree
    }

    /// `radius`: margin by which boxes are grown.
    fn ray(&self, origin: Vec3, dir: Vec3, radius: f32) -> TurnedRay {
        let origin = origin - self.center;
        // Rounding error of triangles and boxes as the ray sees them.
        let rounding = 8.0 * f32::EPSILON * (origin.length() + 2.0 * self.radius);
        let splat = |v: Vec3| v.to_array().map(Vec4::splat);
        TurnedRay {
            origin: splat(origin),
            dir: splat(dir),
            least: Vec4::splat((dir.abs().max_element() * 1e-12).max(1e-30)),
            grown: Vec4::splat(radius + rounding),
        }
    }

    /// The nearest hit in (0, t_max); among several at the same distance, the first found.
    #[inline(never)]
    pub fn nearest(
        &self,
        (origin, dir, sheared): (Vec3, Vec3, &ShearedRay),
        t_max: f32,
        ignore: &dyn Fn(u32) -> bool,
    ) -> Option<FourHit> {
        let ray = self.ray(origin, dir, 0.0);
        match self.stack {
            0..=64 => self.nearest_with(&mut [(0.0, 0); 64], &ray, sheared, t_max, ignore),
            n => self.nearest_with(&mut vec![(0.0, 0); n], &ray, sheared, t_max, ignore),
        }
    }

    fn nearest_with(
        &self,
        stack: &mut [(f32, u32)],
        ray: &TurnedRay,
        sheared: &ShearedRay,
        mut t_max: f32,
        ignore: &dyn Fn(u32) -> bool,
    ) -> Option<FourHit> {
        let mut best = None;
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (t, current) = stack[waiting];
            if t > t_max {
                continue;
            }
            if current & LEAF != 0 {
                if let Some(hit) = self.fours[(current ^ LEAF) as usize].intersect(sheared, t_max, ignore) {
                    t_max = hit.t;
                    best = Some(hit);
                }
                continue;
            }
            let node = &self.nodes[current as usize];
            let (near, mut mask) = ray.enter(node, t_max);
            let near = near.to_array();
            let bottom = waiting;
            // Nearest first.
            while mask != 0 {
                let i = mask.trailing_zeros() as usize & 3;
                mask &= mask - 1;
                let mut at = waiting;
                while at > bottom && stack[at - 1].0 < near[i] {
                    stack[at] = stack[at - 1];
                    at -= 1;
                }
                stack[at] = (near[i], node.children[i]);
                waiting += 1;
            }
        }
        best
    }

    /// Whether anything is hit in (0, t_max).
    #[inline(never)]
    pub fn any(
        &self,
        (origin, dir, sheared): (Vec3, Vec3, &ShearedRay),
        t_max: f32,
        ignore: &dyn Fn(u32) -> bool,
    ) -> bool {
        let mut is_hit = false;
        self.within(&self.ray(origin, dir, 0.0), t_max, |four| {
            is_hit = four.intersect(sheared, t_max, ignore).is_some();
            is_hit
        });
        is_hit
    }

    /// The triangles near a segment, and possibly more.
    #[inline(never)]
    pub fn near(&self, around: &Around, found: &mut dyn FnMut(Near)) {
        let ray = self.ray(around.origin, around.dir, around.radius);
        self.within(&ray, around.length, |four| {
            four.near(around)
                .for_each(|(object, corners)| found(Near::Triangle(object, corners)));
            false
        });
    }

    /// Calls `visit` for the triangles whose boxes a ray meets before `t_max`, until it returns true.
    fn within(&self, ray: &TurnedRay, t_max: f32, mut visit: impl FnMut(&Four) -> bool) {
        let mut stack = [0; 64];
        let mut long = Vec::new();
        let stack = match self.stack {
            0..=64 => &mut stack[..],
            n => {
                long.resize(n, 0);
                &mut long
            }
        };
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let node = &self.nodes[stack[waiting] as usize];
            let (_, mut mask) = ray.enter(node, t_max);
            while mask != 0 {
                let child = node.children[mask.trailing_zeros() as usize & 3];
                mask &= mask - 1;
                if child & LEAF == 0 {
                    stack[waiting] = child;
                    waiting += 1;
                } else if visit(&self.fours[(child ^ LEAF) as usize]) {
                    return;
                }
            }
        }
    }

    /// The objects of the tree's triangles.
    pub fn objects(&self) -> impl Iterator<Item = u32> {
        self.fours.iter().flat_map(Four::objects)
    }
}

#[cfg(test)]
mod tests;
