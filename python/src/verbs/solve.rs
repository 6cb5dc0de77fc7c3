//! Linear systems with the matrix.

use krylux::krylov::{Method, SolveOptions};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;

use super::Answered;
use crate::answers::{Answer, Kept};
use crate::errors;
use crate::lab::Lab;

#[pymethods]
impl Lab {
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
