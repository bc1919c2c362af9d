//! Rendering for programs that have no command line: the Python package. A scene comes as text with its files, images
//! go back as numbers; nothing is printed, and no file is written.
//!
//! Whoever waits is asked about ten times a second whether to go on, in the thread that called.

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

/// An image, with all that its files would say.
pub struct Image {
    /// The numbers.
    pub average: Average,
    /// What an EXR of it says of itself.
    pub meta: ImageMeta,
    /// How a PNG shows it.
    pub view: View,
}
