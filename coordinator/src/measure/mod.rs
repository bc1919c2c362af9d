//! The subcommands that measure: none of them is needed to make an image.
//!
//! | file | |
//! | --- | --- |
//! | `bench` | error against time: runs of scenes, their report as tables, plots and a page |
//! | `compare.rs` | how far an image is from a reference |
//! | `convergence` | one pixel over and over, beside the theory of convergence |
//! | `reference.rs` | the ground truth, by the path tracer |
//! | `figure.rs` | what the plots of `bench` and `convergence` share |

pub mod bench;
pub mod compare;
pub mod convergence;
mod figure;
pub mod reference;
