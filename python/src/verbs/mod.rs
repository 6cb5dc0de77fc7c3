//! The verbs of a laboratory: a question of Python as a request of krylux, and its answer as attributes.

pub(crate) mod asked;
mod light;
mod plan;
mod relight;
mod solve;

use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::answers::Answer;

pub(crate) use asked::{attributes, request, verbs};

/// The attributes of an answer, and the answer itself, to be saved.
pub(crate) type Answered<'py> = (Bound<'py, PyDict>, Answer);
