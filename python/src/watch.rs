//! The observer of a laboratory: progress and messages go to Python, and signals come from it.

use std::ops::ControlFlow;

use krylux::observer::{Level, Observer, PhotoTaken, Step};
use pyo3::prelude::*;

use crate::work;

/// Tells Python of progress and messages, and stops where a signal or a callback raises.
pub(crate) struct Watcher {
    /// `(stage, done, total, estimate)`, or nothing.
    progress: Option<Py<PyAny>>,
    /// `(level, message)`.
    log: Py<PyAny>,
}

impl Watcher {
    pub(crate) fn new(progress: Option<Py<PyAny>>, log: Py<PyAny>) -> Self {
        Self { progress, log }
    }

    /// Runs `ask` in Python. An exception is kept, and stops the computation.
    fn ask(ask: impl FnOnce(Python<'_>) -> PyResult<()>) -> ControlFlow<()> {
        if work::has_caught() {
            return ControlFlow::Break(());
        }
        match Python::try_attach(ask) {
            Some(Ok(())) => ControlFlow::Continue(()),
            Some(Err(error)) => {
                work::keep(error);
                ControlFlow::Break(())
            }
            // The interpreter ends.
            None => ControlFlow::Break(()),
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
