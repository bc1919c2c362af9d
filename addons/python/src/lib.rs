//! What does Python get of the renderer? This is the compiled part of the package `beamfarm`. Users see the package's
//! Python files; this module is private to them.
//!
//! ```text
//!                       ┌─ scene            dicts <-> TOML text, extents
//! beamfarm/*.py ─ _native ─ jobs, passes    explain, render, sample, pass by pass ── beamfarm_command::embedded
//!                       ├─ image, pixels    arrays of an image, EXR files, differences
//!                       └─ remote           a job that runs elsewhere
//! ```
//!
//! The module `_native` is the entrance. Data that cross it are text, bytes and numpy arrays. `docs/python.md` has the
//! examples, which are tested.
//!
//! Nothing is printed. Other Python threads continue during a render. Ten times a second the waiting thread is asked
//! whether to continue, which is when Ctrl-C takes effect.

mod errors;
mod image;
mod jobs;
mod passes;
mod pixels;
mod remote;
mod scene;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::image::Image;
    #[pymodule_export]
    use crate::jobs::{explain, render, sample};
    #[pymodule_export]
    use crate::passes::{Pass, Passes, average};
    #[pymodule_export]
    use crate::pixels::{compare, encode_exr, read_image};
    #[pymodule_export]
    use crate::remote::Remote;
    #[pymodule_export]
    use crate::scene::{Reach, Source, dumps, loads, radius_scale, read_scene};

    /// Version of the package and of the command.
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const version: &str = env!("CARGO_PKG_VERSION");

    /// Whether passes can be rendered on GPU devices.
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const has_gpu: bool = beamfarm_command::embedded::HAS_GPU;
}
