//! beamfarm's library: everything about images and passes that does not need a network.
//!
//! Data goes one way: scene, plan, pass, film, sum, image.

pub mod atomic;
pub mod bundle;
pub mod error;
pub mod exr;
pub mod film;
pub mod job;
pub mod merge;
pub mod metrics;
pub mod png;
pub mod radius;

#[cfg(feature = "render")]
pub mod beam;
#[cfg(feature = "render")]
pub mod bsdf;
#[cfg(feature = "render")]
pub mod camera;
#[cfg(feature = "render")]
pub mod footprint;
#[cfg(feature = "render")]
pub mod geometry;
#[cfg(feature = "render")]
pub mod light;
#[cfg(feature = "render")]
pub mod math;
#[cfg(feature = "render")]
pub mod medium;
#[cfg(feature = "render")]
pub mod pass;
#[cfg(feature = "render")]
pub mod phase;
#[cfg(feature = "render")]
pub mod plan;
#[cfg(feature = "render")]
pub mod sampler;
#[cfg(feature = "render")]
pub mod scene;
#[cfg(feature = "render")]
pub mod surface;
#[cfg(feature = "render")]
pub mod texture;
#[cfg(feature = "render")]
pub mod transport;
#[cfg(feature = "render")]
pub mod warp;
