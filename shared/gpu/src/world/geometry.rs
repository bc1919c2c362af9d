//! Hierarchies and shapes in buffers: no pointers, all trees in the same lists. `kernels/geometry.wgsl` has the same
//! structs.

use super::list;
use super::reason::{Of, Reason, Why};
use crate::device::{Buffer, Device, Kernel};
use crate::error::Result;
use crate::kernels::{Needs, Program};
use crate::self_test::Tested;
use beamfarm_render::world::geometry::flat::{self, Child, FourTriangles, Hierarchies};
use beamfarm_render::world::geometry::{Geometry, Object, Shape};
use bytemuck::{Pod, Zeroable};

/// Most entries of a ray's stack.
pub(crate) const MOST_STACK: u64 = 256;
/// Bits of a number in a node's children.
const NUMBER_BITS: u32 = 29;

const LEAF: u32 = 1 << 31;
const OF_FOUR: u32 = LEAF;
const OF_OBJECT: u32 = LEAF | 1 << 29;
const OF_SLIVERS: u32 = LEAF | 1 << 30;
const NOTHING: u32 = u32::MAX;

/// Four boxes and their contents.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Node {
    /// By axis; lower and upper sides. Inside out for missing children.
    pub bounds: [[[f32; 4]; 2]; 3],
    /// Nodes by number, or kinds of leaves with their numbers.
    pub children: [u32; 4],
}

/// Up to four triangles side by side.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Four {
    /// By corner and axis; NaN for missing triangles.
    pub corners: [[[f32; 4]; 3]; 3],
    /// The triangles' objects; 0 in separately searched mesh trees.
    pub objects: [u32; 4],
    /// The triangles' numbers within their meshes.
    pub triangles: [u32; 4],
}

/// Four boxes with their own axes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct TurnedNode {
    /// By axis and coordinate.
    pub axes: [[[f32; 4]; 3]; 3],
    /// By axis: from and to, along it.
    pub bounds: [[[f32; 4]; 2]; 3],
    /// As in [`Node`].
    pub children: [u32; 4],
}

/// A tree of slivers.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct SliverTree {
    /// The origin of positions.
    pub center: [f32; 3],
    /// The largest distance of any corner from it.
    pub radius: f32,
    /// Its first node.
    pub root: u32,
    padding: [u32; 3],
}

/// A shape, and the map from render space to its own space, by columns.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct ObjectShape {
    /// Column of the map.
    pub x_axis: [f32; 3],
    /// Mesh, sphere, disc, cylinder: 0 to 3.
    pub shape: u32,
    /// Column of the map.
    pub y_axis: [f32; 3],
    /// The root of a separately searched mesh.
    pub root: u32,
    /// Column of the map.
    pub z_axis: [f32; 3],
    /// Class bits, by which rays pass through it.
    pub classes: u32,
    /// Column of the map.
    pub translation: [f32; 3],
    padding: u32,
}

/// Sizes of a scene's geometry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Nodes of axis-aligned boxes.
    pub nodes: u64,
    /// Groups of four triangles.
    pub fours: u64,
    /// Nodes of oriented boxes.
    pub turned_nodes: u64,
    /// Trees of slivers.
    pub sliver_trees: u64,
    /// Objects.
    pub objects: u64,
    /// Stack entries that a ray may need: waiting children in the tree over everything, in a mesh tree entered from
    /// there, and in a tree of slivers entered from either.
    pub stack: u64,
}

impl Sizes {
    /// Counts without building anything.
    #[must_use]
    pub fn of(hierarchies: &Hierarchies) -> Self {
        let mut sizes = Self {
            objects: hierarchies.placed.len() as u64,
            ..Self::default()
        };
        for tree in &hierarchies.trees {
            sizes.nodes += tree.node_count().max(1) as u64;
            sizes.fours += tree.fours().len() as u64;
            for slivers in tree.slivers() {
                sizes.sliver_trees += 1;
                sizes.turned_nodes += slivers.nodes().len() as u64;
                sizes.fours += slivers.fours().len() as u64;
            }
        }
        let trees = 0..hierarchies.trees.len();
        sizes.stack = trees.map(|tree| stack(hierarchies, tree)).max().unwrap_or(0);
        sizes
    }

    /// Content and bytes of each buffer, in binding order.
    fn buffers(&self) -> [(&'static str, u64); 5] {
        let bytes = |count: u64, one: usize| count.max(1) * one as u64;
        [
            ("boxes", bytes(self.nodes, size_of::<Node>())),
            ("triangles", bytes(self.fours, size_of::<Four>())),
            ("turned boxes", bytes(self.turned_nodes, size_of::<TurnedNode>())),
            ("trees of slivers", bytes(self.sliver_trees, size_of::<SliverTree>())),
            ("objects", bytes(self.objects, size_of::<ObjectShape>())),
        ]
    }

    /// Bytes of all buffers together.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.buffers().iter().map(|(_, bytes)| bytes).sum()
    }

