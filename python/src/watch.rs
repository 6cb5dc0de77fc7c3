//! The observer of a laboratory: progress and messages go to Python, and signals come from it.

use std::ops::ControlFlow;

use krylux::observer::{Level, Observer, PhotoTaken, Step};
use pyo3::prelude::*;

use crate::work;

/// Tells Python of progress and messages, and stops where a signal or a callback raises. It is extracted from the function that shows
/// progress, or from nothing.
pub(crate) struct Watcher {
    /// `(stage, done, total, estimate)`.
    progress: Option<Py<PyAny>>,
    /// `(level, message)`.
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

    /// Runs `ask` in Python, unless an exception waits there already.
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
        // Whether to go on is asked at the next step.
        let _ = Self::ask(|py| self.log.call1(py, (level, message)).map(|_| ()));
    }

    fn frame(&self) -> ControlFlow<()> {
        Self::ask(|py| py.check_signals())
    }

    fn photo(&self, _photo: &PhotoTaken<'_>) -> ControlFlow<()> {
        self.frame()
    }
}
