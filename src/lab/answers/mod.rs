//! What can be saved: the answers of the Krylov methods and of the analyses, as a run's folder holds them.

mod audit;
mod compensation;
mod eigenpairs;
mod probing;
mod relighting;
mod segmentation;
mod separation;
mod solution;

use std::path::PathBuf;

pub use compensation::Compensated;
pub use eigenpairs::Eigenpairs;
pub use probing::ProbedLight;
pub use relighting::Relighting;
pub use segmentation::Scored;
pub use separation::Separated;
pub use solution::Solved;

use super::{Lab, RunFolder};
use crate::error::Result;

/// An answer that a laboratory can save ([`Lab::save`]).
pub trait Answer {
    /// The verb that asks for it: a part of the folder's default name.
    fn verb(&self) -> &'static str;

    /// Photos that it took, for the run's record.
    fn photos(&self) -> usize;

    /// One sentence that says what was found, for the run's record.
    fn sentence(&self, lab: &Lab) -> String;

    /// Whether the white photo of a rig is known, so that noise and drift can be recorded without a further photo.
    fn has_white(&self) -> bool {
        true
    }

    /// Writes arrays, pictures and the page; `seconds` is what the run took so far. Returns the files' names, relative to the folder.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file; those of the photos that the page shows.
    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>>;
}

/// A saved answer.
#[derive(Clone, Debug)]
pub struct Saved {
    /// The folder.
    pub folder: PathBuf,
    /// `report.html` in it.
    pub report: PathBuf,
    /// The sentence of the run's record.
    pub message: String,
    /// Seconds that the run took.
    pub seconds: f64,
}
