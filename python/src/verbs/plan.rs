//! Plans: what a verb will cost on a rig, and how good its answer will be.

use std::collections::BTreeMap;

use krylux::lab::{Plan, PlanRequest, RigSource};
use krylux::transport::Channels;
use krylux::verbs::{Compensate, Eigs, Segment};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::asked::{Arrays, request};
use crate::arrays::Fields;
use crate::lab::Lab;

/// The attributes of a plan.
fn fields<'py>(py: Python<'py>, verb: &str, found: &Plan) -> PyResult<Bound<'py, PyDict>> {
    let fields = Fields::new(py);
    fields.put("verb", verb)?;
    fields.numbers("photos", found.costs.iter().map(|cost| cost.photos).collect())?;
    fields.numbers("patterns", found.costs.iter().map(|cost| cost.patterns).collect())?;
    fields.numbers("frames", found.costs.iter().map(|cost| cost.frames).collect())?;
    fields.numbers("seconds", found.costs.iter().map(|cost| cost.seconds).collect())?;
    let figures = Fields::new(py);
    for (name, values) in &found.figures {
        figures.numbers(name, values.clone())?;
    }
    fields.put("figures", figures.0)?.record("ideal", &found.ideal)?.record("trials", &found.trials)?;
    Ok(fields.0)
}

impl Lab {
    fn plan<'py>(&self, py: Python<'py>, request: &PlanRequest, trials: u64) -> PyResult<Bound<'py, PyDict>> {
        let found = self.with(py, |lab| lab.plan(request, trials))?;
        fields(py, request.verb(), &found)
    }
}

#[pymethods]
impl Lab {
    /// The plan of a segmentation.
    fn plan_segment<'py>(
        &self,
        py: Python<'py>,
        asked: BTreeMap<String, String>,
        trials: u64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let request: Segment = request(py, asked, Vec::new())?;
        request.check_plan().map_err(|error| crate::errors::raise(py, &error))?;
        let seed = self.with(py, |lab| Ok(lab.seed()))?;
        self.plan(py, &PlanRequest::Segment(request.part(), request.options(seed, None)), trials)
    }

    /// The plan of a compensation.
    fn plan_compensate<'py>(
        &self,
        py: Python<'py>,
        asked: BTreeMap<String, String>,
        arrays: Arrays<'py>,
        trials: u64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let request: Compensate = request(py, asked, arrays)?;
        let (target, is_symmetric) = self.with(py, |lab| {
            request.check_plan()?;
            let target = request.target(lab.resolution(), Channels::Luma)?;
            Ok((target, lab.rig().is_none_or(RigSource::is_symmetric)))
        })?;
        self.plan(py, &PlanRequest::Compensate(target, request.options(is_symmetric, None)), trials)
    }

    /// The plan of eigenpairs.
    fn plan_eigs<'py>(
        &self,
        py: Python<'py>,
        asked: BTreeMap<String, String>,
        trials: u64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let request: Eigs = request(py, asked, Vec::new())?;
        let seed = self.with(py, |lab| Ok(lab.seed()))?;
        self.plan(py, &PlanRequest::Eigs(request.part.into(), request.options(seed, None)), trials)
    }
}
