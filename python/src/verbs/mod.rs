//! The verbs of a laboratory: a question of Python as a request of krylux, and its answer as attributes.

pub(crate) mod asked;
mod plan;

pub(crate) use asked::{attributes, request, verbs};
