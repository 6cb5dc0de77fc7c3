//! Eigenpairs, singular values, and linear systems with the matrix.

use krylux::image::Resolution;
use krylux::krylov::{
    Confirm, Eigs, EigsMethod, EigsOptions, HistoryRow, Method, PairStatus, Singular, SingularOptions,
    SolveOptions, Start, Which,
};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::Answered;
use crate::answers::{Answer, Kept};
use crate::arrays::{Fields, rows};
use crate::errors;
use crate::lab::Lab;
use crate::settings::one_of;

/// What is asked of eigenpairs.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct EigsQuestion {
    pub(crate) count: usize,
    pub(crate) which: String,
    pub(crate) photos: usize,
    pub(crate) tolerance: Option<f64>,
    pub(crate) method: String,
    pub(crate) block: usize,
    pub(crate) max_basis: Option<usize>,
    pub(crate) noise: f64,
    pub(crate) seed: u64,
    pub(crate) start: Option<Vec<f64>>,
    pub(crate) deflate: Vec<Vec<f64>>,
    pub(crate) confirm: Option<f64>,
}

impl EigsQuestion {
    /// The options of krylux.
    pub(crate) fn options(&self, py: Python<'_>) -> PyResult<EigsOptions> {
        let which = [
            ("la", Which::LargestAlgebraic),
            ("sa", Which::SmallestAlgebraic),
            ("lm", Which::LargestMagnitude),
            ("sm", Which::SmallestMagnitude),
            ("be", Which::BothEnds),
            ("li", Which::LargestImaginary),
        ];
        let methods = [
            ("lanczos", EigsMethod::Lanczos),
            ("block-lanczos", EigsMethod::BlockLanczos { block: self.block }),
            ("arnoldi", EigsMethod::Arnoldi),
            ("power", EigsMethod::Power),
        ];
        Ok(EigsOptions {
            count: self.count,
            which: one_of(py, "which", &self.which.to_lowercase(), &which)?,
            products: self.photos,
            tolerance: self.tolerance.unwrap_or(EigsOptions::default().tolerance),
            method: one_of(py, "method", &self.method, &methods)?,
            max_basis: self.max_basis,
            noise: self.noise,
            start: match &self.start {
                Some(start) => Start::Given(start.clone()),
                None => Start::Random { seed: self.seed },
            },
            deflate: self.deflate.clone(),
            confirm: self.confirm.map(confirm),
        })
    }
}

fn confirm(share: f64) -> Confirm {
    Confirm { share, ..Confirm::default() }
}

/// The attributes of eigenpairs: vectors are rows.
pub(crate) fn eigs_fields<'py>(py: Python<'py>, found: &Eigs, n: usize) -> PyResult<Bound<'py, PyDict>> {
    let fields = Fields::new(py);
    let padded = |vector: &Vec<f64>| if vector.is_empty() { vec![0.0; n] } else { vector.clone() };
    let imaginary: Vec<Vec<f64>> = found.imaginary_vectors.iter().map(padded).collect();
    fields.numbers("values", found.values.clone())?.numbers("imaginary", found.imaginary_values.clone())?;
    fields
        .put("vectors", rows(py, &found.vectors, n)?)?
        .put("imaginary_vectors", rows(py, &imaginary, n)?)?;
    fields.numbers("residuals", found.residuals.clone())?.numbers("bounds", found.bounds.clone())?;
    fields.numbers("standard_errors", found.standard_errors.clone())?;
    fields.numbers("gap_bounds", found.gap_bounds.clone())?;
    fields.put("statuses", statuses(&found.statuses))?.put("asymmetry", found.asymmetry)?;
    fields.put("photos", found.stats.products)?.put("status", found.stats.status.to_string())?;
    fields.put("completeness", found.completeness.to_string())?.put("confirming", found.confirming)?;
    fields.put("history", history(&found.history))?;
    Ok(fields.0)
}

