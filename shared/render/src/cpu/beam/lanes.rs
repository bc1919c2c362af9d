//! What is computed side by side, in loops that become vector code.

/// Beams, or segments, that are looked at side by side: as many as fit the widest vectors.
pub(super) const LANES: usize = 16;

/// A value for each of them.
pub(super) type Lanes = [f32; LANES];
