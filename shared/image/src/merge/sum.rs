//! Nodes that have arrived, joined as far as they may be.

use super::{Average, MergeError, Node, add, add_mattes, add_saturating, join_radius_sums};
use crate::job::{Block, MAX_PASSES};
use crate::layer::LayerCounts;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The first boundary at or after so many passes: prefixes of 2, 3, 4, 6, 8, 12, ... passes (2^k and 3 2^k), at which a
/// job looks whether its error is small enough.
pub fn next_boundary(passes: u64) -> u64 {
    let power = passes.max(2).next_power_of_two();
    let between = power / 4 * 3;
    match between > 2 && between >= passes {
        true => between,
        false => power,
    }
}

/// The sum of all passes that have arrived, as the fewest nodes: siblings are joined as soon as both are there.
///
/// The complete prefix is held as the binary decomposition of its length, so at most one node a level; passes that
/// arrived ahead of it take what their gaps force them to. With a fence, some more nodes are kept apart: see
/// [`Self::with_fence`].
///
/// A clone shares the images.
#[derive(Clone, Debug)]
pub struct TreeSum {
    width: u32,
    height: u32,
    layers: LayerCounts,
    first_pass: u64,
    fence: Option<u64>,
    /// By first pass. Disjoint; no two are siblings, but for a boundary between them.
    nodes: BTreeMap<u64, Arc<Node>>,
}

