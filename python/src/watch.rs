//! The observer of a laboratory. It passes progress and messages to Python, and receives signals from Python.

use std::ops::ControlFlow;

use krylux::observer::{Level, Observer, PhotoTaken, Step};
use pyo3::prelude::*;

use crate::work;

/// Passes progress and messages to Python. It stops the work when a signal handler or a callback raises an exception. It is converted from
/// the function that shows progress, or from `None`.
pub(crate) struct Watcher {
    /// The function for progress, with the arguments `(stage, done, total, estimate)`.
    progress: Option<Py<PyAny>>,
    /// The function for messages, with the arguments `(level, message)`.
    log: Py<PyAny>,
}

impl FromPyObject<'_, '_> for Watcher {
    type Error = PyErr;

    fn extract(progress: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        Self::new(progress.py(), progress.extract()?)
    }
}

impl Watcher {
    pub(crate) fn new(py: Python<'_>, progress: Option<Py<PyAny>>) -> PyResult<Self> {
        Ok(Self { progress, log: py.import("krylux._progress")?.getattr("log")?.unbind() })
    }

    /// Runs `ask` in Python, unless an exception is already kept.
    fn ask(ask: impl FnOnce(Python<'_>) -> PyResult<()>) -> ControlFlow<()> {
        match work::has_caught() || work::in_python(ask).is_err() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

impl Observer for Watcher {
    fn step(&self, step: &Step<'_>) -> ControlFlow<()> {
        Self::ask(|py| {
            py.check_signals()?;
            let Some(progress) = &self.progress else { return Ok(()) };
            let told = (step.stage, step.done, step.total, step.estimate.to_string());
            progress.call1(py, told).map(|_| ())
        })
    }

    fn log(&self, level: Level, message: &str) {
        let level = match level {
            Level::Warning => "warning",
            Level::Note => "note",
            Level::Info => "info",
            Level::Detail => "detail",
        };
        // The result is ignored, because the next step checks whether to stop.
        let _ = Self::ask(|py| self.log.call1(py, (level, message)).map(|_| ()));
    }

    fn frame(&self) -> ControlFlow<()> {
        Self::ask(|py| py.check_signals())
    }

    fn photo(&self, _photo: &PhotoTaken<'_>) -> ControlFlow<()> {
        self.frame()
    }
}
