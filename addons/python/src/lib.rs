//! The compiled part of the Python package `beamfarm`. Users see the Python files of the package; only those use the
//! names here.
//!
//! Nothing is printed. Other Python threads run during a render; the caller is asked ten times a second whether to go
//! on, which is when Ctrl-C is noticed.

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

    /// Whether passes can be rendered on devices.
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const has_gpu: bool = beamfarm_command::embedded::HAS_GPU;
}
