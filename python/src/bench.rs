//! Requests to the devices of a rig. Their fields are keyword arguments, and their answers are attributes.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use krylux::Error;
use krylux::bench::preview::LivePreview;
use krylux::image::{Image, Resolution};
use krylux::lab::RigSource;
use krylux::verbs::rig::{Align, BenchRig, Calibrate, CheckBench, ListDevices, MeasureSheet};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{self, Fields};
use crate::settings::Request;
use crate::verbs::{attributes_of, request};
use crate::work::Held;
use crate::{errors, work};

/// The rig of a request. Its calibration may not exist yet.
fn rig(py: Python<'_>, source: Request) -> PyResult<RigSource> {
    let builder = source.builder(py)?;
    work::detached(py, || builder.open_uncalibrated_rig())
}

/// Sends a request to a rig or to the attached devices. Returns the attributes of the answer; for an alignment, those of each round.
#[pyfunction]
pub(crate) fn ask_rig<'py>(
    py: Python<'py>,
    verb: &str,
    source: Request,
    asked: BTreeMap<String, String>,
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let content = match verb {
        "calibrate" => {
            let asked: Calibrate = request(py, asked)?;
            let rig = rig(py, source)?;
            work::detached(py, || Ok(asked.ask(&rig)?.content()))?
        }
        "flat_field" => {
            let builder = source.builder(py)?;
            // The Python side passes only rigs, so the error does not occur.
            work::detached(py, || MeasureSheet::ask(builder.open()?.rig().ok_or(Error::Interrupted)?))?
        }
        "check" => {
            let asked: CheckBench = request(py, asked)?;
            let rig = rig(py, source)?;
            let mut ask_python = |_: &_| match work::in_python(|py| py.check_signals()) {
                Ok(()) => ControlFlow::Continue(()),
                Err(_) => ControlFlow::Break(()),
            };
            let found = work::detached(py, || asked.ask(Ok(rig), &mut ask_python))?;
            CheckBench::content(&found)
        }
        "list" => {
            let asked: ListDevices = request(py, asked)?;
            work::detached(py, || asked.ask())?.0
        }
        _ => {
            let asked: Align = request(py, asked)?;
            let rig = rig(py, source)?;
            let rounds = work::detached(py, || {
                let mut rounds = Vec::new();
                asked.ask(&BenchRig::new(rig), |_, round| {
                    rounds.push(round);
                    Ok(())
                })?;
                Ok(rounds)
            })?;
            let numbered = (1..).zip(&rounds);
            return numbered
                .map(|(number, round)| attributes_of(py, &asked.content(number, round)))
                .collect();
        }
    };
    Ok(vec![attributes_of(py, &content)?])
}

/// A preview that runs until it is closed.
#[pyclass(frozen, module = "krylux._krylux", name = "Preview")]
pub(crate) struct Preview(Held<LivePreview>);

#[pymethods]
impl Preview {
    /// Opens the devices. An unusable calibration is ignored.
    #[new]
    fn new(
        py: Python<'_>,
        source: Request,
        pattern: Option<PyReadonlyArrayDyn<'_, f32>>,
        exposure: Option<f64>,
    ) -> PyResult<Self> {
        let rig = rig(py, source)?;
        let size = rig.resolution();
        let image = match &pattern {
            Some(pattern) => arrays::image(pattern)?,
            None => Image::filled(size, 1, 1.0),
        };
        if image.resolution() != size {
            let Resolution { width, height } = size;
            let fault = format!("its pixels are {}, but the projector has {size}", image.resolution());
            let help = format!("give an array of shape ({height}, {width}) or ({height}, {width}, 3)");
            return Err(errors::option(py, "pattern", &fault, &help));
        }
        Ok(Self(Held::new(work::detached(py, || BenchRig::new(rig).preview(&image, exposure))?)))
    }

    /// The next frame, with its figures.
    fn next<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (figures, raw, range) = self.0.with(py, |running| {
            let figures = running.capture()?;
            // There is a last frame, because one was captured just now.
            let raw = running.last().cloned().ok_or(Error::Interrupted)?;
            Ok((figures, raw, *running.range()))
        })?;
        let fields = Fields::new(py);
        let picture = range.paint(&raw);
        fields.raster("picture", picture.bytes().to_vec(), raw.resolution, 3)?;
        fields.raster("counts", raw.counts, raw.resolution, raw.channels)?;
        fields.put("status", figures.line(&range))?;
        fields.put("range", (range.black, range.limit, range.full))?.record("figures", &figures)?;
        Ok(fields.0)
    }

    /// Closes the devices.
    fn close(&self, py: Python<'_>) {
        py.detach(|| drop(self.0.take()));
    }
}
