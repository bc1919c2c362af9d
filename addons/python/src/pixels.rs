//! Films as arrays, and arrays as films.

use crate::errors;
use beamfarm_image::exr::{ImageMeta, pixel_hash, read_rgb};
use beamfarm_image::film::Film;
use beamfarm_image::layer::Layer;
use beamfarm_image::metrics::{self, BlockDeviation};
use numpy::ndarray::{ArrayView3, Axis};
use numpy::{PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::path::PathBuf;

/// A film as a read-only array of (height, width, 3) that shares memory with `owner`, which holds the film and never
/// changes.
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

/// Names of the layers that are arrays; mattes are not.
pub fn layer_names(meta: &ImageMeta) -> Vec<String> {
    let films = meta.layers.iter().filter(|layer| layer.matte().is_none());
    films.map(ToString::to_string).collect()
}

/// The layer of this name from `films`, which `owner` holds.
pub fn layer_named<'py>(
    meta: &ImageMeta,
    films: &[Film],
    name: &str,
    owner: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let layers = meta.layers.iter().filter(|layer| layer.matte().is_none());
    let found = layers.zip(films).find(|(layer, _)| layer.to_string() == name);
    let (found, film) = found.ok_or_else(|| PyKeyError::new_err(name.to_owned()))?;
    layer(found, film, meta.empty_depth.unwrap_or(f32::INFINITY), owner)
}

/// A layer in its public shape: (height, width) for one channel, (height, width, N) for several.
fn layer<'py>(layer: &Layer, film: &Film, empty_depth: f32, owner: Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
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

/// R, G and B of an OpenEXR file as (height, width, 3).
#[pyfunction]
pub fn read_image(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyArray3<f32>>> {
    let film = py.detach(|| read_rgb(&path)).map_err(|error| errors::file(py, error))?;
    let shape = [film.height as usize, film.width as usize, 3];
    let flat = numpy::PyArray1::from_slice(py, film.pixels.as_flattened());
    flat.reshape(shape)
}

/// An array of (height, width, 3) as an OpenEXR file for scenes.
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