impl TreeSum {
    /// No passes yet, of images of this size.
    pub fn new(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            layers: LayerCounts::default(),
            first_pass: 0,
            fence: None,
            nodes: BTreeMap::new(),
        }
    }

    /// The same, of passes that have so many layers beside their radiance.
    pub fn with_layers(self, layers: impl Into<LayerCounts>) -> Self {
        let layers = layers.into();
        Self { layers, ..self }
    }

    /// The same, of passes from this one on. There is no average of them, but they can become part of another sum.
    pub fn with_first_pass(self, first_pass: u64) -> Self {
        Self { first_pass, ..self }
    }

    /// The same, with no node on both sides of the boundaries ([`next_boundary`]) from `fence` on, whatever the order
    /// in which passes arrive. So the average of so many passes can be had when more are there already.
    ///
    /// Blocks that reach across a boundary by themselves cannot be cut: see [`Self::is_across`].
    pub fn with_fence(mut self, fence: u64) -> Self {
        self.fence = Some(next_boundary(fence));
        self
    }

    /// Whether passes on both sides of a boundary are in the block. Aligned blocks beyond the first two of their level
    /// are never across one.
    pub fn is_across(block: Block) -> bool {
        Self::is_across_from(block, 0)
    }

    fn is_across_from(block: Block, fence: u64) -> bool {
        let boundary = next_boundary(fence.max(block.start() + 1));
        boundary < block.passes().end
    }

    /// The boundary from which on nodes are kept apart.
    pub fn fence(&self) -> Option<u64> {
        self.fence
    }

    /// Keep nodes apart only from the boundary after the fence on.
    pub fn lift_fence(&mut self) {
        self.fence = self.fence.map(|fence| next_boundary(fence + 1));
        for (_, node) in std::mem::take(&mut self.nodes) {
            self.join_in(node);
        }
    }

    /// Take a block in. On an error nothing has changed.
    pub fn insert(&mut self, node: Node) -> Result<(), MergeError> {
        self.insert_shared(Arc::new(node))
    }

    /// The same with a block that another sum may hold.
    pub fn insert_shared(&mut self, node: Arc<Node>) -> Result<(), MergeError> {
        node.check(self.width, self.height, self.layers)?;
        if let Some(pass_index) = self.first_overlap(node.block) {
            return Err(MergeError::Overlap {
                block: node.block,
                pass_index,
            });
        }
        self.join_in(node);
        Ok(())
    }

    /// The node overlaps no other one and was checked.
    fn join_in(&mut self, mut node: Arc<Node>) {
        while !self.is_kept_apart(node.block)
            && let Some(sibling) = self.take(node.block.sibling())
        {
            let (left, right) = match sibling.block < node.block {
                true => (sibling, node),
                false => (node, sibling),
            };
            node = Arc::new(Node::joined(Arc::unwrap_or_clone(left), &right));
        }
        self.nodes.insert(node.block.start(), node);
    }

    /// Take out every node that holds passes of the block, and say which blocks these were. What was added up cannot be
    /// taken apart, so passes around the block go as well. The fence falls back to before them, and nodes across it go
    /// too.
    pub fn remove(&mut self, block: Block) -> Vec<Block> {
        let mut removed = Vec::new();
        while let Some(pass_index) = self.first_overlap(block) {
            let before = self.nodes.range(..=pass_index).next_back();
            let Some(start) = before.map(|(start, _)| *start) else {
                break;
            };
            removed.extend(self.nodes.remove(&start).map(|node| node.block));
        }
        if let (Some(fence), Some(first)) = (self.fence, removed.first()) {
            let fence = fence.min(next_boundary(first.start() + 1));
            self.fence = Some(fence);
            let nodes = self.nodes.values().map(|node| node.block);
            let across: Vec<Block> = nodes.filter(|block| Self::is_across_from(*block, fence)).collect();
            for block in &across {
                self.nodes.remove(&block.start());
            }
            removed.extend(across);
        }
        removed
    }

    /// Whether the fence forbids to join the block and its sibling.
    fn is_kept_apart(&self, block: Block) -> bool {
        let fenced = |fence| Self::is_across_from(block.parent(), fence);
        self.fence.is_some_and(fenced)
    }

    fn take(&mut self, block: Block) -> Option<Arc<Node>> {
        let found = self.nodes.get(&block.start())?;
        if found.block == block {
            self.nodes.remove(&block.start())
        } else {
            None
        }
    }

    /// First pass of the block that is part of the sum already.
    pub fn first_overlap(&self, block: Block) -> Option<u64> {
        let passes = block.passes();
        let before = self.nodes.range(..passes.start).next_back();
        if before.is_some_and(|(_, node)| node.block.passes().end > passes.start) {
            return Some(passes.start);
        }
        self.nodes.range(passes).next().map(|(start, _)| *start)
    }

    /// Whether the pass is part of the sum.
    pub fn contains(&self, pass_index: u64) -> bool {
        let before = self.nodes.range(..=pass_index).next_back();
        before.is_some_and(|(_, node)| node.block.passes().contains(&pass_index))
    }

    /// The first pass: 0, but for sums of [`Self::with_first_pass`].
    pub fn first_pass(&self) -> u64 {
        self.first_pass
    }

    /// All passes from the first one to this one, excluded, are there.
    pub fn prefix(&self) -> u64 {
        let mut end = self.first_pass;
        for node in self.nodes.values() {
            if node.block.start() != end {
                break;
            }
            end = node.block.passes().end;
        }
        end
    }

    /// Number of passes that are there, with those beyond a gap.
    pub fn passes(&self) -> u64 {
        self.nodes.values().map(|node| node.block.len()).sum()
    }

    /// The nodes held, in the order of their passes. Inserting them into an empty sum gives this one.
    pub fn nodes(&self) -> impl Iterator<Item = &Arc<Node>> {
        self.nodes.values()
    }

    /// The average of the complete prefix; nothing before the first pass is there.
    pub fn average(&self) -> Option<Average> {
        self.average_of(self.prefix())
    }

    /// The average of the first `passes` passes, if the nodes of that many are held apart from later ones.
    ///
    /// Its sum is the tree over `passes` leaves: the nodes of the binary decomposition, added from the right (the
    /// smallest) to the left, as in n(0..4) + (n(4..6) + n(6..7)).
    pub fn average_of(&self, passes: u64) -> Option<Average> {
        if passes > MAX_PASSES {
            return None;
        }
        let mut total: Option<Node> = None;
        let mut rest = passes;
        while rest > 0 {
            let level = rest.trailing_zeros();
            rest &= rest - 1;
            let mut node = self.node(Block {
                level,
                index: rest >> level,
            })?;
            if let Some(right) = &total {
                add(&mut node.sum, &right.sum);
                add_saturating(&mut node.squared_difference, &right.squared_difference);
                for (layer, right) in node.layers.iter_mut().zip(&right.layers) {
                    add(layer, right);
                }
                add_mattes(&mut node.mattes, &right.mattes);
                node.radius_sums = join_radius_sums(node.radius_sums, right.radius_sums.as_ref(), false);
            }
            total = Some(node);
        }
        total.map(|total| Average::new(passes, total))
    }

    /// The node of this block, if it or all of its parts are held.
    fn node(&self, block: Block) -> Option<Node> {
        if let Some(node) = self.nodes.get(&block.start())
            && node.block.level >= block.level
        {
            return (node.block == block).then(|| Node::clone(node));
        }
        let level = block.level.checked_sub(1)?;
        let child = |side| Block {
            level,
            index: 2 * block.index + side,
        };
        let left = self.node(child(0))?;
        Some(Node::joined(left, &self.node(child(1))?))
    }
}