/// The attributes of singular values; patterns and their photos are rows.
fn singular_fields<'py>(
    py: Python<'py>,
    found: &Singular,
    [photo, pattern]: [Resolution; 2],
) -> PyResult<Bound<'py, PyDict>> {
    let fields = Fields::new(py);
    fields.numbers("values", found.values.clone())?.numbers("residuals", found.residuals.clone())?;
    fields.numbers("standard_errors", found.standard_errors.clone())?;
    fields.stack("patterns", &found.right, pattern)?.stack("photographs", &found.left, photo)?;
    fields.put("statuses", statuses(&found.statuses))?.put("disagreement", found.disagreement)?;
    fields.put("completeness", found.completeness.to_string())?.put("confirming", found.confirming)?;
    fields.put("photos", found.stats.products)?.put("status", found.stats.status.to_string())?;
    fields.put("history", history(&found.history))?;
    Ok(fields.0)
}

/// The status of each pair in words.
fn statuses(of: &[PairStatus]) -> Vec<&'static str> {
    let in_words = |status: &PairStatus| match status {
        PairStatus::Converged => "converged",
        PairStatus::LimitedByNoise => "limited by noise",
        PairStatus::NotResolved => "not resolved",
    };
    of.iter().map(in_words).collect()
}

/// `(photos, values, residuals)` of each row.
fn history(rows: &[HistoryRow]) -> Vec<(usize, Vec<f64>, Vec<f64>)> {
    rows.iter().map(|row| (row.products, row.values.clone(), row.residuals.clone())).collect()
}

#[pymethods]
impl Lab {
    /// Eigenpairs of one part of the light.
    fn eigs<'py>(&self, py: Python<'py>, part: &str, question: EigsQuestion) -> PyResult<Answered<'py>> {
        let (part, options) = (crate::lab::part(py, part)?, question.options(py)?);
        let (found, n) = self.with(py, |lab| Ok((lab.eigs(part, &options)?, lab.projector_resolution())))?;
        let fields = eigs_fields(py, &found, n.pixels())?;
        Ok((fields, Answer::new(Kept::Eigs { found: Box::new(found), wanted: question.count, part })))
    }

    /// Singular values of one part of the light, with patterns and their photos. Without a tolerance the noise of the photos decides.
    fn singular<'py>(
        &self,
        py: Python<'py>,
        part: &str,
        question: (usize, usize, Option<f64>, u64, Option<f64>),
    ) -> PyResult<Answered<'py>> {
        let part = crate::lab::part(py, part)?;
        let (count, products, tolerance, seed, share) = question;
        let (found, sizes) = self.with(py, |lab| {
            let noise = match tolerance {
                Some(_) => 0.0,
                None => lab.product_noise(part)?.unwrap_or(0.0),
            };
            let base = SingularOptions::default();
            let tolerance = tolerance.unwrap_or(base.tolerance);
            let start = Start::Random { seed };
            let confirm = share.map(confirm);
            let found =
                lab.singular(part, &SingularOptions { count, products, tolerance, noise, start, confirm })?;
            Ok((found, [lab.resolution(), lab.projector_resolution()]))
        })?;
        let fields = singular_fields(py, &found, sizes)?;
        Ok((fields, Answer::new(Kept::Singular { found: Box::new(found), wanted: count })))
    }

    /// The solution of `A x = b`.
    fn solve<'py>(
        &self,
        py: Python<'py>,
        method: &str,
        rhs: PyReadonlyArray1<'py, f64>,
        question: (usize, f64, f64, f64),
    ) -> PyResult<Answered<'py>> {
        let (photos, rtol, lower, upper) = question;
        let method = Method::from_name(method).map_err(|error| errors::raise(py, &error))?;
        let options = SolveOptions { products: photos, rtol, lower, upper, ..SolveOptions::default() };
        let rhs = rhs.as_slice()?;
        let found = self.with(py, |lab| lab.solve(method, rhs, &options))?;
        let fields = crate::krylov::solution_fields(py, &found)?;
        Ok((fields, Answer::new(Kept::Solve { found: Box::new(found), method })))
    }
}
