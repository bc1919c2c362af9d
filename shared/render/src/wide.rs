//! Trees with four boxes per node, for rays and points.
//!
//! obvhs builds the binary trees that they are made from. Four boxes fit the vector instructions of any machine.

use crate::math::Vec3;
use glam::{Vec3A, Vec4};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;

/// A tree whose leaves are numbered.
#[derive(Default)]
pub(crate) struct WideTree {
    nodes: Vec<WideNode>,
    /// Entries that a traversal's stack may need.
    stack: usize,
    /// The same, down to the trees that are put into this one.
    over: usize,
}

/// Where in a tree over trees one of them goes.
#[derive(Clone, Copy, Default)]
pub(crate) struct Slot {
    node: usize,
    child: usize,
}

/// Four boxes and what is in them.
#[repr(align(16))]
pub(crate) struct WideNode {
    /// By axis: lower and upper bounds. Unused boxes are inside out.
    pub bounds: [[Vec4; 2]; 3],
    /// A node's number, or [`LEAF`] plus a leaf's number.
    children: [u32; 4],
}

const LEAF: u32 = 1 << 31;

/// What is in a box.
pub(crate) enum Below {
    Node(u32),
    Leaf(u32),
}

impl WideNode {
    /// What is in one of the boxes, if anything.
    pub fn child(&self, place: usize) -> Option<Below> {
        let child = self.children[place];
        match child & LEAF {
            0 if self.bounds[0][0][place] <= self.bounds[0][1][place] => Some(Below::Node(child)),
            0 => None,
            _ => Some(Below::Leaf(child ^ LEAF)),
        }
    }
}

/// A box grown by a few roundings, so that rays along its faces and flat boxes are not missed.
pub(crate) fn padded(min: Vec3, max: Vec3) -> Aabb {
    let pad = (min.abs().max(max.abs()).max_element() * 1e-6).max(1e-30);
    Aabb::new(Vec3A::from(min - pad), Vec3A::from(max + pad))
}

/// Whether boxes can be compared along the ray. If not, unused boxes would be met as well, and their child is the root.
#[inline(always)]
fn is_sound(origin: Vec3, dir: Vec3) -> bool {
    origin.is_finite() && dir.is_finite()
}

/// A ray, prepared for tests against boxes.
struct BoxRay {
    origin: [Vec4; 3],
    inverse: [Vec4; 3],
    /// By axis: which side of a box the ray comes to first.
    near: [usize; 3],
    /// How much boxes are grown by.
    radius: Vec4,
}

impl BoxRay {
    #[inline]
    fn new(origin: Vec3, dir: Vec3, radius: f32) -> Self {
        // Kept finite, so that zero is never multiplied by infinity. A replaced component does not move along its axis.
        let least = Vec4::splat((dir.abs().max_element() * 1e-12).max(1e-30));
        let dir = dir.extend(1.0);
        let none = dir.abs().cmplt(least);
        let inverse = Vec4::select(none, least.copysign(dir), dir).recip();
        let near = inverse.is_negative_bitmask();
        Self {
            origin: [Vec4::splat(origin.x), Vec4::splat(origin.y), Vec4::splat(origin.z)],
            inverse: [Vec4::splat(inverse.x), Vec4::splat(inverse.y), Vec4::splat(inverse.z)],
            near: [near as usize & 1, near as usize >> 1 & 1, near as usize >> 2 & 1],
            radius: Vec4::splat(radius),
        }
    }

    /// Where the ray enters a node's boxes, and which of them it meets before `t_max`. `GROWN`: boxes are grown by the
    /// radius.
    #[inline(always)]
    fn enter<const GROWN: bool>(&self, node: &WideNode, t_max: f32) -> (Vec4, u32) {
        // Ize 2013, Robust BVH ray traversal: the exits move out by this factor, so that rounding loses no box.
        const FARTHER: f32 = 1.0 + 4.0 * f32::EPSILON;
        let [x, y, z] = &node.bounds;
        let side = |bounds: &[Vec4; 2], axis: usize, side: usize| {
            let to = bounds[side & 1] - self.origin[axis];
            let to = match (GROWN, side & 1) {
                (false, _) => to,
                (true, 0) => to - self.radius,
                (true, _) => to + self.radius,
            };
            to * self.inverse[axis]
        };
        let [nx, ny, nz] = self.near;
        let near = side(x, 0, nx).max(side(y, 1, ny)).max(side(z, 2, nz));
        let far = side(x, 0, nx ^ 1).min(side(y, 1, ny ^ 1)).min(side(z, 2, nz ^ 1));
        let near = near.max(Vec4::ZERO);
        let far = (far * FARTHER).min(Vec4::splat(t_max));
        (near, near.cmple(far).bitmask())
    }
}

