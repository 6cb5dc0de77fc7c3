//! Probing, and the audit of a source.

use krylux::analysis::Probing;
use krylux::analysis::probe::default_sigma;
use krylux::bench::audit::AuditOptions;
use krylux::image::Resolution;
use pyo3::prelude::*;

use super::Answered;
use crate::answers::{Answer, Kept};
use crate::arrays::Fields;
use crate::lab::Lab;
use crate::settings::one_of;

#[pymethods]
impl Lab {
    /// A photo of which only some light paths are let through.
    fn probe<'py>(
        &self,
        py: Python<'py>,
        paths: &str,
        sigma: Option<f64>,
        photos: usize,
    ) -> PyResult<Answered<'py>> {
        let width = self.with(py, |lab| Ok(default_sigma(lab.resolution())))?;
        let sigma = sigma.unwrap_or(width);
        let probing = one_of(
            py,
            "paths",
            paths,
            &[
                ("direct", Probing::Direct),
                ("indirect", Probing::Indirect),
                ("near", Probing::Near { sigma }),
                ("far", Probing::Far { sigma }),
                ("near-indirect", Probing::NearIndirect { sigma }),
            ],
        )?;
        let (found, size) = self.with(py, |lab| Ok((lab.probe(probing, photos)?, lab.resolution())))?;
        let fields = Fields::new(py);
        fields.planes("values", &found.values, size)?;
        fields.planes("standard_errors", &found.standard_errors, size)?;
        match &found.truth {
            Some(truth) => fields.planes("truth", truth, size)?,
            None => fields.put("truth", py.None())?,
        };
        fields.put("paths", paths)?.put("photos", found.photos)?.put("status", found.sentence())?;
        fields.put("noise", found.noise().value())?.put("error", found.error())?;
        Ok((fields.0, Answer::new(Kept::Probe(found))))
    }

    /// Whether the source is a linear, symmetric operator.
    fn audit<'py>(
        &self,
        py: Python<'py>,
        patterns: usize,
        tolerance: f64,
        asymmetry: f64,
    ) -> PyResult<Answered<'py>> {
        let found = self.with(py, |lab| {
            let options =
                AuditOptions { patterns, tolerance, asymmetry, seed: lab.seed(), ..Default::default() };
            lab.audit(&options)
        })?;
        let fields = Fields::new(py);
        fields.record("checks", &found.checks)?;
        fields.put("status", found.sentence())?.put("photos", found.photos)?;
        let size = found.resolution;
        let share = &found.direct_share;
        for (name, values) in
            [("white", &found.white), ("direct_share", share), ("additivity", &found.additivity)]
        {
            match is_of(values, size) {
                true => fields.raster(name, values.clone(), size)?,
                false => fields.put(name, py.None())?,
            };
        }
        Ok((fields.0, Answer::new(Kept::Audit(found))))
    }
}

/// Whether there is a value for each pixel: what an audit could not take is empty.
fn is_of(values: &[f64], size: Resolution) -> bool {
    !values.is_empty() && values.len() == size.pixels()
}
