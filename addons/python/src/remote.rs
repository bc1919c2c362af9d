//! Coordinators that run elsewhere.

use crate::errors;
use beamfarm_command::embedded::{self, Pem, Steer};
use pyo3::prelude::*;
use std::path::PathBuf;

/// A coordinator.
#[pyclass(frozen)]
pub struct Remote(embedded::Remote);

#[pymethods]
impl Remote {
    #[new]
    #[pyo3(signature = (url, token, authority, certificate, key))]
    fn new(
        py: Python<'_>,
        url: String,
        token: Option<String>,
        authority: Option<PathBuf>,
        certificate: Option<PathBuf>,
        key: Option<PathBuf>,
    ) -> PyResult<Self> {
        let pem = Pem {
            authority,
            certificate,
            key,
        };
        let made = embedded::Remote::new(url, token, pem);
        made.map(Self).map_err(|failure| errors::failed(py, &failure))
    }

    /// Its job's status, as JSON.
    fn status(&self, py: Python<'_>) -> PyResult<String> {
        let done = py.detach(|| self.0.status());
        done.map_err(|failure| errors::failed(py, &failure))
    }

    /// `pause`, `resume`, `cancel`, or `extend` to this many passes in all.
    #[pyo3(signature = (what, passes=None))]
    fn steer(&self, py: Python<'_>, what: &str, passes: Option<u64>) -> PyResult<()> {
        let steer = match (what, passes) {
            ("pause", None) => Steer::Pause,
            ("resume", None) => Steer::Resume,
            ("cancel", None) => Steer::Cancel,
            ("extend", Some(passes)) => Steer::Extend(passes),
            _ => return Err(errors::argument(py, format!("no coordinator can {what}"))),
        };
        let done = py.detach(|| self.0.steer(steer));
        done.map_err(|failure| errors::failed(py, &failure))
    }
}
