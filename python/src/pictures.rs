//! Pictures from files, and how alike two pictures are.

use std::path::PathBuf;

use krylux::analysis::similarity::{data_range, similarity};
use krylux::io::picture;
use numpy::{PyArrayDyn, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{self, Fields};
use crate::work;

/// The picture in a file.
#[pyfunction]
pub(crate) fn read_picture(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyArrayDyn<f32>>> {
    arrays::array(py, &work::detached(py, || picture::read(&path))?)
}

/// How alike two pictures of one shape are.
#[pyfunction]
pub(crate) fn compare<'py>(
    py: Python<'py>,
    image: PyReadonlyArrayDyn<'py, f32>,
    reference: PyReadonlyArrayDyn<'py, f32>,
    range: Option<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let (image, reference) = (arrays::image(&image)?, arrays::image(&reference)?);
    let range = range.unwrap_or_else(|| data_range(&reference));
    let found = work::detached(py, || similarity(&image, &reference, range))?;
    let fields = Fields::new(py);
    fields.put("rmse", found.rmse)?.put("relative_rmse", found.relative_rmse)?;
    fields.put("largest", found.largest)?.put("psnr", found.psnr)?;
    fields.put("ssim", found.ssim)?.put("range", found.range)?;
    Ok(fields.0)
}
