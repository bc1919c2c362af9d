//! Values computed side by side, in loops that compile to vector code.

/// Beams or segments handled side by side: as many as fit the widest vectors.
pub(super) const LANES: usize = 16;

/// A value for each lane.
pub(super) type Lanes = [f32; LANES];
