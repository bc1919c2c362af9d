//! A scene as kernels see it: buffers made from the renderer's own world.

pub mod geometry;
pub mod reason;
