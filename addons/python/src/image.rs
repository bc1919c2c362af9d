//! Images as numbers.

use crate::errors;
use crate::pixels::{layer_named, layer_names, shared};
use beamfarm_command::embedded;
use beamfarm_image::exr::{pixel_hash, write_image};
use beamfarm_image::png::{encode_png, write_png};
use beamfarm_image::view::{View, ViewTransform};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::PathBuf;

/// An image from passes or samples.
#[pyclass(frozen)]
pub struct Image(pub embedded::Image);

#[pymethods]
impl Image {
    #[getter]
    fn beauty<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        shared(&slf.get().0.average.beauty, slf.clone().into_any())
    }

    #[getter]
    fn stderr<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        shared(&slf.get().0.average.standard_error, slf.clone().into_any())
    }

    #[getter]
    fn layer_names(&self) -> Vec<String> {
        layer_names(&self.0.meta)
    }

    fn layer<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let embedded::Image { average, meta, .. } = &slf.get().0;
        layer_named(meta, &average.layers, name, slf.clone().into_any())
    }

    #[getter]
    fn passes(&self) -> u64 {
        self.0.average.passes
    }

    #[getter]
    fn seconds(&self) -> f64 {
        self.0.meta.render_seconds
    }

    #[getter]
    fn scene_hash(&self) -> String {
        self.0.meta.scene.to_string()
    }

    #[getter]
    fn pixel_hash(&self) -> String {
        pixel_hash(&self.0.average.beauty).to_string()
    }

    /// Relative standard error; infinite after one pass.
    #[getter]
    fn error(&self, py: Python<'_>) -> f64 {
        py.detach(|| self.0.average.relative_standard_error())
    }

    /// Estimated relative bias of the mean, its standard error, and both in words; nothing where it is unknown.
    #[getter]
    fn bias(&self) -> Option<(f64, f64, String)> {
        let bias = self.0.average.bias.as_ref().filter(|bias| bias.is_known())?;
        let (relative, error) = bias.image.relative();
        Some((relative, error, bias.to_string()))
    }

    #[pyo3(signature = (exposure=None, view=None))]
    fn png<'py>(&self, py: Python<'py>, exposure: Option<f32>, view: Option<&str>) -> PyResult<Bound<'py, PyBytes>> {
        let shown = self.shown(py, exposure, view)?;
        let bytes = py.detach(|| encode_png(&self.0.average.beauty, shown));
        let bytes = bytes.map_err(|error| errors::file(py, error))?;
        Ok(PyBytes::new(py, &bytes))
    }

    #[pyo3(signature = (path, exposure=None, view=None))]
    fn save(&self, py: Python<'_>, path: PathBuf, exposure: Option<f32>, view: Option<&str>) -> PyResult<()> {
        let shown = self.shown(py, exposure, view)?;
        let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
        let embedded::Image { average, meta, .. } = &self.0;
        let written = match ending.as_ref().and_then(|ending| ending.to_str()) {
            Some("exr") => py.detach(|| write_image(&path, average, meta)),
            Some("png") => py.detach(|| write_png(&path, &average.beauty, shown)),
            _ => {
                let message = format!("{}: expected a name that ends in .exr or .png", path.display());
                return Err(errors::argument(py, message));
            }
        };
        written.map_err(|error| errors::file(py, error))
    }
}

impl Image {
    fn shown(&self, py: Python<'_>, exposure: Option<f32>, view: Option<&str>) -> PyResult<View> {
        let transform = match view {
            None => self.0.view.transform,
            Some("standard") => ViewTransform::Standard,
            Some("filmic") => ViewTransform::Filmic,
            Some("agx") => ViewTransform::Agx,
            Some(other) => {
                let message = format!("view = {other:?}: expected \"standard\", \"filmic\" or \"agx\"");
                return Err(errors::argument(py, message));
            }
        };
        Ok(View {
            transform,
            exposure: exposure.unwrap_or(self.0.view.exposure),
            ..self.0.view
        })
    }
}
