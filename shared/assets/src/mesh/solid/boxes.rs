//! Bounding box trees: what a ray hits, what overlaps a box, and which boxes of two trees overlap.

use glam::{DVec3, Vec3};

/// The most boxes in a leaf.
const IN_LEAF: usize = 4;

/// A box by its corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Bounds {
    const NOTHING: Self = Self {
        low: Vec3::INFINITY,
        high: Vec3::NEG_INFINITY,
    };

    /// The box around points, slightly enlarged.
    pub fn around(points: impl IntoIterator<Item = DVec3>) -> Self {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in points {
            (low, high) = (low.min(p), high.max(p));
        }
        let pad = (low.abs().max(high.abs()).max_element() * 1e-6).max(1e-30);
        Self {
            low: (low - pad).as_vec3(),
            high: (high + pad).as_vec3(),
        }
    }

    fn and(self, other: &Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    fn meets(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }

    fn half_area(&self) -> f32 {
        let d = self.high - self.low;
        (d.x + d.y) * d.z + d.x * d.y
    }
}

/// A tree whose leaves hold the original boxes by number.
pub(super) struct BoxTree {
    nodes: Vec<Node>,
    /// Box numbers in leaf order.
    numbers: Vec<u32>,
    /// Boxes in the same order.
    boxes: Vec<Bounds>,
}

struct Node {
    bounds: Bounds,
    /// A leaf's first box, else the first of two adjacent children.
    first: u32,
    /// Boxes of a leaf.
    count: u32,
}

/// Nodes of two trees.
pub(super) type Pair = [u32; 2];

impl BoxTree {
    /// Halves always have equal numbers of boxes, so that badly placed boxes cannot slow it down.
    pub fn new(boxes: &[Bounds]) -> Self {
        let mut tree = Self {
            nodes: Vec::new(),
            numbers: (0..boxes.len() as u32).collect(),
            boxes: Vec::new(),
        };
        let of = |number: u32| &boxes[number as usize];
        let mut waiting = Vec::new();
        if !boxes.is_empty() {
            tree.nodes.push(Node::EMPTY);
            waiting.push((0, 0..boxes.len()));
        }
        while let Some((index, range)) = waiting.pop() {
            let own = &mut tree.numbers[range.clone()];
            let around = own.iter().fold(Bounds::NOTHING, |all, number| all.and(of(*number)));
            let next = tree.nodes.len() as u32;
            let is_leaf = own.len() <= IN_LEAF;
            let node: &mut Node = &mut tree.nodes[index];
            *node = Node {
                bounds: around,
                first: if is_leaf { range.start as u32 } else { next },
                count: if is_leaf { own.len() as u32 } else { 0 },
            };
            if is_leaf {
                continue;
            }
            let axis = (around.high - around.low).max_position();
            let at = |number: u32| of(number).low[axis] + of(number).high[axis];
            let half = own.len() / 2;
            own.select_nth_unstable_by(half, |a, b| at(*a).total_cmp(&at(*b)).then(a.cmp(b)));
            let middle = range.start + half;
            tree.nodes.extend([Node::EMPTY, Node::EMPTY]);
            waiting.push((next as usize, range.start..middle));
            waiting.push((next as usize + 1, middle..range.end));
        }
        tree.boxes = tree.numbers.iter().map(|number| *of(*number)).collect();
        tree
    }

    /// A leaf's boxes with their numbers.
    fn boxes(&self, leaf: &Node) -> impl Iterator<Item = (u32, &Bounds)> {
        let range = leaf.first as usize..(leaf.first + leaf.count) as usize;
        self.numbers[range.clone()].iter().copied().zip(&self.boxes[range])
    }

    /// Calls `visit` for the boxes that are hit.
    fn search(&self, is_met: impl Fn(&Bounds) -> bool, mut visit: impl FnMut(u32)) {
        let mut waiting = if self.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(index) = waiting.pop() {
            let node: &Node = &self.nodes[index as usize];
            if !is_met(&node.bounds) {
                continue;
            }
            match node.is_leaf() {
                true => (self.boxes(node).filter(|(_, bounds)| is_met(bounds))).for_each(|(number, _)| visit(number)),
                false => waiting.extend([node.first + 1, node.first]),
            }
        }
    }

    /// Visits the boxes that overlap a box.
    pub fn meeting(&self, other: &Bounds, visit: impl FnMut(u32)) {
        self.search(|bounds| bounds.meets(other), visit);
    }

    /// Visits the boxes that a ray hits.
    pub fn along(&self, from: DVec3, dir: DVec3, visit: impl FnMut(u32)) {
        let inverse = dir.recip();
        let is_met = |bounds: &Bounds| {
            let [low, high] = [bounds.low, bounds.high].map(|p| (p.as_dvec3() - from) * inverse);
            let (near, far) = (low.min(high).max_element(), low.max(high).min_element());
            near <= far && far >= 0.0
        };
        self.search(is_met, visit);
    }

    /// Pairs of nodes that cover all overlaps of two trees; about `count` pairs, if there are that many.
    pub fn pairs(&self, other: &Self, count: usize) -> Vec<Pair> {
        let mut pairs = std::collections::VecDeque::from([[0, 0]]);
        let mut both_leaves = Vec::new();
        while pairs.len() + both_leaves.len() < count
            && let Some(pair) = pairs.pop_front()
        {
            match self.open(other, pair) {
                Opened::Apart => {}
                Opened::Leaves(..) => both_leaves.push(pair),
                Opened::Pairs(next) => pairs.extend(next),
            }
        }
        both_leaves.extend(pairs);
        both_leaves
    }

    /// The first result of `find` on overlapping boxes below a pair of nodes of two trees, searched in at most `steps`
    /// steps.
    pub fn first_of<T>(
        &self,
        other: &Self,
        pair: Pair,
        steps: usize,
        find: impl Fn(u32, u32) -> Option<T>,
    ) -> Option<T> {
        let mut waiting = vec![pair];
        for _ in 0..steps {
            match self.open(other, waiting.pop()?) {
                Opened::Apart => {}
                Opened::Pairs(next) => waiting.extend(next),
                Opened::Leaves(ones, others) => {
                    for (one, bounds) in self.boxes(ones).filter(|(_, bounds)| bounds.meets(&others.bounds)) {
                        let met = other.boxes(others).filter(|(_, theirs)| bounds.meets(theirs));
                        let found = met.into_iter().find_map(|(number, _)| find(one, number));
                        if found.is_some() {
                            return found;
                        }
                    }
                }
            }
        }
        None
    }

    fn open<'a>(&'a self, other: &'a Self, [a, b]: Pair) -> Opened<'a> {
        let (Some(one), Some(two)) = (self.nodes.get(a as usize), other.nodes.get(b as usize)) else {
            return Opened::Apart;
        };
        if !one.bounds.meets(&two.bounds) {
            return Opened::Apart;
        }
        let is_first = two.is_leaf() || one.bounds.half_area() > two.bounds.half_area();
        match (one.is_leaf(), two.is_leaf()) {
            (true, true) => Opened::Leaves(one, two),
            (false, _) if is_first => Opened::Pairs([[one.first, b], [one.first + 1, b]]),
            _ => Opened::Pairs([[a, two.first], [a, two.first + 1]]),
        }
    }
}

impl Node {
    const EMPTY: Self = Self {
        bounds: Bounds::NOTHING,
        first: 0,
        count: 0,
    };

    fn is_leaf(&self) -> bool {
        self.count > 0
    }
}

/// The outcome of comparing two nodes.
enum Opened<'a> {
    Apart,
    Leaves(&'a Node, &'a Node),
    Pairs([Pair; 2]),
}
