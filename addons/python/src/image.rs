//! Images as numbers.

use crate::errors;
use crate::jobs::Pass;
use beamfarm_command::embedded;
use beamfarm_image::exr::{encode_image, pixel_hash, read_rgb, write_image};
use beamfarm_image::film::Film;
use beamfarm_image::layer::Layer;
use beamfarm_image::merge::TreeSum;
use beamfarm_image::metrics::{self, BlockDeviation};
use beamfarm_image::png::{encode_png, write_png};
use beamfarm_image::view::{View, ViewTransform};
use numpy::ndarray::{ArrayView3, Axis};
use numpy::{PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::path::PathBuf;

/// A film as an array of (height, width, 3) numbers that shares its memory with `owner`, which holds it and never
/// changes. Nobody can write to it.
pub fn shared<'py>(film: &Film, owner: Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let shape = (film.height as usize, film.width as usize, 3);
    let view = ArrayView3::from_shape(shape, film.pixels.as_flattened());
    let view = view.map_err(|error| errors::argument(owner.py(), error))?;
    // SAFETY: `owner` is kept alive by the array, is frozen, and holds the film.
    let array = unsafe { PyArray3::borrow_from_array(&view, owner) };
    let flags = PyDict::new(array.py());
    flags.set_item("write", false)?;
    array.call_method("setflags", (), Some(&flags))?;
    Ok(array.into_any())
}

/// A layer as people see it: (height, width) of one channel, (height, width, N) of several.
pub fn layer<'py>(
    layer: &Layer,
    film: &Film,
    empty_depth: f32,
    owner: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = owner.py();
    match layer {
        Layer::Alpha | Layer::Depth => {
            let values = layer.in_image(film, empty_depth).pop().map(|(_, values)| values);
            let rows = film.width.max(1) as usize;
            let rows: Vec<Vec<f32>> = values.unwrap_or_default().chunks(rows).map(<[f32]>::to_vec).collect();
            Ok(PyArray2::from_vec2(py, &rows)?.into_any())
        }
        _ => {
            let all = shared(film, owner)?;
            let array = all.cast::<PyArray3<f32>>()?;
            match layer.channels().len() {
                3 => Ok(all),
                // Views of the first channels.
                1 => array.get_item((pyo3::types::PyEllipsis::get(py), 0)),
                count => array.get_item((
                    pyo3::types::PyEllipsis::get(py),
                    pyo3::types::PySlice::new(py, 0, count as isize, 1),
                )),
            }
        }
    }
}

/// An image of passes or samples.
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

    /// Names of layers that are arrays.
    #[getter]
    fn layer_names(&self) -> Vec<String> {
        let films = self.0.meta.layers.iter().filter(|layer| layer.matte().is_none());
        films.map(ToString::to_string).collect()
    }

    fn layer<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let embedded::Image { average, meta, .. } = &slf.get().0;
        let films = meta.layers.iter().filter(|layer| layer.matte().is_none());
        let found = films.zip(&average.layers).find(|(layer, _)| layer.to_string() == name);
        let (found, film) = found.ok_or_else(|| pyo3::exceptions::PyKeyError::new_err(name.to_owned()))?;
        let empty = meta.empty_depth.unwrap_or(f32::INFINITY);
        layer(found, film, empty, slf.clone().into_any())
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

    /// Relative standard error; infinite of one pass.
    #[getter]
    fn error(&self, py: Python<'_>) -> f64 {
        py.detach(|| self.0.average.relative_standard_error())
    }

    /// Estimated relative bias of the mean, its standard error, and the same in words; nothing where it is not known.
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

    fn exr<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| encode_image(&self.0.average, &self.0.meta));
        let bytes = bytes.map_err(|error| errors::file(py, error))?;
        Ok(PyBytes::new(py, &bytes))
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

/// The average of passes 0 to N - 1, in any order: the bits are those of a render.
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
            meta: beamfarm_image::exr::ImageMeta {
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

/// An array of (height, width, 3) as a film.
fn film_of(py: Python<'_>, name: &str, array: &PyReadonlyArray3<'_, f32>) -> PyResult<Film> {
    let shape = array.shape();
    if shape[2] != 3 {
        let message = format!("{name}: expected an array of shape (height, width, 3), found {shape:?}");
        return Err(errors::argument(py, message));
    }
    let mut film = Film::new(shape[1] as u32, shape[0] as u32);
    let pixels = array.as_array();
    let rows = pixels.axis_iter(Axis(0)).flat_map(|row| {
        let pixels = row.axis_iter(Axis(0)).map(|pixel| [pixel[0], pixel[1], pixel[2]]);
        pixels.collect::<Vec<_>>()
    });
    film.pixels = rows.collect();
    Ok(film)
}

/// How far an image is from a reference.
#[pyfunction]
pub fn compare<'py>(
    py: Python<'py>,
    image: PyReadonlyArray3<'py, f32>,
    reference: PyReadonlyArray3<'py, f32>,
) -> PyResult<Bound<'py, PyDict>> {
    let (image, reference) = (film_of(py, "image", &image)?, film_of(py, "reference", &reference)?);
    let found = py.detach(|| metrics::compare(&image, &reference));
    let found = found.map_err(|error| errors::argument(py, error))?;
    let block = |block: BlockDeviation| {
        let data = PyDict::new(py);
        data.set_item("x", block.x)?;
        data.set_item("y", block.y)?;
        data.set_item("absolute", block.absolute)?;
        data.set_item("relative", block.relative)?;
        Ok::<_, PyErr>(data)
    };
    let data = PyDict::new(py);
    data.set_item("rmse", found.rmse)?;
    data.set_item("rel_mse", found.rel_mse)?;
    data.set_item("mean_ratio", found.ratio)?;
    data.set_item("channel_ratio", found.channel_ratio)?;
    data.set_item("largest_absolute", block(found.largest_absolute)?)?;
    data.set_item("largest_relative", block(found.largest_relative)?)?;
    data.set_item("identical", pixel_hash(&image) == pixel_hash(&reference))?;
    data.set_item("text", found.to_string())?;
    Ok(data)
}

/// R, G and B of an OpenEXR file, as (height, width, 3).
#[pyfunction]
pub fn read_image(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyArray3<f32>>> {
    let film = py.detach(|| read_rgb(&path)).map_err(|error| errors::file(py, error))?;
    let shape = [film.height as usize, film.width as usize, 3];
    let flat = numpy::PyArray1::from_slice(py, film.pixels.as_flattened());
    flat.reshape(shape)
}

/// An OpenEXR file of an array of (height, width, 3), for scenes.
#[pyfunction]
pub fn encode_exr<'py>(py: Python<'py>, pixels: PyReadonlyArray3<'py, f32>) -> PyResult<Bound<'py, PyBytes>> {
    use exr::prelude::{Image, SpecificChannels, Vec2, WritableImage};
    let film = film_of(py, "pixels", &pixels)?;
    let width = film.width as usize;
    let channels = SpecificChannels::rgb(|Vec2(x, y)| {
        let [r, g, b] = film.pixels[y * width + x];
        (r, g, b)
    });
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = Image::from_channels((width, film.height as usize), channels);
    image
        .write()
        .to_buffered(&mut bytes)
        .map_err(|error| errors::file(py, error))?;
    Ok(PyBytes::new(py, bytes.get_ref()))
}
