//! The Python package of krylux.
use pyo3::prelude::*;

/// The native part of the package.
#[pymodule]
fn _krylux(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}
