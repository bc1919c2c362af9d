//! Failures as the package's exceptions, which are Python classes in `beamfarm/errors.py`.

use beamfarm_command::embedded::{Cause, Failure, exit};
use beamfarm_scene::SceneError;
use pyo3::prelude::*;
use std::fmt::Display;

/// The exception of this name.
fn raised(py: Python<'_>, name: &str, args: impl for<'py> pyo3::call::PyCallArgs<'py>) -> PyErr {
    let made = || py.import("beamfarm.errors")?.getattr(name)?.call1(args);
    made().map_or_else(|error| error, PyErr::from_value)
}

/// The path of fields that a message begins with, for example `lights["sun"].power`.
fn field_of(message: &str) -> Option<&str> {
    let (field, _) = message.split_once(": ")?;
    // Names may contain any text.
    let mut outside = field.split('"').step_by(2);
    let is_path = outside.all(|part| part.chars().all(|c| c.is_alphanumeric() || "._-[]".contains(c)));
    is_path.then_some(field)
}

/// What is wrong with a scene: each file, line, field and message.
pub fn scene(py: Python<'_>, errors: &[SceneError]) -> PyErr {
    let faults: Vec<_> = errors
        .iter()
        .map(|error| {
            let file = error.file.to_string_lossy().into_owned();
            let field = field_of(&error.message).map(str::to_owned);
            (file, error.line, field, error.message.clone())
        })
        .collect();
    raised(py, "scene_error", (faults,))
}

/// A failure as an exception.
pub fn failed(py: Python<'_>, failure: &Failure) -> PyErr {
    let text = failure.to_string();
    let text = text.strip_prefix("error: ").unwrap_or(&text).to_owned();
    match (failure.cause(), failure.code()) {
        (Cause::Scene(errors), _) => scene(py, errors),
        (Cause::Device, _) => raised(py, "DeviceError", (text,)),
        (Cause::Memory, _) => raised(py, "OutOfMemoryError", (text,)),
        (Cause::Other, exit::UNREACHABLE | exit::REFUSED) => raised(py, "FarmError", (text,)),
        (Cause::Other, exit::USAGE) => raised(py, "ArgumentError", (text,)),
        (Cause::Other, _) => raised(py, "RenderError", (text,)),
    }
}

/// Something is wrong with an argument.
pub fn argument(py: Python<'_>, message: impl Display) -> PyErr {
    raised(py, "ArgumentError", (message.to_string(),))
}

/// A file cannot be read or written.
pub fn file(py: Python<'_>, message: impl Display) -> PyErr {
    raised(py, "ImageError", (message.to_string(),))
}