/// A segment of a ray and a radius around it.
#[derive(Clone, Copy)]
pub(crate) struct Around {
    pub origin: Vec3,
    pub dir: Vec3,
    /// In units of the direction's length.
    pub length: f32,
    pub radius: f32,
    /// Normals, and the product of each with any point of its plane.
    pub planes: [[f32; 4]; 2],
}

impl Around {
    /// A plane with nothing behind it.
    pub const NO_PLANE: [f32; 4] = [0.0, 0.0, 0.0, -1.0];
}

/// An entry of a traversal's stack: where the ray enters, and the child.
type Waiting = (f32, u32);

impl WideTree {
    /// Make the tree from a binary one. `is_leaf`: by node of the binary tree. `leaf`: the number of the leaf that a
    /// node becomes.
    pub fn new(binary: &Bvh2, is_leaf: &[bool], leaf: impl FnMut(usize) -> u32) -> Self {
        let mut tree = Self::default();
        if !binary.nodes.is_empty() {
            let mut builder = Builder {
                binary,
                is_leaf,
                leaf,
                nodes: &mut tree.nodes,
            };
            let levels = builder.node(vec![0]);
            tree.stack = 3 * levels + 1;
        }
        tree
    }

    /// A tree over trees that are yet to be [`put`](Self::put) into it, and the slot of each by its number: the leaves
    /// of the binary tree stand for them.
    pub fn over_trees(binary: &Bvh2, is_leaf: &[bool]) -> (Self, Vec<Slot>) {
        let number = |index: usize| binary.primitive_indices[binary.nodes[index].first_index as usize];
        let mut tree = Self::new(binary, is_leaf, number);
        let mut places = vec![Slot::default(); binary.primitive_indices.len()];
        for (node, four) in tree.nodes.iter().enumerate() {
            for (child, number) in four.children.iter().enumerate().filter(|(_, n)| **n & LEAF != 0) {
                places[(number ^ LEAF) as usize] = Slot { node, child };
            }
        }
        tree.over = tree.stack;
        (tree, places)
    }

    /// Put a tree into its slot. `first`: added to the numbers of its leaves.
    pub fn put(&mut self, place: Slot, tree: Self, first: u32) {
        let offset = self.nodes.len() as u32;
        self.nodes[place.node].children[place.child] = offset;
        self.nodes.extend(tree.nodes.into_iter().map(|mut node| {
            for (i, child) in node.children.iter_mut().enumerate() {
                if *child & LEAF != 0 {
                    *child += first;
                } else if node.bounds[0][0][i] <= node.bounds[0][1][i] {
                    *child += offset;
                }
            }
            node
        }));
        self.stack = self.stack.max(self.over + tree.stack);
    }

    /// The nodes, the root first.
    pub fn nodes(&self) -> &[WideNode] {
        &self.nodes
    }

    /// Entries that the stack of a traversal may need.
    pub fn stack(&self) -> usize {
        self.stack
    }

    /// The bits of the whole tree.
    #[cfg(test)]
    pub fn bits(&self) -> Vec<u32> {
        let node = |node: &WideNode| {
            let bounds = node
                .bounds
                .iter()
                .flatten()
                .flat_map(|four| four.to_array())
                .map(f32::to_bits);
            bounds.chain(node.children).collect::<Vec<u32>>()
        };
        self.nodes.iter().flat_map(node).chain([self.stack as u32]).collect()
    }

    /// Calls `visit(leaf, t_max)`, which returns the new `t_max`, for the leaves whose boxes a ray meets before it.
    /// Boxes are visited roughly front to back, until none is left or `t_max` is negative.
    #[inline(always)]
    pub fn along_ray(&self, origin: Vec3, dir: Vec3, t_max: f32, visit: impl FnMut(u32, f32) -> f32) {
        match self.stack {
            _ if !is_sound(origin, dir) => {}
            0 => {}
            1..=16 => self.along_ray_with(&mut [(0.0, 0); 16], origin, dir, t_max, visit),
            17..=32 => self.along_ray_with(&mut [(0.0, 0); 32], origin, dir, t_max, visit),
            33..=64 => self.along_ray_with(&mut [(0.0, 0); 64], origin, dir, t_max, visit),
            n => self.along_ray_with(&mut vec![(0.0, 0); n], origin, dir, t_max, visit),
        }
    }

