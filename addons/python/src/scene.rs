//! Scenes as text and files.

use crate::errors;
use beamfarm_scene::{ImportOptions, SceneFile, SceneText};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// Where a scene's files may be, and which it has read.
#[pyclass(frozen)]
pub struct Reach(Arc<beamfarm_scene::Reach>);

#[pymethods]
impl Reach {
    /// For a scene at this path, which may also read files in these folders.
    #[new]
    fn new(path: PathBuf, allowed: Vec<PathBuf>) -> Self {
        Self(Arc::new(beamfarm_scene::Reach::new(&path, &allowed)))
    }
}

/// A scene as text, with files that exist only in memory.
#[pyclass(frozen)]
pub struct Source(pub Arc<SceneText>);

#[pymethods]
impl Source {
    #[new]
    fn new(path: PathBuf, text: String, made: BTreeMap<String, Vec<u8>>, reach: &Reach) -> Self {
        Self(Arc::new(SceneText {
            path,
            text,
            made,
            reach: Some(reach.0.clone()),
        }))
    }

    /// Raises everything that is wrong with it.
    fn check(&self, py: Python<'_>) -> PyResult<()> {
        let scene = self.0.clone();
        let found = py.detach(move || {
            let options = ImportOptions::default();
            let loaded = SceneFile::of_text(&scene, &options).and_then(|file| file.load());
            loaded.map(drop).map_err(|error| {
                let all = beamfarm_scene::errors_of_text(&scene, &options);
                if all.is_empty() { vec![error] } else { all }
            })
        });
        found.map_err(|all| errors::scene(py, &all))
    }
}

/// TOML as a dictionary. `path`: its name in errors.
#[pyfunction]
pub fn loads<'py>(py: Python<'py>, text: &str, path: PathBuf) -> PyResult<Bound<'py, PyAny>> {
    let table: toml::Table = toml::from_str(text).map_err(|error| {
        let line = error
            .span()
            .map(|span| text[..span.start.min(text.len())].matches('\n').count() + 1);
        let error = beamfarm_scene::SceneError {
            file: path.clone(),
            line,
            message: error.message().to_owned(),
        };
        errors::scene(py, &[error])
    })?;
    Ok(pythonize::pythonize(py, &table)?)
}

/// A dictionary as TOML.
#[pyfunction]
pub fn dumps(py: Python<'_>, data: &Bound<'_, PyDict>) -> PyResult<String> {
    let table: toml::Table = pythonize::depythonize(data)?;
    toml::to_string(&table).map_err(|error| errors::argument(py, error))
}

/// Text of a scene file, files made for it, where others may be, notes, and what was left out.
type Read<'py> = (
    String,
    BTreeMap<String, Bound<'py, PyBytes>>,
    Reach,
    Vec<String>,
    Vec<String>,
);

/// Reads a scene of any format as a native one.
#[pyfunction]
pub fn read_scene<'py>(
    py: Python<'py>,
    path: PathBuf,
    parameters: Vec<(String, String)>,
    skip_unsupported: bool,
    spectral: bool,
    allow_outside: Vec<PathBuf>,
) -> PyResult<Read<'py>> {
    let options = ImportOptions {
        parameters,
        skip_unsupported,
        spectral,
        allow_outside,
        ..ImportOptions::default()
    };
    let read = py.detach(|| {
        SceneFile::read(&path, &options).map_err(|error| {
            let all = match error.file == path {
                true => beamfarm_scene::errors(&path, &options),
                false => Vec::new(),
            };
            if all.is_empty() { vec![error] } else { all }
        })
    });
    let file = read.map_err(|all| errors::scene(py, &all))?;
    let text = String::from_utf8_lossy(file.text()).into_owned();
    let bytes = |name: &String| {
        let bytes = file.bundle.files.get(&beamfarm_image::bundle::key(name));
        bytes.map(|bytes| (name.clone(), PyBytes::new(py, bytes)))
    };
    let made = file.made.iter().filter_map(bytes).collect();
    Ok((text, made, Reach(file.reach), file.notes, file.left_out))
}

/// The radius factor of a pass, for radii that shrink once per pass.
#[pyfunction]
pub fn radius_scale(index: u64, alpha: f64) -> f64 {
    beamfarm_image::radius::radius_scale(index as f64 + 1.0, alpha)
}
