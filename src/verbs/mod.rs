//! The questions to a laboratory. Each folder holds one question: its request, its execution, its answer, and its page.
//!
//! A [request](crate::lab::Verb) is a struct with documented fields, declared once. The fields become the options of the command line, the
//! keyword arguments in Python and the record in `run.json`. An [answer](crate::lab::Answer) consists of named arrays and named facts. They
//! become files, summary, attributes in Python and lines on the terminal.

pub mod compensate;
pub mod eigs;
pub mod matrix;
pub mod options;
pub mod pattern;
pub mod plan;
pub mod relight;
pub mod rig;
pub mod segment;
pub mod separate;
#[cfg(test)]
mod tests_of_runs;
#[cfg(test)]
mod tests_of_verification;

use serde::Serialize;
use serde::de::DeserializeOwned;

pub use compensate::{Compensate, Compensated};
pub use eigs::{Eigs, Spectrum};
pub use options::{from_json, signature};
pub use plan::Plan;
pub use relight::{Relight, Relighting};
pub use segment::{Segment, Segmented};
pub use separate::{Separate, Separated};

/// A request that is declared once, for the command line and for keyword arguments.
pub trait Request: crate::lab::Verb + clap::Args + Serialize + DeserializeOwned + Default {}

impl<V: crate::lab::Verb + clap::Args + Serialize + DeserializeOwned + Default> Request for V {}
