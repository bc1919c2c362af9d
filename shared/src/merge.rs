//! The tree sum: whoever computes a node gets the same bits.
//!
//! Passes are the leaves of a binary tree, in order; a node is the sum of its two children, rounded once per channel.
//! Neither the order of arrival nor the way passes were grouped into blocks can therefore change a bit of the image, and
//! rounding error grows with the logarithm of the number of passes.

use crate::bias::{Bias, RadiusSums};
use crate::film::Film;
use crate::job::{Block, MAX_PASSES};
use std::collections::BTreeMap;

/// Largest magnitude of one pass's radiance that is accepted, per channel. Sums of [`MAX_PASSES`] such values stay finite.
pub const MAX_RADIANCE: f32 = 1e22;

/// Pixels along the side of the blocks whose radiance errors are compared with.
const BLOCK: usize = 8;

/// A block that cannot become part of the sum.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MergeError {
    /// A pass would be counted twice.
    #[error("{block}: pass {pass_index} is already part of the sum")]
    Overlap {
        /// The block that was refused.
        block: Block,
        /// First pass of it that is there already.
        pass_index: u64,
    },
    /// The image has another size than the job's.
    #[error(
        "{block}: expected {} x {} pixels, found {} x {}",
        expected[0], expected[1], found[0], found[1]
    )]
    Size {
        /// The block that was refused.
        block: Block,
        /// Width and height of the job's images.
        expected: [u32; 2],
        /// Width and height of the block's images.
        found: [u32; 2],
    },
    /// The image has another number of layers than the job's.
    #[error("{block}: expected {expected} layers, found {found}")]
    Layers {
        /// The block that was refused.
        block: Block,
        /// Layers of the job.
        expected: usize,
        /// Layers of the block.
        found: usize,
    },
    /// The image holds values that no average may see.
    #[error(
        "{block}: {count} values are NaN, infinite or out of range, first at x = {}, y = {}",
        first[0], first[1]
    )]
    NonFinite {
        /// The block that was refused.
        block: Block,
        /// Number of such channel values, in the sum, the squared differences and the layers.
        count: u64,
        /// Column and row of the first such pixel.
        first: [u32; 2],
    },
    /// Two nodes that are not the left and the right child of one node.
    #[error("cannot join {left} and {right}: not the left and the right half of one block")]
    NotSiblings {
        /// The node given as left child.
        left: Block,
        /// The node given as right child.
        right: Block,
    },
    /// Passes beyond [`MAX_PASSES`].
    #[error("{block} reaches beyond {MAX_PASSES} passes")]
    OutOfRange {
        /// The block that was refused.
        block: Block,
    },
}

/// A node of the summation tree over pass indices.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Which passes.
    pub block: Block,
    /// Sum of the passes' radiance.
    pub sum: Film,
    /// Sum over neighbouring leaves of the squared difference of their radiance; black for a leaf.
    pub squared_difference: Film,
    /// Sums of the layers that the job has beside radiance, in the job's order.
    pub layers: Vec<Film>,
    /// What an estimate of the bias is made of, when the passes' radius scales are known.
    pub radius_sums: Option<RadiusSums>,
}

impl Node {
    /// The image of one pass.
    pub fn leaf(pass_index: u64, film: Film) -> Self {
        Self {
            block: Block::leaf(pass_index),
            squared_difference: Film::new(film.width, film.height),
            sum: film,
            layers: Vec::new(),
            radius_sums: None,
        }
    }

    /// The same image of one pass, whose kernel radii were scaled by this: with it, the bias of an average can be estimated.
    pub fn with_radius_scale(self, radius_scale: f64) -> Self {
        Self {
            radius_sums: Some(RadiusSums::leaf(&self.sum, radius_scale)),
            ..self
        }
    }

    /// The same node with these layers.
    pub fn with_layers(self, layers: Vec<Film>) -> Self {
        Self { layers, ..self }
    }

    /// The parent of two siblings, given in the order of their passes.
    ///
    /// Squared differences saturate at the largest finite f32: a firefly may make an error estimate useless, but not
    /// the sum.
    pub fn join(left: Self, right: Self) -> Result<Self, MergeError> {
        for node in [&left, &right] {
            if !node.block.is_valid() {
                return Err(MergeError::OutOfRange { block: node.block });
            }
        }
        let block = left.block.parent();
        if !left.block.index.is_multiple_of(2)
            || left.block.sibling() != right.block
            || !block.is_valid()
        {
            return Err(MergeError::NotSiblings {
                left: left.block,
                right: right.block,
            });
        }
        let count = left.layers.len();
        left.check_shape(left.sum.width, left.sum.height, count)?;
        right.check_shape(left.sum.width, left.sum.height, count)?;

        let Self {
            mut sum,
            mut squared_difference,
            mut layers,
            radius_sums,
            ..
        } = left;
        if block.level == 1 {
            for ((d, l), r) in squared_difference
                .pixels
                .iter_mut()
                .zip(&sum.pixels)
                .zip(&right.sum.pixels)
            {
                *d = std::array::from_fn(|c| ((l[c] - r[c]) * (l[c] - r[c])).min(f32::MAX));
            }
        } else {
            add_saturating(&mut squared_difference, &right.squared_difference);
        }
        add(&mut sum, &right.sum);
        for (layer, right) in layers.iter_mut().zip(&right.layers) {
            add(layer, right);
        }
        Ok(Self {
            block,
            sum,
            squared_difference,
            layers,
            radius_sums: join_radius_sums(
                radius_sums,
                right.radius_sums.as_ref(),
                block.level == 1,
            ),
        })
    }

