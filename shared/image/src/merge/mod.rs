//! The tree sum: whoever computes a node gets the same bits.
//!
//! Passes are the leaves of a binary tree, in order. A node is the sum of its two children, rounded once per channel.
//! So neither the order of arrival nor the grouping of passes into blocks can change a bit of the image, and rounding
//! error grows only with the logarithm of the number of passes.

mod average;
mod noise;
mod sum;

pub use average::{Average, Errors, PERCENTILES};
pub use noise::{Fireflies, Noise};
pub use sum::{TreeSum, next_boundary};

use crate::bias::RadiusSums;
use crate::film::Film;
use crate::job::{Block, MAX_PASSES};
use crate::layer::LayerCounts;
use crate::matte::Matte;

/// Largest accepted magnitude of one pass's radiance, per channel. Sums of [`MAX_PASSES`] such values stay finite.
pub const MAX_RADIANCE: f32 = 1e22;

/// Passes in each of the first replications; see [`replication`].
pub const REPLICATION: u64 = 1 << REPLICATION_LEVEL;
const REPLICATION_LEVEL: u32 = 4;
/// Log2 of the replications between two powers of two, once there are that many with [`REPLICATION`] passes or more.
/// The more passes samples are even over, the less noise they have.
const REPLICATIONS_LEVEL: u32 = 3;

/// The passes whose samples are drawn together with those of a pass, to be more even than chance would make them: a
/// block of the tree, an eighth to a sixteenth of the passes up to it. Replications are independent of each other,
/// unlike the passes within one; the differences between them tell the error of their average.
pub fn replication(pass_index: u64) -> Block {
    let octave = pass_index.checked_ilog2().unwrap_or(0);
    let level = octave.saturating_sub(REPLICATIONS_LEVEL).max(REPLICATION_LEVEL);
    Block {
        level,
        index: pass_index >> level,
    }
}

/// Whether the halves of a block tell how much the sum of their passes varies. They do if they are neighbouring passes,
/// or neighbouring replications or parts of one, which are more even together than each pass is alone.
fn halves_tell(block: Block) -> bool {
    let most = replication(block.start()).level + 1;
    block.level == 1 || block.level > REPLICATION_LEVEL && block.level <= most
}

/// Why a block cannot become part of the sum.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MergeError {
    /// A pass would be counted twice.
    #[error("{block}: pass {pass_index} is already part of the sum")]
    Overlap {
        /// The block that was refused.
        block: Block,
        /// The first of its passes that is already there.
        pass_index: u64,
    },
    /// The image does not have the job's size.
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
    /// The image does not have the job's number of layers.
    #[error("{block}: expected {expected}, found {found}")]
    Layers {
        /// The block that was refused.
        block: Block,
        /// Layers of the job.
        expected: LayerCounts,
        /// Layers of the block.
        found: LayerCounts,
    },
    /// The image holds values that no average may include.
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
    /// Two nodes are not the left and the right child of one node.
    #[error("cannot join {left} and {right}: not the left and the right half of one block")]
    NotSiblings {
        /// The node given as left child.
        left: Block,
        /// The node given as right child.
        right: Block,
    },
    /// The block has passes beyond [`MAX_PASSES`].
    #[error("{block} reaches beyond {MAX_PASSES} passes")]
    OutOfRange {
        /// The block that was refused.
        block: Block,
    },
}

