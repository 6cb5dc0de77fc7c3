//! krylux's own solvers, applied to operators written in Python.

use std::collections::BTreeMap;
use std::sync::Arc;

use krylux::krylov::{
    Diagonal, EigsOptions, LowRankOptions, Method, Preconditioner, Side, SolveOptions, Start,
    UserPreconditioner, eigs, hutch_plus_plus, hutchinson, randomized_svd, solve_adjoint,
};
use krylux::observer::Observer;
use krylux::operator::{Adjoint, Operator, Symmetry};
use krylux::verbs::eigs::Eigenpairs;
use krylux::verbs::{Eigs, Solved};
use krylux::{Error, Result};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::rows;
use crate::settings::{chosen, item, one_of};
use crate::verbs;
use crate::watch::Watcher;
use crate::{errors, work};

/// An operator whose products are computed in Python. `product(rows of vectors, adjoint)` returns the products as rows.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Called {
    product: Py<PyAny>,
    shape: (usize, usize),
    #[pyo3(item("symmetric"))]
    is_symmetric: bool,
    block: usize,
    #[pyo3(item("progress"))]
    watcher: Watcher,
}

impl Called {
    fn multiply(&self, xs: &[&[f64]], ys: &mut [&mut [f64]], adjoint: bool) -> Result<()> {
        let (from, to) = if adjoint { self.shape } else { (self.shape.1, self.shape.0) };
        for x in xs {
            Error::check_size("entries of the vector to multiply", from, x.len())?;
        }
        let values = work::in_python(|py| {
            py.check_signals()?;
            let vectors: Vec<Vec<f64>> = xs.iter().map(|x| x.to_vec()).collect();
            let answer = self.product.call1(py, (rows(py, &vectors, from)?, adjoint))?;
            let answer: PyReadonlyArray2<'_, f64> = answer.extract(py)?;
            if answer.shape() != [xs.len(), to] {
                let fault = format!("its product has the shape {:?}", answer.shape());
                return Err(errors::option(py, "A", &fault, &format!("return {to} numbers for each vector")));
            }
            Ok(answer.as_slice()?.to_vec())
        })?;
        ys.iter_mut().zip(values.chunks(to.max(1))).for_each(|(y, value)| y.copy_from_slice(value));
        Ok(())
    }
}

impl Operator for Called {
    fn rows(&self) -> usize {
        self.shape.0
    }

    fn cols(&self) -> usize {
        self.shape.1
    }

    fn symmetry(&self) -> Symmetry {
        if self.is_symmetric { Symmetry::Symmetric } else { Symmetry::General }
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.multiply(xs, ys, false)
    }

    fn block_size(&self) -> usize {
        self.block
    }

    fn observer(&self) -> &dyn Observer {
        &self.watcher
    }
}

impl Adjoint for Called {
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.multiply(ys, xs, !self.is_symmetric)
    }
}

/// The options of a solver.
fn options(question: &Bound<'_, PyAny>) -> PyResult<SolveOptions> {
    let py = question.py();
    let preconditioner: Option<Arc<dyn Preconditioner>> =
        match (item(question, "divide_by")?, item(question, "preconditioner")?) {
            (Some(entries), _) => {
                Some(Arc::new(Diagonal::new(entries).map_err(|error| errors::raise(py, &error))?))
            }
            (None, Some(product)) => Some(Arc::new(called_preconditioner(product))),
            (None, None) => None,
        };
    Ok(SolveOptions {
        products: item(question, "products")?,
        rtol: item(question, "rtol")?,
        atol: item(question, "atol")?,
        noise: item(question, "noise")?,
        x0: item(question, "x0")?,
        preconditioner,
        side: chosen(question, "side", &[("right", Side::Right), ("left", Side::Left)])?,
        restart: item(question, "restart")?,
        lower: item(question, "lower")?,
        upper: item(question, "upper")?,
        diagonal: item(question, "diagonal")?,
        surrogate: None,
    })
}

/// A preconditioner `M⁻¹` computed by a Python function. It is assumed to be positive definite.
fn called_preconditioner(product: Py<PyAny>) -> UserPreconditioner {
    UserPreconditioner::closure(true, move |r, z| {
        work::in_python(|py| {
            let answer = product.call1(py, (r.to_vec().into_pyarray(py),))?;
            let answer: PyReadonlyArray1<'_, f64> = answer.extract(py)?;
            if answer.len() != z.len() {
                let fault = format!("its product has {} entries", answer.len());
                return Err(errors::option(py, "M", &fault, &format!("return {}", z.len())));
            }
            z.copy_from_slice(answer.as_slice()?);
            Ok(())
        })
    })
}

/// Solves `A x = b`. Returns the arrays and the facts of the answer.
#[pyfunction]
pub(crate) fn solve<'py>(
    py: Python<'py>,
    method: &str,
    mut operator: Called,
    b: PyReadonlyArray1<'py, f64>,
    question: Bound<'py, PyAny>,
) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>)> {
    let method = Method::from_name(method).map_err(|error| errors::raise(py, &error))?;
    let options = options(&question)?;
    let b = b.as_slice()?;
    let found = work::detached(py, || solve_adjoint(method, &mut operator, b, &options))?;
    verbs::attributes(py, &Solved { found, method, file: None })
}

/// Arguments of [`eigenpairs`] that a laboratory would supply itself: seed, noise, first vector, known vectors.
type Beside = (u64, f64, Option<Vec<f64>>, Vec<Vec<f64>>);

/// Finds eigenpairs of a square operator. Returns the arrays and the facts of the answer.
#[pyfunction(name = "eigs")]
pub(crate) fn eigenpairs<'py>(
    py: Python<'py>,
    mut operator: Called,
    asked: BTreeMap<String, String>,
    beside: Beside,
) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>)> {
    let request: Eigs = verbs::request(py, asked)?;
    let (seed, noise, start, deflate) = beside;
    let mut options = EigsOptions { noise, deflate, ..request.options(seed, None) };
    if let Some(start) = start {
        options.start = Start::Given(start);
    }
    let found = work::detached(py, || eigs(&mut operator, &options))?;
    verbs::attributes(py, &Eigenpairs::new(found, &request, None))
}

/// Estimates the trace of a square operator. Returns the trace, its standard error, and the number of products.
#[pyfunction]
pub(crate) fn trace(
    py: Python<'_>,
    mut operator: Called,
    products: usize,
    seed: u64,
    method: &str,
) -> PyResult<(f64, f64, usize)> {
    let is_plus = one_of(py, "method", method, &[("hutch++", true), ("hutchinson", false)])?;
    let found = work::detached(py, || match is_plus {
        true => hutch_plus_plus(&mut operator, products, seed),
        false => hutchinson(&mut operator, products, seed),
    })?;
    Ok((found.value, found.standard_error, found.products))
}

/// The largest singular values, with their vectors as rows, from products with random vectors.
#[pyfunction]
#[allow(clippy::type_complexity, reason = "the three arrays of a singular value decomposition")]
pub(crate) fn svd<'py>(
    py: Python<'py>,
    mut operator: Called,
    question: (usize, usize, usize, u64),
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyArray1<f64>>, Bound<'py, PyAny>)> {
    let (rank, oversampling, power, seed) = question;
    let options = LowRankOptions { rank, oversampling, power, seed, ..LowRankOptions::default() };
    let found = work::detached(py, || randomized_svd(&mut operator, &options))?;
    let (m, n) = (operator.rows(), operator.cols());
    Ok((rows(py, &found.left, m)?, found.values.into_pyarray(py), rows(py, &found.right, n)?))
}
