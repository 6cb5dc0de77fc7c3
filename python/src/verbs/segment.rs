//! Segmentation.

use krylux::analysis::segment::{DirectLight, SegmentRequest, Segmented};
use krylux::analysis::{Cut, DirectMethod, SegmentOptions};
use krylux::image::Resolution;
use krylux::krylov::Confirm;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::Answered;
use crate::answers::{Answer, Kept};
use crate::arrays::{Fields, rows};
use crate::lab::Lab;
use crate::settings::one_of;

/// What is asked of a segmentation.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(super) struct SegmentQuestion {
    photos: usize,
    groups: Vec<usize>,
    starts: Option<usize>,
    eigenvectors: usize,
    cut: String,
    mu: f64,
    mask_below: f64,
    pub(super) direct: String,
    direct_photos: usize,
    direct_square: usize,
    blur: Option<f64>,
    features: Vec<(usize, usize)>,
    evidence: bool,
    confirm: Option<f64>,
    seed: u64,
}

impl SegmentQuestion {
    pub(super) fn request(self, py: Python<'_>) -> PyResult<SegmentRequest> {
        let shifts = self.direct_photos.isqrt();
        let direct = [
            ("source", DirectLight::Source),
            ("keep", DirectLight::Keep),
            ("estimator", DirectLight::Measured(DirectMethod::Estimator { photos: self.direct_photos })),
            (
                "patterns",
                DirectLight::Measured(DirectMethod::Checkerboards { square: self.direct_square, shifts }),
            ),
        ];
        let direct = one_of(py, "direct", &self.direct, &direct)?;
        let is_patterns = self.direct == "patterns";
        if is_patterns && (shifts < 2 || shifts * shifts != self.direct_photos) {
            let fault = format!("{} photos of shifted squares", self.direct_photos);
            let help = "give a square number from 4 on: 4, 9, 16, 25";
            return Err(crate::errors::option(py, "direct_photos", &fault, help));
        }
        Ok(SegmentRequest {
            options: SegmentOptions {
                photos: self.photos,
                groups: self.groups,
                eigenvectors: self.eigenvectors,
                starts: self.starts,
                cut: one_of(
                    py,
                    "cut",
                    &self.cut,
                    &[("normalized", Cut::Normalized), ("average", Cut::Average)],
                )?,
                mu: self.mu,
                mask_below: self.mask_below,
                confirm: self.confirm.map(|share| Confirm { share, ..Confirm::default() }),
                seed: self.seed,
                ..SegmentOptions::default()
            },
            direct,
            blur: self.blur,
            features: self.features,
            evidence: self.evidence,
        })
    }
}

/// The attributes of a segmentation.
fn fields<'py>(
    py: Python<'py>,
    found: &Segmented,
    scores: &[(usize, f64)],
    size: Resolution,
) -> PyResult<Bound<'py, PyDict>> {
    let (fields, of) = (Fields::new(py), &found.segmentation);
    let labels = Fields::new(py);
    let by_count = PyDict::new(py);
    for (groups, values) in &of.labels {
        labels.raster("labels", values.clone(), size)?;
        by_count.set_item(groups, labels.0.get_item("labels")?)?;
    }
    let confidence = PyDict::new(py);
    for (groups, values) in &of.confidence {
        let one = Fields::new(py);
        one.raster("confidence", values.clone(), size)?;
        confidence.set_item(groups, one.0.get_item("confidence")?)?;
    }
    fields.put("confidence", confidence)?;
    fields.put("labels", by_count)?.numbers("eigenvalues", of.eigenvalues.clone())?;
    fields.numbers("residuals", of.residuals.clone())?.stack("eigenvectors", &of.eigenvectors, size)?;
    fields.numbers("within", of.embedding.within.clone())?.raster("degree", of.degree.clone(), size)?;
    fields.raster("weights", of.weights.clone(), size)?.raster("mask", of.mask.clone(), size)?;
    fields.record("regions", &of.regions)?.put("regions_sentence", of.regions.sentence())?;
    fields.put("status", of.status.clone())?.put("photos", found.photos())?;
    let history = of.history.iter().map(|row| (row.products, row.values.clone(), row.residuals.clone()));
    fields.put("history", history.collect::<Vec<_>>())?;
    let scored = PyDict::new(py);
    for (groups, score) in scores {
        scored.set_item(groups, score)?;
    }
    fields.put("rand_index", scored)?;
    let evidence = PyDict::new(py);
    for one in &found.evidence {
        let about = Fields::new(py);
        about.stack("photos", &one.photos, size)?.put("cut", one.cut())?;
        about.put("exchange", rows(py, &one.exchange, one.groups)?)?;
        evidence.set_item(one.groups, about.0)?;
    }
    fields.put("evidence", evidence)?;
    match &found.direct {
        Some(direct) => fields.raster("direct", direct.direct.clone(), size)?,
        None => fields.put("direct", py.None())?,
    };
    match &found.features {
        None => fields.put("features", py.None())?,
        Some(view) => {
            let about = Fields::new(py);
            let length = view.coordinates.first().map_or(0, Vec::len);
            about.put("pixels", view.pixels.clone())?;
            about.put("coordinates", rows(py, &view.coordinates, length)?)?;
            about.put("distances", rows(py, &view.distances, view.pixels.len())?)?;
            fields.put("features", about.0)?
        }
    };
    Ok(fields.0)
}

#[pymethods]
impl Lab {
    /// Groups of pixels that exchange light.
    fn segment<'py>(&self, py: Python<'py>, question: SegmentQuestion) -> PyResult<Answered<'py>> {
        let request = question.request(py)?;
        let (found, truth, scores, size) = self.with(py, |lab| {
            let found = lab.segment(&request)?;
            let truth = lab.known_truth()?;
            let scores = truth.as_ref().map(|truth| truth.scores(&found.segmentation)).transpose()?;
            Ok((found, truth, scores.unwrap_or_default(), lab.resolution()))
        })?;
        let fields = fields(py, &found, &scores, size)?;
        Ok((
            fields,
            Answer::new(Kept::Segment { request: Box::new(request), found: Box::new(found), truth, scores }),
        ))
    }
}