/// A node of the summation tree over pass indices.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// The block of passes.
    pub block: Block,
    /// Sum of the passes' radiance.
    pub sum: Film,
    /// Sum over neighbouring replications of the squared difference of their sums. For less than two replications: over
    /// neighbouring halves of one, or neighbouring leaves, which is more on average. Black for a leaf.
    pub squared_difference: Film,
    /// Sums of the job's layers, in the job's order.
    pub layers: Vec<Film>,
    /// What covers each pixel, for the job's mattes in their order.
    pub mattes: Vec<Matte>,
    /// The sums for an estimate of the bias, if the passes' radius scales are known.
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
            mattes: Vec::new(),
            radius_sums: None,
        }
    }

    /// The same image of one pass, with the scale of its kernel radii: this allows an estimate of the average's bias.
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

    /// The same node with these mattes.
    pub fn with_mattes(self, mattes: Vec<Matte>) -> Self {
        Self { mattes, ..self }
    }

    /// The number of its layers.
    pub fn layer_counts(&self) -> LayerCounts {
        LayerCounts {
            films: self.layers.len(),
            mattes: self.mattes.len(),
        }
    }

    /// The parent of two siblings, given in the order of their passes.
    ///
    /// Squared differences saturate at the largest finite f32: a firefly may spoil an error estimate, but not the sum.
    pub fn join(left: Self, right: Self) -> Result<Self, MergeError> {
        for node in [&left, &right] {
            if !node.block.is_valid() {
                return Err(MergeError::OutOfRange { block: node.block });
            }
        }
        let block = left.block.parent();
        if !left.block.index.is_multiple_of(2) || left.block.sibling() != right.block || !block.is_valid() {
            return Err(MergeError::NotSiblings {
                left: left.block,
                right: right.block,
            });
        }
        let counts = left.layer_counts();
        left.check_shape(left.sum.width, left.sum.height, counts)?;
        right.check_shape(left.sum.width, left.sum.height, counts)?;
        Ok(Self::joined(left, &right))
    }

    /// [`Self::join`] of two siblings of the same shape.
    fn joined(left: Self, right: &Self) -> Self {
        let block = left.block.parent();
        let Self {
            mut sum,
            mut squared_difference,
            mut layers,
            mut mattes,
            radius_sums,
            ..
        } = left;
        if halves_tell(block) {
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
        add_mattes(&mut mattes, &right.mattes);
        Self {
            block,
            sum,
            squared_difference,
            layers,
            mattes,
            radius_sums: join_radius_sums(radius_sums, right.radius_sums.as_ref(), block.level == 1),
        }
    }

    /// Refuse another size or number of layers, NaN, infinities, and magnitudes beyond [`MAX_RADIANCE`] per pass.
    pub fn check(&self, width: u32, height: u32, layers: LayerCounts) -> Result<(), MergeError> {
        if !self.block.is_valid() {
            return Err(MergeError::OutOfRange { block: self.block });
        }
        self.check_shape(width, height, layers)?;
        // Exact: a power of two times an f32. Rounding is monotonic, so sums of values in range stay in range.
        let limit = MAX_RADIANCE * self.block.len() as f32;
        let sound = |film: &Film, least: f32, most: f32| {
            let values = film.pixels.as_flattened().iter();
            // No early exit, so that many values are compared at a time.
            values.fold(true, |sound, v| sound & (least <= *v) & (*v <= most))
        };
        let mut films = self.layers.iter().chain([&self.sum]);
        let mut count = 0;
        let mut first = None;
        if !films.all(|film| sound(film, -limit, limit)) || !sound(&self.squared_difference, 0.0, f32::MAX) {
            (count, first) = self.count_bad(limit);
        }
        let sums = self.radius_sums.as_ref();
        if count == 0 && sums.is_some_and(|sums| !sums.is_sound(width, height)) {
            (count, first) = (1, Some([0, 0]));
        }
        let passes = self.block.len();
        if count == 0
            && !self
                .mattes
                .iter()
                .all(|matte| matte.is_sound(self.sum.pixels.len(), passes))
        {
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

    /// Number of values out of range, and the column and row of the first.
    fn count_bad(&self, limit: f32) -> (u64, Option<[u32; 2]>) {
        let width = self.sum.width;
        let mut count = 0;
        let mut first = None;
        for (i, (sum, difference)) in self.sum.pixels.iter().zip(&self.squared_difference.pixels).enumerate() {
            let good_sums = sum.iter().filter(|v| v.abs() <= limit).count();
            let good_differences = difference.iter().filter(|v| v.is_finite() && **v >= 0.0).count();
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
        (count, first)
    }

    fn check_shape(&self, width: u32, height: u32, layers: LayerCounts) -> Result<(), MergeError> {
        let found = self.layer_counts();
        if found != layers {
            return Err(MergeError::Layers {
                block: self.block,
                expected: layers,
                found,
            });
        }
        for film in [&self.sum, &self.squared_difference].into_iter().chain(&self.layers) {
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

fn join_radius_sums(left: Option<RadiusSums>, right: Option<&RadiusSums>, are_leaves: bool) -> Option<RadiusSums> {
    let (mut sums, right) = (left?, right?);
    sums.join(right, are_leaves);
    Some(sums)
}

fn add_mattes(into: &mut [Matte], other: &[Matte]) {
    for (matte, other) in into.iter_mut().zip(other) {
        *matte = matte.joined(other);
    }
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
