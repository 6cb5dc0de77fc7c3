//! Direct and global light.

use krylux::analysis::probe::default_sigma;
use krylux::analysis::separate::{NearFarOptions, SeparateBy};
use krylux::image::Resolution;
use krylux::lab::{Lab as Laboratory, SeparateRequest, Separated, SourceKind};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::Answered;
use crate::answers::{Answer, Kept};
use crate::arrays::Fields;
use crate::lab::Lab;
use crate::settings::one_of;

/// What is asked of a separation.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct SeparateQuestion {
    by: Option<String>,
    square: usize,
    shifts: usize,
    period: f64,
    phases: usize,
    photos: usize,
    sigma: Option<f64>,
    probes: Option<usize>,
    bounces: bool,
    compare: bool,
    max_error: Option<f64>,
}

impl SeparateQuestion {
    /// The method; `None` for what a simulator knows.
    fn by(&self, py: Python<'_>) -> PyResult<Option<Option<SeparateBy>>> {
        let methods = [
            ("exact", None),
            ("checkerboards", Some(SeparateBy::Checkerboards { square: self.square, shifts: self.shifts })),
            ("sinusoids", Some(SeparateBy::Sinusoids { period: self.period, phases: self.phases })),
            ("codes", Some(SeparateBy::Codes { photos: self.photos })),
            ("random", Some(SeparateBy::Random { photos: self.photos })),
            ("capture", Some(SeparateBy::Capture { photos: self.photos })),
        ];
        self.by.as_ref().map(|name| one_of(py, "by", name, &methods)).transpose()
    }

    fn request(&self, by: Option<Option<SeparateBy>>, lab: &Laboratory) -> SeparateRequest {
        let is_scene = lab.kind() == SourceKind::Scene;
        let shifted = SeparateBy::Checkerboards { square: self.square, shifts: self.shifts };
        SeparateRequest {
            by: by.unwrap_or(if is_scene { None } else { Some(shifted) }),
            bounces: self.bounces,
            near_far: Some(NearFarOptions {
                sigma: self.sigma.unwrap_or_else(|| default_sigma(lab.resolution())),
                photos: self.probes.unwrap_or(if is_scene { 100 } else { 0 }),
                seed: lab.seed(),
            }),
            compare: self.compare.then_some(self.period),
            max_error: self.max_error,
        }
    }
}

/// The attributes of a separation.
fn fields<'py>(py: Python<'py>, found: &Separated, size: Resolution) -> PyResult<Bound<'py, PyDict>> {
    let fields = Fields::new(py);
    fields.planes("direct", &found.direct, size)?.planes("global_", &found.global, size)?;
    for (name, planes) in [
        ("standard_error", &found.standard_error),
        ("global_error", &found.global_error),
        ("truth", &found.truth),
    ] {
        match planes {
            Some(planes) => fields.planes(name, planes, size)?,
            None => fields.put(name, py.None())?,
        };
    }
    let [second, rest] = match &found.bounces {
        Some([second, rest]) => [Some(second), Some(rest)],
        None => [None, None],
    };
    let [near, far] = match &found.near_far {
        Some(of) => [Some(&of.near), Some(&of.far)],
        None => [None, None],
    };
    for (name, planes) in [("second", second), ("rest", rest), ("near", near), ("far", far)] {
        match planes {
            Some(planes) => fields.planes(name, planes, size)?,
            None => fields.put(name, py.None())?,
        };
    }
    fields.put("method", found.name)?.put("photos", found.all_photos())?.put("error", found.error())?;
    fields.put("near_noise", found.near_far.as_ref().and_then(|of| of.noise.value()))?;
    fields.put("near_error", found.near_far.as_ref().and_then(|of| of.error))?;
    fields.record("comparison", &found.comparison)?;
    fields.put("status", found.sentence())?.put("good", found.is_good())?;
    Ok(fields.0)
}

#[pymethods]
impl Lab {
    /// Direct and global light under white.
    fn separate<'py>(&self, py: Python<'py>, question: SeparateQuestion) -> PyResult<Answered<'py>> {
        let by = question.by(py)?;
        let (found, size) = self.with(py, |lab| {
            let request = question.request(by, lab);
            Ok((lab.separate(&request)?, lab.resolution()))
        })?;
        Ok((fields(py, &found, size)?, Answer::new(Kept::Separate(Box::new(found)))))
    }
}
