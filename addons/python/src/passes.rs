//! Single passes, and their average.

use crate::errors;
use crate::image::Image;
use crate::jobs::{Options, Told, told, wait};
use crate::pixels::{layer_named, layer_names, shared};
use crate::scene::Source;
use beamfarm_command::embedded;
use beamfarm_image::exr::{ImageMeta, pixel_hash};
use beamfarm_image::merge::{Node, TreeSum};
use beamfarm_image::view::View;
use pyo3::prelude::*;

/// The passes of a scene.
#[pyclass(frozen)]
pub struct Passes(embedded::Passes);

#[pymethods]
impl Passes {
    #[new]
    fn new(py: Python<'_>, source: &Bound<'_, Source>, options: Options) -> PyResult<Self> {
        let asked = options.asked(source);
        let (made, _) = wait(py, None, |tell| embedded::Passes::new(&asked, tell))?;
        Ok(Self(made))
    }

    #[getter]
    fn notes(&self) -> Told {
        told(self.0.notes().clone())
    }

    fn radius_scale(&self, index: u64) -> f64 {
        self.0.radius_scale(index)
    }

    fn render(&self, py: Python<'_>, index: u64) -> PyResult<Pass> {
        let ((node, seconds), _) = wait(py, None, |tell| self.0.pass(index, tell))?;
        Ok(Pass {
            radius_scale: self.0.radius_scale(index),
            node,
            seconds,
            meta: self.0.meta().clone(),
            view: self.0.view(),
        })
    }
}

/// One pass.
#[pyclass(frozen)]
pub struct Pass {
    node: Node,
    seconds: f64,
    radius_scale: f64,
    meta: ImageMeta,
    view: View,
}

#[pymethods]
impl Pass {
    #[getter]
    fn index(&self) -> u64 {
        self.node.block.start()
    }

    #[getter]
    fn seconds(&self) -> f64 {
        self.seconds
    }

    #[getter]
    fn radius_scale(&self) -> f64 {
        self.radius_scale
    }

    #[getter]
    fn pixel_hash(&self) -> String {
        pixel_hash(&self.node.sum).to_string()
    }

    #[getter]
    fn beauty<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        shared(&slf.get().node.sum, slf.clone().into_any())
    }

    #[getter]
    fn layer_names(&self) -> Vec<String> {
        layer_names(&self.meta)
    }

    fn layer<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let pass = slf.get();
        layer_named(&pass.meta, &pass.node.layers, name, slf.clone().into_any())
    }
}

/// The average of passes 0 to N - 1, given in any order: it has the bits of a render.
#[pyfunction]
pub fn average(py: Python<'_>, passes: Vec<Bound<'_, Pass>>) -> PyResult<Image> {
    let Some(first) = passes.first().map(Bound::get) else {
        return Err(errors::argument(py, "passes: expected at least one"));
    };
    let film = &first.node.sum;
    let mut sum = TreeSum::new(film.width, film.height).with_layers(first.node.layer_counts());
    let mut seconds = 0.0;
    for pass in passes.iter().map(Bound::get) {
        if (pass.meta.scene, pass.meta.maker) != (first.meta.scene, first.meta.maker) {
            return Err(errors::argument(
                py,
                "passes: expected all of one scene with the same settings",
            ));
        }
        seconds += pass.seconds;
        sum.insert(pass.node.clone())
            .map_err(|error| errors::argument(py, error))?;
    }
    let all = passes.len() as u64;
    match py.detach(|| sum.average()).filter(|average| average.passes == all) {
        Some(average) => Ok(Image(embedded::Image {
            average,
            meta: ImageMeta {
                render_seconds: seconds,
                ..first.meta.clone()
            },
            view: first.view,
        })),
        None => Err(errors::argument(
            py,
            format!(
                "passes: expected 0 to {}, each once; pass {} is missing",
                all - 1,
                sum.prefix()
            ),
        )),
    }
}
