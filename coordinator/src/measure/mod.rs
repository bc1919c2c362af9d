//! The measuring subcommands; none is needed to make an image.
//!
//! | file | |
//! | --- | --- |
//! | `bench` | error over time: runs of scenes, with tables, plots and a report page |
//! | `compare.rs` | the difference between an image and a reference |
//! | `convergence` | one pixel many times, compared with the theory of convergence |
//! | `reference.rs` | the ground truth, by the path tracer |
//! | `figure.rs` | shared by the plots of `bench` and `convergence` |

pub mod bench;
pub mod compare;
pub mod convergence;
mod figure;
pub mod reference;