    /// The stack entries that a kernel gets: few different sizes, so that few kernels are compiled.
    #[must_use]
    pub fn stack_entries(&self) -> u32 {
        self.stack.clamp(16, MOST_STACK).next_power_of_two() as u32
    }
}

/// Stack entries that a ray may need in a tree and everything inside it.
fn stack(hierarchies: &Hierarchies, tree: usize) -> u64 {
    let own = hierarchies.trees[tree].stack() as u64;
    let slivers = hierarchies.trees[tree].slivers().map(|slivers| slivers.stack() as u64);
    let around = if tree == 0 {
        0
    } else {
        hierarchies.trees[0].stack() as u64
    };
    around + own + slivers.max().unwrap_or(0)
}

/// All reasons why geometry does not fit a device whose largest buffer has this many bytes.
#[must_use]
pub fn reasons(hierarchies: &Hierarchies, objects: &[Object], largest: u64) -> Vec<Reason> {
    let mut found = Vec::new();
    let mut of_scene = |field: &'static str, why: Why| {
        found.push(Reason {
            of: Of::Scene,
            field,
            why,
        });
    };
    let sizes = Sizes::of(hierarchies);
    for (field, bytes) in sizes.buffers() {
        if bytes > largest {
            of_scene(field, Why::Large { bytes, most: largest });
        }
    }
    let (names, kinds) = ((1 << NUMBER_BITS) - 1, sizes.buffers().map(|(field, _)| field));
    let counts = [
        sizes.nodes,
        sizes.fours,
        sizes.turned_nodes,
        sizes.sliver_trees,
        sizes.objects,
    ];
    for (field, count) in kinds.into_iter().zip(counts) {
        if count > names {
            of_scene(field, Why::Many { count, most: names });
        }
    }
    let deep = |tree: usize| {
        let entries = stack(hierarchies, tree);
        let most = MOST_STACK;
        (entries > most).then_some(Why::Deep { entries, most })
    };
    if let Some(why) = deep(0) {
        of_scene("triangles", why);
    }
    for (object, tree) in objects.iter().zip(&hierarchies.placed) {
        if let Some(why) = tree.and_then(deep) {
            found.push(Reason {
                of: Of::Object(object.name.clone()),
                field: "mesh",
                why,
            });
        }
    }
    found
}

/// A scene's geometry in the kernels' layout. No list is empty: an unused element stands in.
#[derive(Debug)]
pub struct FlatGeometry {
    /// The tree over everything first, then those of meshes.
    pub nodes: Vec<Node>,
    /// Groups of triangles of all trees.
    pub fours: Vec<Four>,
    /// Oriented nodes of all trees of slivers.
    pub turned_nodes: Vec<TurnedNode>,
    /// Trees of slivers.
    pub sliver_trees: Vec<SliverTree>,
    /// By object number.
    pub objects: Vec<ObjectShape>,
    /// How much it is.
    pub sizes: Sizes,
}

impl FlatGeometry {
    /// Lays out the geometry of objects: a scene's `geometry()` and its description's objects. `classes`: by object
    /// number, the bits by which rays pass through it.
    ///
    /// # Errors
    /// All reasons why it does not fit a device whose largest buffer has this many bytes.
    pub fn new(
        geometry: &Geometry,
        objects: &[Object],
        classes: &dyn Fn(u32) -> u32,
        largest: u64,
    ) -> std::result::Result<Self, Vec<Reason>> {
        let hierarchies = geometry.hierarchies();
        let reasons = reasons(&hierarchies, objects, largest);
        if !reasons.is_empty() {
            return Err(reasons);
        }
        let sizes = Sizes::of(&hierarchies);
        let mut flat = Self {
            nodes: Vec::with_capacity(sizes.nodes as usize),
            fours: Vec::with_capacity(sizes.fours as usize),
            turned_nodes: Vec::with_capacity(sizes.turned_nodes as usize),
            sliver_trees: Vec::with_capacity(sizes.sliver_trees as usize),
            objects: Vec::with_capacity(objects.len()),
            sizes,
        };
        let roots: Vec<u32> = hierarchies.trees.iter().map(|tree| flat.add(*tree)).collect();
        for ((number, object), tree) in (0..).zip(objects).zip(&hierarchies.placed) {
            let root = tree.map_or(NOTHING, |tree| roots[tree]);
            flat.objects.push(object_shape(&object.shape, root, classes(number)));
        }
        flat.fill();
        Ok(flat)
    }

