//! Rendering for programs without a command line, namely the Python package. A scene comes as text with its files and
//! images are returned as arrays; nothing is printed, and no file is written.
//!
//! The caller's `tell` is asked about ten times a second, in the calling thread, whether to continue.

mod asked;
mod explained;
mod memory;
mod passes;
mod remote;
mod render;
mod samples;
mod wait;

pub use crate::failure::{Cause, Failure};
pub use asked::{Asked, Notes};
pub use beamfarm_worker::engine::HAS_GPU;
pub use beamfarm_worker::exit;
pub use explained::{Explained, explain};
pub use passes::Passes;
pub use remote::{Pem, Remote, Steer};
pub use render::{Hands, Rendered, Until, render};
pub use samples::{Sampled, Samples, sample};
pub use wait::State;

use beamfarm_image::exr::ImageMeta;
use beamfarm_image::merge::Average;
use beamfarm_image::view::View;

/// An image with its metadata.
pub struct Image {
    /// The pixels.
    pub average: Average,
    /// The metadata of its EXR.
    pub meta: ImageMeta,
    /// How its PNG displays it.
    pub view: View,
}
