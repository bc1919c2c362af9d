//! The tree sum: whoever computes a node gets the same bits.

use crate::film::Film;
use crate::job::Block;

/// A node of the summation tree over pass indices.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Which passes.
    pub block: Block,
    /// Sum of the passes' radiance.
    pub sum: Film,
    /// Sum over neighbouring leaves of the squared difference of their radiance; black for a leaf.
    pub squared_difference: Film,
}

/// The average of a prefix of passes.
#[derive(Clone, Debug, PartialEq)]
pub struct Average {
    /// Passes [0, passes).
    pub passes: u64,
    /// Mean radiance.
    pub beauty: Film,
    /// Standard error of the mean, per pixel and channel.
    pub standard_error: Film,
}