    /// Refuse another size or number of layers, NaN, infinities and magnitudes beyond [`MAX_RADIANCE`] a pass.
    pub fn check(&self, width: u32, height: u32, layers: usize) -> Result<(), MergeError> {
        if !self.block.is_valid() {
            return Err(MergeError::OutOfRange { block: self.block });
        }
        self.check_shape(width, height, layers)?;
        // Exact: a power of two times an f32. Rounding is monotonic, so sums of values in range stay within it.
        let limit = MAX_RADIANCE * self.block.len() as f32;
        let mut count = 0;
        let mut first = None;
        for (i, (sum, difference)) in self
            .sum
            .pixels
            .iter()
            .zip(&self.squared_difference.pixels)
            .enumerate()
        {
            let good_sums = sum.iter().filter(|v| v.abs() <= limit).count();
            let good_differences = difference
                .iter()
                .filter(|v| v.is_finite() && **v >= 0.0)
                .count();
            let layers = self.layers.iter().map(|layer| &layer.pixels[i]);
            let good_layers = layers.flatten().filter(|v| v.abs() <= limit).count();
            let bad = (sum.len() - good_sums)
                + (difference.len() - good_differences)
                + (sum.len() * self.layers.len() - good_layers);
            if bad > 0 {
                count += bad as u64;
                first.get_or_insert([i as u32 % width, i as u32 / width]);
            }
        }
        let sums = self.radius_sums.as_ref();
        if count == 0 && sums.is_some_and(|sums| !sums.is_sound(width, height)) {
            (count, first) = (1, Some([0, 0]));
        }
        match first {
            None => Ok(()),
            Some(first) => Err(MergeError::NonFinite {
                block: self.block,
                count,
                first,
            }),
        }
    }

    fn check_shape(&self, width: u32, height: u32, layers: usize) -> Result<(), MergeError> {
        if self.layers.len() != layers {
            return Err(MergeError::Layers {
                block: self.block,
                expected: layers,
                found: self.layers.len(),
            });
        }
        for film in [&self.sum, &self.squared_difference]
            .into_iter()
            .chain(&self.layers)
        {
            let pixels = u64::from(film.width) * u64::from(film.height);
            if [film.width, film.height] != [width, height] || film.pixels.len() as u64 != pixels {
                return Err(MergeError::Size {
                    block: self.block,
                    expected: [width, height],
                    found: [film.width, film.height],
                });
            }
        }
        Ok(())
    }
}

fn join_radius_sums(
    left: Option<RadiusSums>,
    right: Option<&RadiusSums>,
    are_leaves: bool,
) -> Option<RadiusSums> {
    let (mut sums, right) = (left?, right?);
    sums.join(right, are_leaves);
    Some(sums)
}

fn add(into: &mut Film, other: &Film) {
    for (a, b) in into.pixels.iter_mut().zip(&other.pixels) {
        *a = std::array::from_fn(|c| a[c] + b[c]);
    }
}

fn add_saturating(into: &mut Film, other: &Film) {
    for (a, b) in into.pixels.iter_mut().zip(&other.pixels) {
        *a = std::array::from_fn(|c| (a[c] + b[c]).min(f32::MAX));
    }
}

/// The sum of all passes that have arrived, as the fewest nodes: siblings are joined as soon as both are there.
///
/// The complete prefix is held as the binary decomposition of its length, so at most one node a level; passes that
/// arrived ahead of it take what their gaps force them to.
#[derive(Clone, Debug)]
pub struct TreeSum {
    width: u32,
    height: u32,
    layers: usize,
    /// By first pass. Disjoint; no two are siblings.
    nodes: BTreeMap<u64, Node>,
}

