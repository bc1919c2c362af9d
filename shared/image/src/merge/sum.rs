//! Joins arrived nodes as far as allowed.

use super::{Average, MergeError, Node, add, add_mattes, add_saturating, join_radius_sums};
use crate::job::{Block, MAX_PASSES};
use crate::layer::LayerCounts;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The first boundary at or after this many passes: 2, 3, 4, 6, 8, 12, ... (2^k and 3 2^k). At boundaries a job checks
/// whether its error is small enough.
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
/// The complete prefix is held as the binary decomposition of its length, so as at most one node per level. Passes
/// beyond it take as many nodes as their gaps require. A fence keeps some more nodes apart: see [`Self::with_fence`].
///
/// A clone shares the images.
#[derive(Clone, Debug)]
pub struct TreeSum {
    width: u32,
    height: u32,
    layers: LayerCounts,
    first_pass: u64,
    fence: Option<u64>,
    /// By first pass. Disjoint; no two are siblings, except across a boundary that the fence keeps.
    nodes: BTreeMap<u64, Arc<Node>>,
}

impl TreeSum {
    /// An empty sum of images of this size.
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

    /// The same for passes that have these layers besides radiance.
    pub fn with_layers(self, layers: impl Into<LayerCounts>) -> Self {
        let layers = layers.into();
        Self { layers, ..self }
    }

    /// The same for passes from this one on. They have no average, but can become part of another sum.
    pub fn with_first_pass(self, first_pass: u64) -> Self {
        Self { first_pass, ..self }
    }

    /// The same, with no node across a boundary ([`next_boundary`]) from `fence` on, in whichever order passes arrive.
    /// So the average up to a boundary is available even when more passes have arrived.
    ///
    /// A single block that reaches across a boundary cannot be cut: see [`Self::is_across`].
    pub fn with_fence(mut self, fence: u64) -> Self {
        self.fence = Some(next_boundary(fence));
        self
    }

    /// Whether the block has passes on both sides of a boundary. Aligned blocks beyond the first two of their level
    /// never do.
    pub fn is_across(block: Block) -> bool {
        Self::is_across_from(block, 0)
    }

    fn is_across_from(block: Block, fence: u64) -> bool {
        let boundary = next_boundary(fence.max(block.start() + 1));
        boundary < block.passes().end
    }

    /// The boundary from which nodes are kept apart.
    pub fn fence(&self) -> Option<u64> {
        self.fence
    }

    /// Keep nodes apart only from the next boundary on.
    pub fn lift_fence(&mut self) {
        self.fence = self.fence.map(|fence| next_boundary(fence + 1));
        for (_, node) in std::mem::take(&mut self.nodes) {
            self.join_in(node);
        }
    }

    /// Add a block. On an error, nothing changes.
    pub fn insert(&mut self, node: Node) -> Result<(), MergeError> {
        self.insert_shared(Arc::new(node))
    }

    /// The same for a block that another sum may share.
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

    /// The node must not overlap others and must have been checked.
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

    /// Remove every node that holds passes of the block, and return the removed blocks. A sum cannot be taken apart, so
    /// passes around the block go as well. The fence falls back to before them, and nodes across it go too.
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

    /// Whether the fence forbids joining the block and its sibling.
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

    /// First pass of the block that is already part of the sum.
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

    /// The first pass: 0 unless set by [`Self::with_first_pass`].
    pub fn first_pass(&self) -> u64 {
        self.first_pass
    }

    /// The end of the complete prefix: all passes from the first one up to this one, exclusive, are there.
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

    /// Number of passes that are there, including those beyond a gap.
    pub fn passes(&self) -> u64 {
        self.nodes.values().map(|node| node.block.len()).sum()
    }

    /// The nodes, in the order of their passes. Inserting them into an empty sum gives this one.
    pub fn nodes(&self) -> impl Iterator<Item = &Arc<Node>> {
        self.nodes.values()
    }

    /// The average of the complete prefix. `None` if no passes are there.
    pub fn average(&self) -> Option<Average> {
        self.average_of(self.prefix())
    }

    /// The average of the first `passes` passes, if their nodes are held apart from later ones.
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

    /// The node of this block, if the block or all of its parts are held.
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