    fn along_ray_with(
        &self,
        stack: &mut [Waiting],
        origin: Vec3,
        dir: Vec3,
        mut t_max: f32,
        mut visit: impl FnMut(u32, f32) -> f32,
    ) {
        let ray = BoxRay::new(origin, dir, 0.0);
        let mut waiting = 0;
        let mut current = 0;
        loop {
            if current & LEAF == 0 {
                let node = &self.nodes[current as usize];
                let (near, mut mask) = ray.enter::<false>(node, t_max);
                if mask != 0 {
                    // The nearest child is next; the others wait in order of distance.
                    let bottom = waiting;
                    let near = near.to_array();
                    while mask != 0 {
                        let i = mask.trailing_zeros() as usize & 3;
                        mask &= mask - 1;
                        let (t, child) = (near[i], node.children[i]);
                        let mut at = waiting;
                        while at > bottom && stack[at - 1].0 < t {
                            stack[at] = stack[at - 1];
                            at -= 1;
                        }
                        stack[at] = (t, child);
                        waiting += 1;
                    }
                    waiting -= 1;
                    current = stack[waiting].1;
                    continue;
                }
            } else {
                t_max = visit(current ^ LEAF, t_max);
            }
            loop {
                if waiting == 0 {
                    return;
                }
                waiting -= 1;
                let (t, child) = stack[waiting];
                if t <= t_max {
                    current = child;
                    break;
                }
            }
        }
    }

    /// Whether `visit` accepts any leaf whose box a ray meets before `t_max`. The order of calls is not defined.
    #[inline(always)]
    pub fn any_along_ray(&self, origin: Vec3, dir: Vec3, t_max: f32, visit: impl FnMut(u32) -> bool) -> bool {
        let ray = BoxRay::new(origin, dir, 0.0);
        match self.stack {
            _ if !is_sound(origin, dir) => false,
            0 => false,
            1..=32 => self.any_along_with(&mut [0; 32], &ray, t_max, visit),
            33..=64 => self.any_along_with(&mut [0; 64], &ray, t_max, visit),
            n => self.any_along_with(&mut vec![0; n], &ray, t_max, visit),
        }
    }

    /// By node: whether any leaf below it satisfies `is_asked`.
    pub fn leading_to(&self, is_asked: impl Fn(u32) -> bool) -> Vec<bool> {
        let mut leads = vec![false; self.nodes.len()];
        // Nodes come after their ancestors.
        for (number, node) in self.nodes.iter().enumerate().rev() {
            leads[number] = node.children.iter().any(|child| match child & LEAF {
                // An unused child points to the root.
                0 => leads[*child as usize],
                _ => is_asked(child ^ LEAF),
            });
        }
        leads
    }

    /// Calls `visit` for the leaves whose boxes come within a radius of a segment and are not wholly behind one of the
    /// planes, and perhaps for a few more. `leads`: by node, whether to open it.
    #[inline(always)]
    pub fn near(&self, around: &Around, leads: &impl Fn(u32) -> bool, visit: impl FnMut(u32)) {
        match self.stack {
            _ if !is_sound(around.origin, around.dir) || !around.radius.is_finite() => {}
            0 => {}
            1..=32 => self.near_with(&mut [0; 32], around, leads, visit),
            33..=64 => self.near_with(&mut [0; 64], around, leads, visit),
            n => self.near_with(&mut vec![0; n], around, leads, visit),
        }
    }

    fn near_with(&self, stack: &mut [u32], around: &Around, leads: &impl Fn(u32) -> bool, mut visit: impl FnMut(u32)) {
        let ray = BoxRay::new(around.origin, around.dir, around.radius);
        let planes = around.planes.map(|plane| plane.map(Vec4::splat));
        let mut waiting = 1;
        stack[0] = 0;
        while waiting > 0 {
            waiting -= 1;
            let node = &self.nodes[stack[waiting] as usize];
            let [x, y, z] = &node.bounds;
            let (_, mut mask) = ray.enter::<true>(node, around.length);
            for [nx, ny, nz, at] in planes {
                let most = |bounds: &[Vec4; 2], n: Vec4| (bounds[0] * n).max(bounds[1] * n);
                // Unused boxes never pass.
                mask &= (most(x, nx) + most(y, ny) + most(z, nz)).cmpgt(at).bitmask();
            }
            while mask != 0 {
                let child = node.children[mask.trailing_zeros() as usize & 3];
                mask &= mask - 1;
                if child & LEAF != 0 {
                    visit(child ^ LEAF);
                } else if leads(child) {
                    stack[waiting] = child;
                    waiting += 1;
                }
            }
        }
    }

