//! Renders, samples and plans.

use crate::errors;
use crate::image::Image;
use crate::scene::Source;
use beamfarm_command::embedded::{self, Asked, Failure, Hands, Notes, Samples, State, Until};
use beamfarm_image::job::Techniques;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::time::Duration;

/// Options by name; the Python side has checked their types.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options {
    layers: Vec<String>,
    paths: Option<u32>,
    seed: Option<u64>,
    alpha: Option<f64>,
    budget: Option<u64>,
    engine: Option<String>,
    device: Option<String>,
    threads: Option<usize>,
}

impl Options {
    pub fn asked(self, source: &Bound<'_, Source>) -> Asked {
        Asked {
            scene: source.get().0.clone(),
            layers: self.layers,
            paths: self.paths,
            seed: self.seed,
            alpha: self.alpha,
            budget: self.budget,
            engine: self.engine,
            gpu: self.device,
            threads: self.threads,
        }
    }
}

/// The Python caller that waits: it is asked for Ctrl-C and told the progress.
pub struct Waiting {
    callback: Option<Py<PyAny>>,
    raised: Option<PyErr>,
}

impl Waiting {
    /// Whether to go on.
    fn goes_on(&mut self, state: State) -> bool {
        let told = Python::attach(|py| {
            py.check_signals()?;
            let Some(callback) = &self.callback else { return Ok(()) };
            let data = PyDict::new(py);
            if let State::Rendering {
                passes,
                limit,
                fraction,
                remaining,
                error,
            } = state
            {
                data.set_item("passes", passes)?;
                data.set_item("limit", limit)?;
                data.set_item("fraction", fraction)?;
                data.set_item("remaining", remaining.map(|time| time.as_secs_f64()))?;
                data.set_item("error", error)?;
            }
            callback.call1(py, (data,)).map(drop)
        });
        match told {
            Ok(()) => true,
            Err(error) => {
                self.raised = Some(error);
                false
            }
        }
    }

    /// The exception that ended it, unless it is Ctrl-C and an image exists.
    fn ended(self, py: Python<'_>, has_image: bool) -> PyResult<bool> {
        match self.raised {
            Some(error) if error.is_instance_of::<PyKeyboardInterrupt>(py) && has_image => Ok(true),
            Some(error) => Err(error),
            None => Ok(false),
        }
    }
}

/// Does something lengthy while other Python threads run. The error is what the caller raised, or the failure.
pub fn wait<T: Send>(
    py: Python<'_>,
    callback: Option<Py<PyAny>>,
    work: impl FnOnce(&mut dyn FnMut(State) -> bool) -> Result<T, Failure> + Send,
) -> PyResult<(T, Waiting)> {
    let mut waiting = Waiting { callback, raised: None };
    let done = py.detach(|| work(&mut |state| waiting.goes_on(state)));
    match (done, waiting.raised.take()) {
        (Ok(done), raised) => Ok((done, Waiting { raised, ..waiting })),
        (Err(_), Some(raised)) => Err(raised),
        (Err(failure), None) => Err(errors::failed(py, &failure)),
    }
}

fn seconds(py: Python<'_>, name: &str, seconds: Option<f64>) -> PyResult<Option<Duration>> {
    let wrong = |_| errors::argument(py, format!("{name}: expected seconds, not less than 0"));
    seconds.map(Duration::try_from_secs_f64).transpose().map_err(wrong)
}

/// Notes, and what was left out.
pub type Told = (Vec<String>, Vec<String>);

pub fn told(notes: Notes) -> Told {
    (notes.notes, notes.left_out)
}

/// An image, notes and omissions, whether Ctrl-C ended it, and the exception to raise, if any.
type Outcome = (Option<Image>, Told, bool, Option<Py<PyAny>>);

/// Renders a scene in processes on this machine.
#[pyfunction]
#[pyo3(signature = (source, options, program, *, passes, time, error, percentile, workers, callback))]
#[expect(clippy::too_many_arguments, reason = "arguments of Python, by name")]
pub fn render(
    py: Python<'_>,
    source: &Bound<'_, Source>,
    options: Options,
    program: PathBuf,
    passes: Option<u64>,
    time: Option<f64>,
    error: Option<f64>,
    percentile: Option<u32>,
    workers: Option<usize>,
    callback: Option<Py<PyAny>>,
) -> PyResult<Outcome> {
    let asked = options.asked(source);
    let until = Until {
        passes,
        time: seconds(py, "time", time)?,
        error,
        percentile,
    };
    let hands = Hands { program, workers };
    let (done, waiting) = wait(py, callback, |tell| embedded::render(&asked, until, &hands, tell))?;
    let is_interrupted = waiting.ended(py, done.image.is_some())?;
    let failure = done.failure.as_ref().map(|failure| errors::failed(py, failure));
    let failure = failure.map(|error| error.into_value(py).into_any());
    Ok((done.image.map(Image), told(done.notes), is_interrupted, failure))
}

/// Renders samples of the path tracer.
#[pyfunction]
#[pyo3(signature = (source, options, *, samples, time, max_depth, callback))]
pub fn sample(
    py: Python<'_>,
    source: &Bound<'_, Source>,
    options: Options,
    samples: Option<u64>,
    time: Option<f64>,
    max_depth: Option<u32>,
    callback: Option<Py<PyAny>>,
) -> PyResult<Outcome> {
    let asked = options.asked(source);
    let wanted = Samples {
        count: samples,
        time: seconds(py, "time", time)?,
        max_depth,
    };
    let (done, waiting) = wait(py, callback, |tell| embedded::sample(&asked, wanted, tell))?;
    let is_interrupted = waiting.ended(py, done.image.is_some())?;
    Ok((done.image.map(Image), told(done.notes), is_interrupted, None))
}

/// What a pass will do, as text and as data.
#[pyfunction]
pub fn explain<'py>(py: Python<'py>, source: &Bound<'py, Source>, options: Options) -> PyResult<Bound<'py, PyDict>> {
    let asked = options.asked(source);
    let (done, _) = wait(py, None, |tell| embedded::explain(&asked, tell))?;
    let data = PyDict::new(py);
    let places = PyDict::new(py);
    for place in &done.places {
        places.set_item(&place.name, place.corners)?;
    }
    let settings = done.settings;
    data.set_item("text", done.text)?;
    data.set_item("scene", done.scene)?;
    data.set_item("width", done.size[0])?;
    data.set_item("height", done.size[1])?;
    data.set_item("passes", done.passes)?;
    data.set_item("engine", settings.engine.to_string())?;
    data.set_item("seed", settings.seed)?;
    data.set_item("alpha", settings.alpha)?;
    data.set_item("paths", settings.paths_per_pass)?;
    let techniques = settings.techniques;
    let techniques = (techniques != Techniques::default()).then(|| techniques.to_string());
    data.set_item("techniques", techniques)?;
    data.set_item("places", places)?;
    data.set_item("notes", done.notes.notes)?;
    data.set_item("left_out", done.notes.left_out)?;
    Ok(data)
}
