//! A sparse matrix whose arrays NumPy reads without a copy.

use std::path::Path;

use krylux::io::npy::Array;
use krylux::io::sparse::{MatrixFile, from_array};
use krylux::sparse::Csr;
use numpy::ndarray::ArrayView1;
use numpy::{Element, PyArray1, PyReadonlyArray1, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::errors;

/// A matrix. It keeps its arrays alive as long as NumPy has views of them.
#[pyclass(frozen, weakref, module = "krylux._krylux", name = "Matrix")]
pub(crate) struct Matrix(pub(crate) Csr);

#[pymethods]
impl Matrix {
    /// The numbers of rows and columns.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.0.rows(), self.0.cols())
    }

    /// The arrays `(data, indices, indptr)` of SciPy's format. The first two are read-only views, and `indptr` is a new array. For a matrix
    /// of 2³¹ entries or more, `indptr` is 64 bits wide. SciPy then also widens `indices`, by a copy.
    fn arrays<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, matrix) = (slf.py(), &slf.get().0);
        // Columns can be read as signed numbers, since they are below 2³¹. SciPy has no matrices with unsigned indices.
        let columns: &[i32] = bytemuck::cast_slice(matrix.columns());
        let starts = matrix.row_start().iter();
        let starts = match i32::try_from(matrix.weights().len().max(matrix.cols())) {
            Ok(_) => PyArray1::from_iter(py, starts.map(|&start| start as i32)).into_any(),
            Err(_) => PyArray1::from_iter(py, starts.map(|&start| start as i64)).into_any(),
        };
        Ok((view(slf, matrix.weights())?, view(slf, columns)?, starts))
    }
}

/// A NumPy array on memory that `owner` keeps alive.
fn view<'py, T: Element>(owner: &Bound<'py, Matrix>, values: &[T]) -> PyResult<Bound<'py, PyAny>> {
    let values = ArrayView1::from(values);
    #[allow(
        unsafe_code,
        reason = "the values are in the owner, which is frozen, never changes them, and lives as long as the array"
    )]
    // SAFETY: `values` is borrowed from the owner's own vectors, which are neither moved nor changed while the owner lives.
    let array = unsafe { PyArray1::borrow_from_array(&values, owner.clone().into_any()) };
    array.call_method1("setflags", (false,))?;
    Ok(array.into_any())
}

/// A matrix of SciPy: the number of columns, the data, the indices and the row starts.
type Arrays<'py> =
    (usize, PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, i64>, PyReadonlyArray1<'py, i64>);

/// Converts a matrix of SciPy. Its arrays are copied once.
pub(crate) fn csr(py: Python<'_>, (cols, data, indices, indptr): &Arrays<'_>) -> PyResult<Csr> {
    let refused = |_| errors::option(py, "source", "its columns exceed 32 bits", "give a smaller matrix");
    let row_start = indptr.as_slice()?.iter().map(|&start| usize::try_from(start)).collect::<Result<_, _>>();
    let columns = indices.as_slice()?.iter().map(|&column| u32::try_from(column)).collect::<Result<_, _>>();
    let (row_start, columns) = (row_start.map_err(refused)?, columns.map_err(refused)?);
    Csr::new(*cols, row_start, columns, data.as_slice()?.to_vec()).map_err(|error| errors::raise(py, &error))
}

/// Converts a C-contiguous array, whose number of axes says what it is. `name` is used in messages.
pub(crate) fn dense(name: &Path, array: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<MatrixFile> {
    let (shape, values) = (array.shape().to_vec(), array.as_slice()?.to_vec());
    from_array(name, &Array { shape, values }).map_err(|error| errors::raise(array.py(), &error))
}