    fn any_along_with(&self, stack: &mut [u32], ray: &BoxRay, t_max: f32, mut visit: impl FnMut(u32) -> bool) -> bool {
        let mut waiting = 1;
        stack[0] = 0;
        while waiting > 0 {
            waiting -= 1;
            let node = &self.nodes[stack[waiting] as usize];
            let (_, mut mask) = ray.enter::<false>(node, t_max);
            while mask != 0 {
                let child = node.children[mask.trailing_zeros() as usize & 3];
                mask &= mask - 1;
                if child & LEAF == 0 {
                    stack[waiting] = child;
                    waiting += 1;
                } else if visit(child ^ LEAF) {
                    return true;
                }
            }
        }
        false
    }

    /// Calls `visit` for the leaves whose boxes contain a point.
    #[inline(always)]
    pub fn around_point(&self, point: Vec3, visit: impl FnMut(u32)) {
        match self.stack {
            0 => {}
            1..=64 => self.around_point_with(&mut [0; 64], point, visit),
            n => self.around_point_with(&mut vec![0; n], point, visit),
        }
    }

    fn around_point_with(&self, stack: &mut [u32], point: Vec3, mut visit: impl FnMut(u32)) {
        let [x, y, z] = [Vec4::splat(point.x), Vec4::splat(point.y), Vec4::splat(point.z)];
        let mut waiting = 1;
        stack[0] = 0;
        while waiting > 0 {
            waiting -= 1;
            let current = stack[waiting];
            if current & LEAF != 0 {
                visit(current ^ LEAF);
                continue;
            }
            let node = &self.nodes[current as usize];
            let within = |axis: &[Vec4; 2], at: Vec4| axis[0].cmple(at) & at.cmple(axis[1]);
            let [in_x, in_y, in_z] = [
                within(&node.bounds[0], x),
                within(&node.bounds[1], y),
                within(&node.bounds[2], z),
            ];
            let mut mask = (in_x & in_y & in_z).bitmask();
            while mask != 0 {
                stack[waiting] = node.children[mask.trailing_zeros() as usize & 3];
                waiting += 1;
                mask &= mask - 1;
            }
        }
    }
}

struct Builder<'a, L> {
    binary: &'a Bvh2,
    is_leaf: &'a [bool],
    leaf: L,
    nodes: &'a mut Vec<WideNode>,
}

impl<L: FnMut(usize) -> u32> Builder<'_, L> {
    /// Add a node for nodes of the binary tree, or for their descendants while there is room. Returns the number of
    /// levels from here.
    fn node(&mut self, mut children: Vec<usize>) -> usize {
        let nodes = &self.binary.nodes;
        while children.len() < 4 {
            let area = |i: &usize| nodes[children[*i]].aabb().half_area();
            let open = (0..children.len())
                .filter(|&i| !self.is_leaf[children[i]])
                .max_by(|i, j| area(i).total_cmp(&area(j)));
            let Some(i) = open else { break };
            let first = nodes[children[i]].first_index as usize;
            children[i] = first;
            children.push(first + 1);
        }
        let at = self.nodes.len();
        self.nodes.push(WideNode {
            bounds: [[Vec4::INFINITY, Vec4::NEG_INFINITY]; 3],
            children: [0; 4],
        });
        let mut levels = 0;
        for (i, &child) in children.iter().enumerate() {
            let bounds = nodes[child].aabb();
            for axis in 0..3 {
                let [low, high] = &mut self.nodes[at].bounds[axis];
                (low[i], high[i]) = (bounds.min[axis], bounds.max[axis]);
            }
            self.nodes[at].children[i] = if self.is_leaf[child] {
                LEAF + (self.leaf)(child)
            } else {
                let number = self.nodes.len() as u32;
                let first = nodes[child].first_index as usize;
                levels = levels.max(self.node(vec![first, first + 1]));
                number
            };
        }
        levels + 1
    }
}
