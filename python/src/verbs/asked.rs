//! Verbs whose requests are declared in krylux: their fields come as keyword arguments, and their answers go out as attributes.

use std::collections::BTreeMap;

use krylux::Error;
use krylux::lab::{Answer as Answering, Verb};
use krylux::report::content::{Content, Values};
use krylux::verbs::{Compensate, Eigs, Request, Segment, Separate, from_json, signature};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::answers::{Answer, Kept};
use crate::arrays::{self, Fields, shaped};
use crate::errors::{self, in_python};
use crate::lab::Lab;

/// The name of a verb, what it is for, and its parameters: name, default as JSON, type, and help.
type Signature = (&'static str, String, Vec<(String, String, String, String)>);

/// The verbs that [`Lab::ask`] knows.
#[pyfunction]
pub(crate) fn verbs() -> Vec<Signature> {
    vec![described::<Compensate>(), described::<Eigs>(), described::<Segment>(), described::<Separate>()]
}

fn described<V: Request>() -> Signature {
    let (about, parameters) = signature::<V>();
    let parameters = parameters.into_iter().map(|of| (of.name, of.default, of.kind, in_python(&of.help)));
    (V::NAME, in_python(&about), parameters.collect())
}

/// Pictures that are asked about, by the names of their keyword arguments.
pub(super) type Pictures<'py> = BTreeMap<String, PyReadonlyArrayDyn<'py, f32>>;

/// The request of keyword arguments whose values are JSON.
pub(crate) fn request<V: Serialize + DeserializeOwned + Default>(
    py: Python<'_>,
    asked: BTreeMap<String, String>,
) -> PyResult<V> {
    let parsed = asked.into_iter().map(|(name, value)| Ok((name, serde_json::from_str(&value)?)));
    let fields = parsed.collect::<Result<_, serde_json::Error>>();
    let fields = fields.map_err(|why| Error::Numerical(why.to_string()));
    fields.and_then(from_json).map_err(|error| errors::raise(py, &error))
}

/// The request of a compensation, whose target may be an array.
pub(super) fn compensation(
    py: Python<'_>,
    asked: BTreeMap<String, String>,
    pictures: &Pictures<'_>,
) -> PyResult<Compensate> {
    let asked: Compensate = request(py, asked)?;
    match pictures.get("target") {
        Some(target) => Ok(Compensate { target: Some(arrays::image(target)?.into()), ..asked }),
        None => Ok(asked),
    }
}

#[pymethods]
impl Lab {
    /// Asks a verb. Returns the arrays and the facts of the answer by name, and the answer itself.
    fn ask<'py>(
        &self,
        py: Python<'py>,
        verb: &str,
        asked: BTreeMap<String, String>,
        pictures: Pictures<'py>,
    ) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>, Answer)> {
        match verb {
            Compensate::NAME => self.answered(py, &compensation(py, asked, &pictures)?),
            Eigs::NAME => self.answered(py, &request::<Eigs>(py, asked)?),
            Segment::NAME => self.answered(py, &request::<Segment>(py, asked)?),
            Separate::NAME => self.answered(py, &request::<Separate>(py, asked)?),
            other => Err(errors::option(py, "verb", &format!("there is no {other}"), "see krylux.Lab")),
        }
    }
}

impl Lab {
    fn answered<'py, V>(
        &self,
        py: Python<'py>,
        request: &V,
    ) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>, Answer)>
    where
        V: Request + Verb<Answer: Send + 'static> + Sync,
    {
        let found = self.with(py, |lab| lab.ask(request))?;
        let (arrays, facts) = attributes(py, &found)?;
        Ok((arrays, facts, Answer::new(Kept::Asked(Box::new(found)))))
    }
}

/// The arrays and the facts of an answer by name.
pub(crate) fn attributes<'py>(
    py: Python<'py>,
    found: &dyn Answering,
) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>)> {
    let (content, facts) = (found.content(), Fields::new(py));
    for (name, value) in content.facts() {
        facts.put(name, arrays::parsed(py, value)?)?;
    }
    facts.put("photos", found.photos())?.put("status", found.sentence())?;
    Ok((arrays_of(py, &content)?, facts.0))
}

/// The facts and the arrays of a content by name. An array replaces the fact of its name.
pub(crate) fn attributes_of<'py>(py: Python<'py>, content: &Content<'_>) -> PyResult<Bound<'py, PyDict>> {
    let fields = Fields::new(py);
    for (name, value) in content.facts() {
        fields.put(name, arrays::parsed(py, value)?)?;
    }
    fields.0.update(arrays_of(py, content)?.as_mapping())?;
    Ok(fields.0)
}

/// The arrays by name; those that share a name are a dictionary by their number.
fn arrays_of<'py>(py: Python<'py>, content: &Content<'_>) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for array in &content.arrays {
        let values = match &array.values {
            Values::F64(values) => shaped(py, &array.shape, values.to_vec())?,
            Values::F32(values) => shaped(py, &array.shape, values.to_vec())?,
            Values::U8(values) => shaped(py, &array.shape, values.to_vec())?,
            Values::Bool(values) => shaped(py, &array.shape, values.to_vec())?,
            Values::Image(image) => arrays::array(py, image)?,
        };
        match array.key {
            None => all.set_item(array.name, values)?,
            Some(key) => {
                let of_name = match all.get_item(array.name)? {
                    Some(of_name) => of_name,
                    None => {
                        all.set_item(array.name, PyDict::new(py))?;
                        all.as_any().get_item(array.name)?
                    }
                };
                of_name.set_item(key, values)?;
            }
        }
    }
    Ok(all)
}
