//! Arrays between NumPy and krylux. The Python side hands over contiguous arrays that it has checked.

use krylux::image::{Image, Resolution};
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArrayDyn, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors;

/// The image of a C-contiguous array of `H×W` or `H×W×3`.
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

/// An image as an array of `H×W`, or of `H×W×3` in colour.
pub(crate) fn array<'py>(py: Python<'py>, image: &Image) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let Resolution { width, height } = image.resolution();
    shaped(py, image.samples().to_vec(), height, width, image.channels())
}

fn shaped<'py, T: numpy::Element>(
    py: Python<'py>,
    samples: Vec<T>,
    height: usize,
    width: usize,
    channels: usize,
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let of_another_size = |error| pyo3::exceptions::PyValueError::new_err(format!("{error}"));
    if channels == 1 {
        let array = Array2::from_shape_vec((height, width), samples).map_err(of_another_size)?;
        return Ok(array.into_dyn().into_pyarray(py));
    }
    let array = Array3::from_shape_vec((height, width, channels), samples).map_err(of_another_size)?;
    Ok(array.into_dyn().into_pyarray(py))
}

/// Vectors of one length as an array with one vector in each row.
pub(crate) fn rows<'py>(py: Python<'py>, vectors: &[Vec<f64>], length: usize) -> PyResult<Bound<'py, PyAny>> {
    let made = Array2::from_shape_vec((vectors.len(), length), vectors.concat());
    let array = made.map_err(|error| pyo3::exceptions::PyValueError::new_err(format!("{error}")))?;
    Ok(array.into_pyarray(py).into_any())
}

/// The attributes of an answer, by name.
pub(crate) struct Fields<'py>(pub(crate) Bound<'py, PyDict>);

impl<'py> Fields<'py> {
    pub(crate) fn new(py: Python<'py>) -> Self {
        Self(PyDict::new(py))
    }

    /// Anything that Python has a type for.
    pub(crate) fn put(&self, name: &str, value: impl IntoPyObject<'py>) -> PyResult<&Self> {
        self.0.set_item(name, value)?;
        Ok(self)
    }

    /// Numbers as an array of one dimension.
    pub(crate) fn numbers<T: numpy::Element>(&self, name: &str, values: Vec<T>) -> PyResult<&Self> {
        self.put(name, values.into_pyarray(self.0.py()))
    }

    pub(crate) fn image(&self, name: &str, value: &Image) -> PyResult<&Self> {
        self.put(name, array(self.0.py(), value)?)
    }

    /// One value for each pixel as an array of `H×W`.
    pub(crate) fn raster<T: numpy::Element>(
        &self,
        name: &str,
        values: Vec<T>,
        size: Resolution,
    ) -> PyResult<&Self> {
        self.put(name, shaped(self.0.py(), values, size.height, size.width, 1)?)
    }

    /// Interleaved samples as an array of `H×W`, or of `H×W×3` in colour.
    pub(crate) fn raster_of<T: numpy::Element>(
        &self,
        name: &str,
        samples: Vec<T>,
        size: Resolution,
        channels: usize,
    ) -> PyResult<&Self> {
        self.put(name, shaped(self.0.py(), samples, size.height, size.width, channels)?)
    }

    /// Vectors of one value for each pixel as an array of `k×H×W`.
    pub(crate) fn stack(&self, name: &str, vectors: &[Vec<f64>], size: Resolution) -> PyResult<&Self> {
        let stacked = Array3::from_shape_vec((vectors.len(), size.height, size.width), vectors.concat());
        let array = stacked.map_err(|error| pyo3::exceptions::PyValueError::new_err(format!("{error}")))?;
        self.put(name, array.into_pyarray(self.0.py()))
    }

    /// A record of krylux, as the lists and dictionaries that its JSON describes.
    pub(crate) fn record(&self, name: &str, value: &impl serde::Serialize) -> PyResult<&Self> {
        let text = serde_json::to_string(value)
            .map_err(|error| pyo3::exceptions::PyValueError::new_err(error.to_string()))?;
        self.json(name, text)
    }

    /// A value as JSON.
    pub(crate) fn json(&self, name: &str, text: String) -> PyResult<&Self> {
        let value = self.0.py().import("json")?.call_method1("loads", (text,))?;
        self.put(name, value)
    }
}
