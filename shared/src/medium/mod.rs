//! Participating media. One file a kind; heterogeneous kinds have their place beside `homogeneous`.

pub mod bricks;
mod homogeneous;

pub use homogeneous::{Flight, Homogeneous};

/// Index into the scene's media. `None` stands for vacuum.
pub type MediumId = Option<u16>;
