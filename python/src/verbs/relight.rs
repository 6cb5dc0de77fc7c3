//! Relighting by a low-rank model.

use krylux::analysis::planes::Planes;
use krylux::image::Image;
use krylux::lab::{BLOCK, Questions, RelightRequest, Relighting};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::Answered;
use crate::answers::{Answer, Kept};
use crate::arrays::{self, Fields, rows};
use crate::lab::Lab;

type Named<'py> = Vec<(String, PyReadonlyArrayDyn<'py, f32>)>;

/// The images of named arrays.
fn images(named: &Named<'_>) -> PyResult<Vec<(String, Image)>> {
    named.iter().map(|(name, array)| Ok((name.clone(), arrays::image(array)?))).collect()
}

/// The attributes of a relighting.
fn fields<'py>(py: Python<'py>, found: &Relighting) -> PyResult<Bound<'py, PyDict>> {
    let (fields, size) = (Fields::new(py), found.model.resolution);
    let (relit, duals, reduced) = (PyDict::new(py), PyDict::new(py), PyDict::new(py));
    let (errors, truths) = (PyDict::new(py), PyDict::new(py));
    for one in &found.relit {
        relit.set_item(&one.name, arrays::array(py, &one.relit)?)?;
        errors.set_item(&one.name, one.errors.last())?;
        if let Some(truth) = &one.truth {
            truths.set_item(&one.name, arrays::array(py, truth)?)?;
        }
    }
    for one in &found.duals {
        duals.set_item(&one.name, arrays::array(py, &one.image)?)?;
    }
    for one in &found.reduced {
        reduced.set_item(&one.name, arrays::array(py, &one.direct)?)?;
    }
    fields.put("relit", relit)?.put("errors", errors)?.put("truth", truths)?;
    fields.put("duals", duals)?.put("direct", reduced)?;
    fields.put("rank", found.model.rank())?.put("photos", found.photos)?;
    fields.image("ambient", &found.model.ambient)?;
    let pixels = (size.pixels(), found.model.projector.pixels());
    let pairs: Vec<(Bound<'py, PyAny>, Bound<'py, PyAny>)> = found
        .model
        .channels
        .iter()
        .map(|model| Ok((rows(py, model.basis(), pixels.1)?, rows(py, model.photos(), pixels.0)?)))
        .collect::<PyResult<_>>()?;
    fields.put("model", pairs)?.record("curve", &found.curve)?;
    fields.put("status", found.sentence())?.put("good", found.is_good())?;
    Ok(fields.0)
}

#[pymethods]
impl Lab {
    /// A capture, or the model of a run, and what it answers.
    fn relight<'py>(
        &self,
        py: Python<'py>,
        patterns: Named<'py>,
        duals: Named<'py>,
        photographs: Named<'py>,
        question: (usize, Option<usize>, Option<f64>),
    ) -> PyResult<Answered<'py>> {
        let (photos, block, max_error) = question;
        let planes = |(name, image): (String, Image)| -> (String, Planes) { (name, image.planes()) };
        let questions = Questions {
            patterns: images(&patterns)?,
            duals: images(&duals)?,
            photographs: images(&photographs)?.into_iter().map(planes).collect(),
        };
        let found = self.with(py, |lab| {
            if lab.has_model() {
                return lab.relight_run(&questions);
            }
            let block = block.unwrap_or(BLOCK);
            lab.relight(&RelightRequest { photos, block, questions, max_error })
        })?;
        Ok((fields(py, &found)?, Answer::new(Kept::Relight(Box::new(found)))))
    }
}