    /// Adds a tree. Returns the number of its first node.
    fn add(&mut self, tree: flat::Tree) -> u32 {
        let root = self.nodes.len() as u32;
        let slivers = self.sliver_trees.len() as u32;
        let fours = self.fours.len() as u32;
        let number = |child: Child| match child {
            Child::None => NOTHING,
            Child::Node(number) => root + number,
            Child::Four(number) => OF_FOUR | (fours + number),
            Child::Slivers(number) => OF_SLIVERS | (slivers + number),
            Child::Object(number) => OF_OBJECT | number,
        };
        self.nodes.extend(tree.nodes().map(|node| Node {
            bounds: node.bounds,
            children: node.children.map(number),
        }));
        if tree.node_count() == 0 {
            self.nodes.push(NO_BOXES);
        }
        self.fours.extend(tree.fours().map(four));
        for slivers in tree.slivers() {
            let (root, fours) = (self.turned_nodes.len() as u32, self.fours.len() as u32);
            let number = |child: Child| match child {
                Child::Node(number) => root + number,
                Child::Four(number) => OF_FOUR | (fours + number),
                Child::None | Child::Slivers(_) | Child::Object(_) => NOTHING,
            };
            self.turned_nodes.extend(slivers.nodes().map(|node| TurnedNode {
                axes: node.axes,
                bounds: node.bounds,
                children: node.children.map(number),
            }));
            self.fours.extend(slivers.fours().map(four));
            let (center, radius) = slivers.sphere();
            self.sliver_trees.push(SliverTree {
                center,
                radius,
                root,
                padding: [0; 3],
            });
        }
        root
    }

    /// Adds a hierarchy whose objects are not the scene's, so that rays do not meet them: their numbers begin at
    /// `first`. Returns the number of its first node.
    pub(crate) fn add_boxes(&mut self, nodes: impl ExactSizeIterator<Item = flat::Node>, first: u32) -> u32 {
        let root = self.nodes.len() as u32;
        let number = |child: Child| match child {
            Child::Node(number) => root + number,
            Child::Object(number) => OF_OBJECT | (first + number),
            Child::None | Child::Four(_) | Child::Slivers(_) => NOTHING,
        };
        self.nodes.extend(nodes.map(|node| Node {
            bounds: node.bounds,
            children: node.children.map(number),
        }));
        self.sizes.nodes = self.nodes.len() as u64;
        root
    }

    /// Puts one element into empty lists.
    fn fill(&mut self) {
        fn one<T: Pod>(list: &mut Vec<T>) {
            if list.is_empty() {
                list.push(T::zeroed());
            }
        }
        one(&mut self.fours);
        one(&mut self.turned_nodes);
        one(&mut self.sliver_trees);
        one(&mut self.objects);
    }

    /// Uploads it to a device.
    ///
    /// # Errors
    /// Device errors.
    pub fn upload(&self, device: &Device, there: Option<(&Self, &GeometryBuffers)>) -> Result<GeometryBuffers> {
        let [boxes, triangles, turned, slivers, objects] = self.sizes.buffers().map(|(name, _)| name);
        macro_rules! known {
            ($list:ident, $place:literal) => {
                there.map(|(flat, on)| (&flat.$list[..], &on.buffers[$place]))
            };
        }
        Ok(GeometryBuffers {
            buffers: [
                list(device, boxes, &self.nodes, known!(nodes, 0))?,
                list(device, triangles, &self.fours, known!(fours, 1))?,
                list(device, turned, &self.turned_nodes, known!(turned_nodes, 2))?,
                list(device, slivers, &self.sliver_trees, known!(sliver_trees, 3))?,
                list(device, objects, &self.objects, known!(objects, 4))?,
            ],
            needs: Needs {
                stack: self.sizes.stack_entries(),
                ..Needs::ALL
            },
        })
    }
}

/// Geometry on a device.
pub struct GeometryBuffers {
    buffers: [Buffer; 5],
    /// The needs that kernels with rays are compiled for.
    pub needs: Needs,
}

impl GeometryBuffers {
    /// In binding order, from 20.
    #[must_use]
    pub fn in_order(&self) -> [&Buffer; 5] {
        self.buffers.each_ref()
    }

    /// An entry point of a program with rays, ready to run.
    #[must_use]
    pub fn kernel(&self, tested: &Tested, program: &Program, entry: &str) -> Kernel {
        tested.kernel_for(program, entry, self.needs)
    }
}

/// A node that no ray enters.
const NO_BOXES: Node = Node {
    bounds: [[[f32::INFINITY; 4], [f32::NEG_INFINITY; 4]]; 3],
    children: [NOTHING; 4],
};

fn four(four: FourTriangles) -> Four {
    Four {
        corners: four.corners,
        objects: four.objects,
        triangles: four.triangles,
    }
}

fn object_shape(shape: &Shape, root: u32, classes: u32) -> ObjectShape {
    let (number, placement) = match shape {
        // Scenes with strands are refused.
        Shape::Mesh { placement, .. } | Shape::Strands { placement, .. } => (0, placement),
        Shape::Sphere { placement, .. } => (1, placement),
        Shape::Disc { placement, .. } => (2, placement),
        Shape::Cylinder { placement, .. } => (3, placement),
    };
    let map = &placement.object_from_render;
    ObjectShape {
        x_axis: map.matrix3.x_axis.to_array(),
        shape: number,
        y_axis: map.matrix3.y_axis.to_array(),
        root,
        z_axis: map.matrix3.z_axis.to_array(),
        classes,
        translation: map.translation.to_array(),
        padding: 0,
    }
}

#[cfg(test)]
pub(crate) mod tests;
