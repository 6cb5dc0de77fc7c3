//! The verbs of krylux. Their fields are keyword arguments, and their answers are attributes. Answers are kept until they are saved.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use krylux::Error;
use krylux::lab::{Answer as Answering, GivenArray};
use krylux::report::content::{Content, Values};
use krylux::verbs::plan::Planned;
use krylux::verbs::{AnyVerb, Compensate, Declared, VERBS, from_json};
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use crate::arrays::{self, Fields, shaped};
use crate::errors::{self, in_python};
use crate::lab::Lab;

/// The name of a verb, its purpose, and its parameters: name, default as JSON, type, and help.
type Signature = (&'static str, String, Vec<(String, String, String, String)>);

/// The verbs for [`Lab::ask`].
#[pyfunction]
pub(crate) fn verbs() -> Vec<Signature> {
    let described = |verb: &Declared| {
        let (about, parameters) = (verb.signature)();
        let parameters = parameters.into_iter().map(|of| (of.name, of.default, of.kind, in_python(&of.help)));
        (verb.name, in_python(&about), parameters.collect())
    };
    VERBS.iter().map(described).collect()
}

/// An answer of the library.
#[pyclass(frozen, module = "krylux._krylux", name = "Answer")]
pub(crate) struct Answer(Mutex<Box<dyn Answering + Send>>);

impl Answer {
    pub(crate) fn kept(&self) -> MutexGuard<'_, Box<dyn Answering + Send>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Arrays in place of files: the field, the name if the field takes several arrays, and the array.
type Arrays<'py> = Vec<(String, String, PyReadonlyArrayDyn<'py, f64>)>;

/// Passes the arrays to the request.
fn give<V: AnyVerb + ?Sized>(py: Python<'_>, request: &mut V, arrays: Arrays<'_>) -> PyResult<()> {
    let given = |(field, name, array): (String, String, PyReadonlyArrayDyn<'_, f64>)| {
        Ok(GivenArray { field, name, shape: array.shape().to_vec(), values: array.as_slice()?.to_vec() })
    };
    let given = arrays.into_iter().map(given).collect::<PyResult<_>>()?;
    request.give(given).map_err(|error| errors::raise(py, &error))
}

/// Parses keyword arguments, whose values are JSON, into fields.
fn fields(py: Python<'_>, asked: BTreeMap<String, String>) -> PyResult<Map<String, Value>> {
    let parsed = asked.into_iter().map(|(name, value)| Ok((name, serde_json::from_str(&value)?)));
    let fields = parsed.collect::<Result<_, serde_json::Error>>();
    fields.map_err(|why| errors::raise(py, &Error::Numerical(why.to_string())))
}

/// Makes a request from keyword arguments.
pub(crate) fn request<V: Serialize + DeserializeOwned + Default>(
    py: Python<'_>,
    asked: BTreeMap<String, String>,
) -> PyResult<V> {
    from_json(fields(py, asked)?).map_err(|error| errors::raise(py, &error))
}

#[pymethods]
impl Lab {
    /// Asks a verb. Returns the arrays and the facts of the answer by name, and the answer itself.
    fn ask<'py>(
        &self,
        py: Python<'py>,
        verb: &str,
        asked: BTreeMap<String, String>,
        arrays: Arrays<'py>,
    ) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>, Answer)> {
        let Some(verb) = Declared::named(verb) else {
            return Err(errors::option(py, "verb", &format!("there is no {verb}"), "see krylux.Lab"));
        };
        let mut request = (verb.from_json)(fields(py, asked)?).map_err(|error| errors::raise(py, &error))?;
        give(py, &mut *request, arrays)?;
        let found = self.with(py, |lab| request.ask(lab))?;
        let (arrays, facts) = attributes(py, &*found)?;
        Ok((arrays, facts, Answer(Mutex::new(found))))
    }

    /// Plans a verb: predicts its cost on a rig and the error of its answer.
    fn plan<'py>(
        &self,
        py: Python<'py>,
        verb: &str,
        asked: BTreeMap<String, String>,
        arrays: Arrays<'py>,
        trials: u64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let planned = match verb {
            "segment" => Planned::Segment(request(py, asked)?),
            "compensate" => {
                let mut request: Compensate = request(py, asked)?;
                give(py, &mut request, arrays)?;
                Planned::Compensate(request)
            }
            _ => Planned::Eigs(request(py, asked)?),
        };
        let found = self.with(py, |lab| planned.predict(lab, trials, false))?;
        attributes_of(py, &found.content())
    }
}

/// The arrays and the facts of an answer by name.
pub(crate) fn attributes<'py>(
    py: Python<'py>,
    found: &dyn Answering,
) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>)> {
    let content = found.content();
    let facts = facts_of(py, &content)?;
    facts.put("photos", found.photos())?.put("status", found.headline())?;
    Ok((arrays_of(py, &content)?, facts.0))
}

/// The facts and the arrays of an answer's content by name. An array replaces a fact with the same name.
pub(crate) fn attributes_of<'py>(py: Python<'py>, content: &Content<'_>) -> PyResult<Bound<'py, PyDict>> {
    let fields = facts_of(py, content)?;
    fields.0.update(arrays_of(py, content)?.as_mapping())?;
    Ok(fields.0)
}

fn facts_of<'py>(py: Python<'py>, content: &Content<'_>) -> PyResult<Fields<'py>> {
    let facts = Fields::new(py);
    for (name, value) in content.facts() {
        facts.put(name, arrays::parsed(py, value)?)?;
    }
    Ok(facts)
}

/// The arrays by name. Arrays with the same name form a dictionary, with their numbers as keys.
fn arrays_of<'py>(py: Python<'py>, content: &Content<'_>) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for array in &content.arrays {
        let values = match &array.values {
            Values::F64(values) => shaped(py, &array.shape, values.to_vec())?,
            Values::F32(values) => shaped(py, &array.shape, values.to_vec())?,
            Values::U8(values) => shaped(py, &array.shape, values.to_vec())?,
            Values::Bool(values) => shaped(py, &array.shape, values.to_vec())?,
            Values::Rows(rows) => shaped(py, &array.shape, rows.concat())?,
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
