//! Plans: what a verb will cost on a rig, and how good its answer will be.

use std::collections::BTreeMap;

use krylux::verbs::plan::Planned;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::asked::{Pictures, attributes_of, compensation, request};
use crate::lab::Lab;

#[pymethods]
impl Lab {
    /// The plan of a verb.
    fn plan<'py>(
        &self,
        py: Python<'py>,
        verb: &str,
        asked: BTreeMap<String, String>,
        pictures: Pictures<'py>,
        trials: u64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let planned = match verb {
            "segment" => Planned::Segment(request(py, asked)?),
            "compensate" => Planned::Compensate(compensation(py, asked, &pictures)?),
            _ => Planned::Eigs(request(py, asked)?),
        };
        let found = self.with(py, |lab| planned.predict(lab, trials, false))?;
        attributes_of(py, &found.content())
    }
}
