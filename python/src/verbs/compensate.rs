//! Compensation.

use std::path::{Path, PathBuf};

use krylux::analysis::compensate::{CompensateOptions, Compensation, Crosstalk, Precondition, Target};
use krylux::analysis::{CompensationRow, MethodRun};
use krylux::krylov::{Constraint, Method};
use krylux::lab::{ColorMixing, CompensateAnswer, CompensateRequest, Lab as Laboratory, open_model};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::Answered;
use crate::answers::{Answer, Kept};
use crate::arrays::{self, Fields};
use crate::errors;
use crate::lab::Lab;
use crate::settings::one_of;

/// What is asked of a compensation.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(super) struct CompensateQuestion {
    method: Option<String>,
    photos: Option<usize>,
    rtol: Option<f64>,
    floor: f64,
    lift: Option<f64>,
    peak: Option<f64>,
    precondition: Option<String>,
    defocus: Option<f64>,
    out_of_focus: bool,
    paper: bool,
    measure_crosstalk: bool,
    crosstalk: Option<[[f64; 3]; 3]>,
    unmix: bool,
    compare_methods: bool,
    /// The folder of a run whose model answers, corrected by photos.
    model: Option<PathBuf>,
}

impl CompensateQuestion {
    /// The options of krylux for a symmetric rig or another; a comparison with a baseline costs nothing where photos are products.
    pub(super) fn options(
        &self,
        py: Python<'_>,
        is_symmetric: bool,
        is_simulated: bool,
    ) -> PyResult<CompensateOptions> {
        let base = match self.paper {
            true => CompensateOptions::paper(is_symmetric, 0.1),
            false => CompensateOptions::default(),
        };
        let method = self.method.as_deref().map(Method::from_name).transpose();
        let method = method.map_err(|error| errors::raise(py, &error))?.unwrap_or(base.method);
        let is_free = method.facts().constraint == Constraint::None;
        let preconditions = [
            ("none", Precondition::None),
            ("diagonal", Precondition::Diagonal),
            ("multiscale", Precondition::Multiscale),
            ("direct", Precondition::Direct),
            ("geometry", Precondition::Geometry),
            ("defocus", Precondition::Defocus),
        ];
        let given = self.precondition.as_ref();
        let given = given.map(|name| one_of(py, "precondition", name, &preconditions)).transpose()?;
        Ok(CompensateOptions {
            method,
            photos: self.photos.unwrap_or(base.photos),
            rtol: self.rtol.unwrap_or(base.rtol),
            must_reach: self.rtol.is_some(),
            floor: self.floor,
            lift: self.lift.unwrap_or(base.lift),
            peak: self.peak,
            precondition: given.or(base.precondition.filter(|_| is_free)),
            defocus: self.defocus,
            out_of_focus: self.out_of_focus,
            baseline: is_simulated,
        })
    }

    fn colors(&self, py: Python<'_>) -> PyResult<Option<ColorMixing>> {
        if let Some(matrix) = self.crosstalk {
            Crosstalk::new(matrix).map_err(|error| errors::raise(py, &error))?;
        }
        let is_asked = self.measure_crosstalk || self.crosstalk.is_some();
        Ok(is_asked.then_some(ColorMixing { matrix: self.crosstalk, unmix: self.unmix }))
    }
}

/// The residual after each photo.
fn residuals(rows: &[CompensationRow]) -> Vec<f64> {
    rows.iter().map(|row| row.residual).collect()
}

/// The attributes of a compensation.
fn fields<'py>(py: Python<'py>, found: &Compensation, methods: &[MethodRun]) -> PyResult<Bound<'py, PyDict>> {
    let fields = Fields::new(py);
    fields.image("pattern", &found.pattern)?.image("target", &found.target)?;
    fields.image("observed", &found.observed)?.image("uncompensated", &found.uncompensated)?;
    match &found.unclipped {
        Some(image) => fields.image("unclipped", image)?,
        None => fields.put("unclipped", py.None())?,
    };
    fields.put("peak", found.peak)?.put("residual", found.residual)?;
    fields.put("unclipped_residual", found.unclipped_residual)?;
    fields.put("uncompensated_residual", found.uncompensated_residual)?;
    fields.numbers("history", residuals(&found.history))?;
    fields.numbers("baseline", residuals(&found.baseline))?;
    fields.put("photos", found.photos)?.put("preparation", found.preparation)?;
    fields.record("similarity", &found.similarity)?;
    fields.record("uncompensated_similarity", &found.uncompensated_similarity)?;
    fields.put("status", found.status.to_string())?.put("good", found.good)?;
    let by_name = PyDict::new(py);
    for run in methods {
        let about = Fields::new(py);
        about.put("photos", run.photos)?.put("frames", run.frames.clone())?;
        about.put("residual", run.residual)?.put("ssim", run.ssim)?;
        about.numbers("history", residuals(&run.history))?;
        about.numbers("displayed", residuals(&run.displayed))?;
        by_name.set_item(run.name, about.0)?;
    }
    fields.put("methods", by_name)?;
    Ok(fields.0)
}

/// Answers by the model in a folder, corrected by so many photos.
fn by_model(
    lab: &mut Laboratory,
    folder: &Path,
    request: &CompensateRequest,
    photos: Option<usize>,
) -> krylux::Result<CompensateAnswer> {
    let mut model = open_model(folder, lab.observer())?;
    let target = Target::new(&request.target, &model.ambient)?;
    // Without photos the options still have to be those of a method that takes some.
    let options =
        CompensateOptions { photos: request.options.photos.max(1), baseline: false, ..request.options };
    let corrections = photos.unwrap_or(CompensateOptions::default().photos);
    let found = lab.compensate_by_model(&mut model, &target, &options, corrections)?;
    Ok(CompensateAnswer { found, methods: Vec::new() })
}

#[pymethods]
impl Lab {
    /// What to project so that the photo is the target.
    fn compensate<'py>(
        &self,
        py: Python<'py>,
        target: PyReadonlyArrayDyn<'py, f32>,
        question: CompensateQuestion,
    ) -> PyResult<Answered<'py>> {
        let (target, colors) = (arrays::image(&target)?, question.colors(py)?);
        let (is_symmetric, is_simulated) =
            self.with(py, |lab| Ok((lab.is_symmetric()?, lab.is_simulated()?)))?;
        let options = question.options(py, colors.is_none() && is_symmetric, is_simulated)?;
        let compare_methods = question.compare_methods;
        let request = CompensateRequest { target, options, colors, compare_methods };
        let answer = self.with(py, |lab| match &question.model {
            None => lab.compensate(&request),
            Some(folder) => by_model(lab, folder, &request, question.photos),
        })?;
        let fields = fields(py, &answer.found, &answer.methods)?;
        Ok((fields, Answer::new(Kept::Compensate(Box::new(request), Box::new(answer)))))
    }
}
