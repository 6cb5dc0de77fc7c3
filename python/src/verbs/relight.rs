//! Relighting by a low-rank model.

use std::collections::BTreeMap;

use krylux::image::Image;
use krylux::verbs::Relight;
use krylux::verbs::relight::Questions;
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::asked::{attributes, request};
use crate::answers::{Answer, Kept};
use crate::arrays;
use crate::lab::Lab;

type Named<'py> = Vec<(String, PyReadonlyArrayDyn<'py, f32>)>;

/// The images of named arrays.
fn images(named: &Named<'_>) -> PyResult<Vec<(String, Image)>> {
    named.iter().map(|(name, array)| Ok((name.clone(), arrays::image(array)?))).collect()
}

#[pymethods]
impl Lab {
    /// A capture, or the model of a run, and what it answers to `[patterns, duals, photographs]`. As [`Lab::ask`].
    fn relight<'py>(
        &self,
        py: Python<'py>,
        images_of: [Named<'py>; 3],
        asked: BTreeMap<String, String>,
    ) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>, Answer)> {
        let [patterns, duals, photographs] = &images_of;
        let photographs = images(photographs)?.into_iter().map(|(name, image)| (name, image.planes()));
        let questions = Questions {
            patterns: images(patterns)?,
            duals: images(duals)?,
            photographs: photographs.collect(),
        };
        let request = Relight { questions: Some(questions), ..request(py, asked)? };
        let found = self.with(py, |lab| lab.ask(&request))?;
        let (arrays, facts) = attributes(py, &found)?;
        Ok((arrays, facts, Answer::new(Kept::Asked(Box::new(found)))))
    }
}
