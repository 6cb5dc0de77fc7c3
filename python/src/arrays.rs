//! Arrays between NumPy and krylux. The Python side passes contiguous arrays that it has already checked.

use krylux::image::{Image, Resolution};
use numpy::ndarray::{ArrayD, IxDyn};
use numpy::{Element, IntoPyArray, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors;

/// Converts a C-contiguous array of `H×W` or `H×W×3` to an image.
pub(crate) fn image(array: &PyReadonlyArrayDyn<'_, f32>) -> PyResult<Image> {
    let py = array.py();
    let (height, width, channels) = match *array.shape() {
        [height, width] => (height, width, 1),
        [height, width, channels] => (height, width, channels),
        _ => return Err(errors::option(py, "pattern", "it is no picture", "give an array of H×W or H×W×3")),
    };
    let samples = array.as_slice()?.to_vec();
    Image::new(Resolution::new(width, height), channels, samples).map_err(|error| errors::raise(py, &error))
}

/// Converts an image to an array of `H×W`, or of `H×W×3` in colour.
pub(crate) fn array<'py>(py: Python<'py>, image: &Image) -> PyResult<Bound<'py, PyAny>> {
    shaped(py, &shape(image.resolution(), image.channels()), image.samples().to_vec())
}

/// The shape of a picture: `H×W`, or `H×W×3` in colour.
pub(crate) fn shape(size: Resolution, channels: usize) -> Vec<usize> {
    [size.height, size.width].into_iter().chain((channels > 1).then_some(channels)).collect()
}

/// Converts values to an array of this shape.
pub(crate) fn shaped<'py, T: Element>(
    py: Python<'py>,
    shape: &[usize],
    values: Vec<T>,
) -> PyResult<Bound<'py, PyAny>> {
    let array = ArrayD::from_shape_vec(IxDyn(shape), values);
    let array = array.map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(array.into_pyarray(py).into_any())
}

/// Converts vectors of equal length to an array with one vector in each row.
pub(crate) fn rows<'py>(py: Python<'py>, vectors: &[Vec<f64>], length: usize) -> PyResult<Bound<'py, PyAny>> {
    shaped(py, &[vectors.len(), length], vectors.concat())
}

/// Converts a record of krylux to the lists and dictionaries that its JSON describes.
pub(crate) fn record<'py>(py: Python<'py>, value: &impl serde::Serialize) -> PyResult<Bound<'py, PyAny>> {
    parsed(py, serde_json::to_string(value).map_err(|error| PyValueError::new_err(error.to_string()))?)
}

/// Parses a JSON text into a Python value.
pub(crate) fn parsed<'py>(py: Python<'py>, text: String) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (text,))
}

/// The attributes of an answer, by name.
pub(crate) struct Fields<'py>(pub(crate) Bound<'py, PyDict>);

impl<'py> Fields<'py> {
    pub(crate) fn new(py: Python<'py>) -> Self {
        Self(PyDict::new(py))
    }

    /// Adds a value of any type that has a Python type.
    pub(crate) fn put(&self, name: &str, value: impl IntoPyObject<'py>) -> PyResult<&Self> {
        self.0.set_item(name, value)?;
        Ok(self)
    }

    pub(crate) fn image(&self, name: &str, value: &Image) -> PyResult<&Self> {
        self.put(name, array(self.0.py(), value)?)
    }

    /// Adds interleaved samples as an array of `H×W`, or of `H×W×3` in colour.
    pub(crate) fn raster<T: Element>(
        &self,
        name: &str,
        samples: Vec<T>,
        size: Resolution,
        channels: usize,
    ) -> PyResult<&Self> {
        self.put(name, shaped(self.0.py(), &shape(size, channels), samples)?)
    }

    pub(crate) fn record(&self, name: &str, value: &impl serde::Serialize) -> PyResult<&Self> {
        self.put(name, record(self.0.py(), value)?)
    }
}
