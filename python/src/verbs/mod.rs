//! The verbs of a laboratory: a question of Python as a request of krylux, and its answer as attributes.

mod asked;
mod eigs;
mod light;
mod plan;
mod relight;
mod separate;

use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::answers::Answer;

pub(crate) use asked::verbs;
pub(crate) use eigs::{EigsQuestion, eigs_fields};

/// The attributes of an answer, and the answer itself, to be saved.
pub(crate) type Answered<'py> = (Bound<'py, PyDict>, Answer);
