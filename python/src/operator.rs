//! A part of a laboratory's light transport, as an operator for products with NumPy vectors.

use krylux::lab::LabOperator;
use krylux::operator::{Adjoint, Operator as _, Symmetry};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::arrays::shaped;
use crate::errors;
use crate::work::Held;

/// One part and channel of a light transport matrix.
#[pyclass(frozen, module = "krylux._krylux", name = "Operator")]
pub(crate) struct Operator {
    operator: Held<LabOperator>,
    #[pyo3(get)]
    shape: (usize, usize),
    #[pyo3(get)]
    is_symmetric: bool,
}

impl Operator {
    pub(crate) fn new(operator: LabOperator) -> Self {
        let shape = (operator.rows(), operator.cols());
        let is_symmetric = operator.symmetry() == Symmetry::Symmetric;
        Self { operator: Held::new(operator), shape, is_symmetric }
    }

    /// The length of products.
    fn length(&self, adjoint: bool) -> usize {
        if adjoint { self.shape.1 } else { self.shape.0 }
    }
}

/// Refuses NaN and infinite entries. The same check in NumPy would take about a hundredth of the time of a product.
fn check_finite(py: Python<'_>, argument: &str, values: &[f64]) -> PyResult<()> {
    // The product 0 v is 0 for a finite number v, and NaN otherwise. A NaN stays in the sum. Eight independent sums can be vectorized.
    let (chunks, rest) = values.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for chunk in chunks {
        sums.iter_mut().zip(chunk).for_each(|(sum, value)| *sum += 0.0 * value);
    }
    if sums.iter().all(|sum| *sum == 0.0) && rest.iter().all(|value| value.is_finite()) {
        return Ok(());
    }
    let wrong = values.iter().filter(|value| !value.is_finite()).count();
    let fault = format!("{wrong} of its values are NaN or infinite");
    Err(errors::option(py, argument, &fault, "replace them by finite numbers"))
}

#[pymethods]
impl Operator {
    /// The number of products so far, including products with the transpose.
    fn photos(&self, py: Python<'_>) -> PyResult<usize> {
        self.operator.with(py, |operator| Ok(operator.photos()))
    }

    /// The standard errors of the products of the last call.
    fn standard_errors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(self.operator.with(py, |operator| Ok(operator.standard_errors()))?.into_pyarray(py))
    }

    /// The product `A x`, or `Aᵀ x`.
    fn product<'py>(
        &self,
        x: PyReadonlyArray1<'py, f64>,
        adjoint: bool,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let py = x.py();
        // Only a vector that is not contiguous is copied.
        let copied = if x.is_contiguous() { Vec::new() } else { x.as_array().to_vec() };
        let x = if copied.is_empty() { x.as_slice()? } else { &copied };
        check_finite(py, if adjoint { "y" } else { "x" }, x)?;
        let mut y = vec![0.0; self.length(adjoint)];
        self.operator.with(py, |operator| match adjoint {
            true => operator.apply_adjoint(x, &mut y),
            false => operator.apply(x, &mut y),
        })?;
        Ok(y.into_pyarray(py))
    }

    /// The shortest time of `repeats` products `A x` in Rust, in seconds. Each product makes and frees a vector. The comparison with
    /// Python, which makes and frees an array instead, shows the time that Python adds.
    fn seconds(&self, x: PyReadonlyArray1<'_, f64>, repeats: usize) -> PyResult<f64> {
        let (py, x) = (x.py(), x.as_slice()?);
        self.operator.with(py, |operator| {
            let mut least = f64::INFINITY;
            for _ in 0..repeats {
                let start = std::time::Instant::now();
                let mut y = vec![0.0; self.shape.0];
                operator.apply(x, &mut y)?;
                drop(std::hint::black_box(y));
                least = least.min(start.elapsed().as_secs_f64());
            }
            Ok(least)
        })
    }

    /// The products with the rows of `xs`, as rows. They are computed as one block.
    fn products<'py>(&self, xs: PyReadonlyArray2<'py, f64>, adjoint: bool) -> PyResult<Bound<'py, PyAny>> {
        let (py, count, length) = (xs.py(), xs.shape()[0], xs.shape()[1]);
        check_finite(py, if adjoint { "Y" } else { "X" }, xs.as_slice()?)?;
        let to = self.length(adjoint);
        let mut values = vec![0.0; count * to];
        let xs: Vec<&[f64]> = xs.as_slice()?.chunks(length.max(1)).collect();
        let mut ys: Vec<&mut [f64]> = values.chunks_mut(to.max(1)).collect();
        self.operator.with(py, |operator| match adjoint {
            true => operator.apply_adjoint_block(&xs, &mut ys),
            false => operator.apply_block(&xs, &mut ys),
        })?;
        shaped(py, &[count, to], values)
    }
}