impl TreeSum {
    /// No passes yet, of images of this size.
    pub fn new(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            layers: 0,
            nodes: BTreeMap::new(),
        }
    }

    /// The same, of passes that have so many layers beside their radiance.
    pub fn with_layers(self, layers: usize) -> Self {
        Self { layers, ..self }
    }

    /// Take a block in. On an error nothing has changed.
    pub fn insert(&mut self, node: Node) -> Result<(), MergeError> {
        node.check(self.width, self.height, self.layers)?;
        if let Some(pass_index) = self.first_overlap(node.block) {
            return Err(MergeError::Overlap {
                block: node.block,
                pass_index,
            });
        }
        let mut node = node;
        while let Some(sibling) = self.take(node.block.sibling()) {
            let (left, right) = if sibling.block < node.block {
                (sibling, node)
            } else {
                (node, sibling)
            };
            // Cannot fail: both were checked when they came in, and they are siblings.
            node = Node::join(left, right)?;
        }
        self.nodes.insert(node.block.start(), node);
        Ok(())
    }

    fn take(&mut self, block: Block) -> Option<Node> {
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

    /// Number of passes that are complete from zero on.
    pub fn prefix(&self) -> u64 {
        let mut end = 0;
        for node in self.nodes.values() {
            if node.block.start() != end {
                break;
            }
            end = node.block.passes().end;
        }
        end
    }

    /// The nodes held, in the order of their passes. Inserting them into an empty sum gives this one.
    pub fn nodes(&self) -> impl Iterator<Item = &Node> {
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
            let node = self
                .nodes
                .get(&rest)
                .filter(|node| node.block.level == level)?;
            let mut node = node.clone();
            if let Some(right) = &total {
                add(&mut node.sum, &right.sum);
                add_saturating(&mut node.squared_difference, &right.squared_difference);
                for (layer, right) in node.layers.iter_mut().zip(&right.layers) {
                    add(layer, right);
                }
                node.radius_sums =
                    join_radius_sums(node.radius_sums, right.radius_sums.as_ref(), false);
            }
            total = Some(node);
        }
        total.map(|total| Average::new(passes, total))
    }
}

/// The average of a prefix of passes.
#[derive(Clone, Debug, PartialEq)]
pub struct Average {
    /// Passes [0, passes).
    pub passes: u64,
    /// Mean radiance.
    pub beauty: Film,
    /// Standard error of the mean, per pixel and channel. Infinite for one pass, of which nothing can be said.
    pub standard_error: Film,
    /// Means of the layers, in the job's order.
    pub layers: Vec<Film>,
    /// Estimated bias, when the passes' radius scales are known.
    pub bias: Option<Bias>,
}

impl Average {
    /// From the sums over `passes` passes, whose blocks do not matter any more.
    ///
    /// Passes are not identically distributed (their variance grows with the index), but neighbours nearly are: the
    /// squared difference of passes 2k and 2k + 1 has the mean Var[2k] + Var[2k + 1]. Their sum D over an even number N of
    /// passes estimates the variance of the sum, and the standard error of the mean is sqrt(D) / N. An odd last pass has
    /// no neighbour; it is taken to vary as the others do on average, D * N / (N - 1). Its variance is at most 2 - alpha
    /// times theirs, so the variance of the mean comes out too small by a fraction of (1 - alpha) / N at most.
    fn new(passes: u64, total: Node) -> Self {
        let Node {
            mut sum,
            squared_difference: mut difference,
            mut layers,
            radius_sums,
            ..
        } = total;
        let n = passes as f64;
        let pairs = passes - passes % 2;
        for film in layers.iter_mut().chain([&mut sum]) {
            for pixel in &mut film.pixels {
                *pixel = pixel.map(|v| (f64::from(v) / n) as f32);
            }
        }
        for pixel in &mut difference.pixels {
            *pixel = pixel.map(|d| match pairs {
                0 => f32::INFINITY,
                _ => (f64::from(d) / (n * pairs as f64)).sqrt() as f32,
            });
        }
        Self {
            passes,
            beauty: sum,
            standard_error: difference,
            layers,
            bias: radius_sums.map(|sums| sums.estimate(passes)),
        }
    }

    /// One number for the noise of the picture: the root mean square, over all pixels and channels, of the standard error
    /// relative to the radiance around the pixel. That is the channel's mean over a block of 8 x 8 pixels, or a tenth of the
    /// picture's mean magnitude if that is more: a few pixels that look into a lamp do not outweigh the rest, nor do black
    /// ones. (Relative to the pixel's own radiance it would be too small as long as there is much noise: where there is a
    /// large error, there is a large value.)
    ///
    /// Infinite for one pass and for a black picture. Depends on nothing but the bits of the average.
    pub fn relative_standard_error(&self) -> f64 {
        let values = || self.beauty.pixels.iter().flatten().map(|v| f64::from(*v));
        let count = (3 * self.beauty.pixels.len()) as f64;
        let mean = values().map(f64::abs).sum::<f64>() / count;
        if mean == 0.0 {
            return f64::INFINITY;
        }
        let (width, height) = (self.beauty.width as usize, self.beauty.height as usize);
        let mut squares = 0.0;
        for y0 in (0..height).step_by(BLOCK) {
            for x0 in (0..width).step_by(BLOCK) {
                let columns = x0..width.min(x0 + BLOCK);
                let mut block = [0.0; 3];
                let mut errors = [0.0; 3];
                let mut pixels = 0.0;
                for y in y0..height.min(y0 + BLOCK) {
                    for x in columns.clone() {
                        pixels += 1.0;
                        for c in 0..3 {
                            let error = f64::from(self.standard_error.pixels[y * width + x][c]);
                            block[c] += f64::from(self.beauty.pixels[y * width + x][c]);
                            errors[c] += error * error;
                        }
                    }
                }
                for c in 0..3 {
                    let radiance = (block[c] / pixels).abs().max(0.1 * mean);
                    squares += errors[c] / (radiance * radiance);
                }
            }
        }
        (squares / count).sqrt()
    }
}
