//! Read access to the hierarchies, for engines that lay them out differently.

use super::Geometry;
use super::slivers::{self, SliverTree};
use super::tree::{ItemTree, Leaf};
use super::triangles::Four;
use crate::wide::Below;
use std::collections::HashMap;

/// All hierarchies of a scene. See [`Geometry::hierarchies`].
pub struct Hierarchies<'a> {
    /// First the hierarchy over everything in render space; then those of meshes, once each, however many objects share
    /// one.
    pub trees: Vec<Tree<'a>>,
    /// By object: its mesh's hierarchy, in object space, if rays reach it through the object's placement.
    pub placed: Vec<Option<usize>>,
}

/// A hierarchy over groups of four triangles, hierarchies of slivers, and objects.
#[derive(Clone, Copy)]
pub struct Tree<'a>(&'a ItemTree);

/// A hierarchy over groups of four triangles, whose boxes have their own axes.
#[derive(Clone, Copy)]
pub struct Slivers<'a>(&'a SliverTree);

/// Four boxes and their contents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// By axis: lower sides, then upper sides. Inside out for missing children.
    pub bounds: [[[f32; 4]; 2]; 3],
    /// The content of each box.
    pub children: [Child; 4],
}

/// The content of a box, by its number within the tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Child {
    /// Nothing.
    None,
    /// A node, which comes after this one.
    Node(u32),
    /// Triangles.
    Four(u32),
    /// A hierarchy of slivers.
    Slivers(u32),
    /// An object of the scene.
    Object(u32),
}

/// Four boxes, each with its own axes, and their contents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurnedNode {
    /// By axis and coordinate.
    pub axes: [[[f32; 4]; 3]; 3],
    /// By axis: from and to, along it.
    pub bounds: [[[f32; 4]; 2]; 3],
    /// [`Child::Node`], [`Child::Four`] or [`Child::None`].
    pub children: [Child; 4],
}

/// Up to four triangles.
#[derive(Clone, Copy, Debug)]
pub struct FourTriangles {
    /// By corner and axis; NaN where there is no triangle.
    pub corners: [[[f32; 4]; 3]; 3],
    /// The triangles' objects; 0 in hierarchies of meshes.
    pub objects: [u32; 4],
    /// The triangles' numbers within their meshes.
    pub triangles: [u32; 4],
}

impl Geometry {
    /// All hierarchies that rays are searched in.
    pub fn hierarchies(&self) -> Hierarchies<'_> {
        let (tree, placed) = self.parts();
        let mut trees = vec![Tree(tree)];
        let mut known = HashMap::new();
        let placed = placed.map(|tree| {
            let tree = tree?;
            let number = *known.entry(std::ptr::from_ref(tree)).or_insert(trees.len());
            if number == trees.len() {
                trees.push(Tree(tree));
            }
            Some(number)
        });
        let placed = placed.collect();
        Hierarchies { trees, placed }
    }
}

impl<'a> Tree<'a> {
    /// Stack entries that a traversal may need for waiting children, visited nearest first; excludes nested trees. Zero
    /// without nodes.
    pub fn stack(&self) -> usize {
        self.0.boxes().stack()
    }

    /// The number of nodes. The first is the root.
    pub fn node_count(&self) -> usize {
        self.0.boxes().nodes().len()
    }

    /// The nodes.
    pub fn nodes(&self) -> impl ExactSizeIterator<Item = Node> + use<'a> {
        let tree = self.0;
        tree.boxes().nodes().iter().map(|node| {
            let bounds = node.bounds.map(|sides| sides.map(|four| four.to_array()));
            let child = |place: usize| match node.child(place) {
                None => Child::None,
                Some(Below::Node(number)) => Child::Node(number),
                Some(Below::Leaf(leaf)) => match tree.leaves()[leaf as usize] {
                    Leaf::Four(number) => Child::Four(number),
                    Leaf::Slivers(number) => Child::Slivers(number),
                    Leaf::Other(number) => Child::Object(number),
                },
            };
            let children = [0, 1, 2, 3].map(child);
            Node { bounds, children }
        })
    }

    /// Groups of triangles by number.
    pub fn fours(&self) -> impl ExactSizeIterator<Item = FourTriangles> + use<'a> {
        self.0.fours().iter().map(of_four)
    }

    /// Hierarchies of slivers by number.
    pub fn slivers(&self) -> impl ExactSizeIterator<Item = Slivers<'a>> + use<'a> {
        self.0.slivers().iter().map(Slivers)
    }
}

impl<'a> Slivers<'a> {
    /// The origin of positions, and the largest distance of any corner from it.
    pub fn sphere(&self) -> ([f32; 3], f32) {
        (self.0.center.to_array(), self.0.radius)
    }

    /// Stack entries that a traversal may need.
    pub fn stack(&self) -> usize {
        self.0.stack
    }

    /// The nodes. The first is the root.
    pub fn nodes(&self) -> impl ExactSizeIterator<Item = TurnedNode> + use<'a> {
        self.0.nodes.iter().map(|node| {
            let child = |place: usize| match node.children[place] {
                _ if node.is_there >> place & 1 == 0 => Child::None,
                leaf if leaf & slivers::LEAF != 0 => Child::Four(leaf ^ slivers::LEAF),
                node => Child::Node(node),
            };
            TurnedNode {
                axes: node.axes.map(|axis| axis.map(|four| four.to_array())),
                bounds: node.bounds.map(|sides| sides.map(|four| four.to_array())),
                children: [0, 1, 2, 3].map(child),
            }
        })
    }

    /// Groups of triangles by number.
    pub fn fours(&self) -> impl ExactSizeIterator<Item = FourTriangles> + use<'a> {
        self.0.fours.iter().map(of_four)
    }
}

fn of_four(four: &Four) -> FourTriangles {
    FourTriangles {
        corners: four.corners.map(|corner| corner.map(|axis| axis.to_array())),
        objects: four.ids.map(|id| id.object),
        triangles: four.ids.map(|id| id.triangle),
    }
}
