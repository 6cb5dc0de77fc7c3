//! Answers of a laboratory, kept until they are saved.

use std::sync::{Mutex, MutexGuard, PoisonError};

use krylux::finding::Finding;
use krylux::lab::{Lab, Saved, Verified};
use pyo3::prelude::*;

type Kept = Box<dyn krylux::lab::Answer + Send>;

/// An answer as krylux has it.
#[pyclass(frozen, module = "krylux._krylux", name = "Answer")]
pub(crate) struct Answer(Mutex<Kept>);

impl Answer {
    pub(crate) fn new(kept: Kept) -> Self {
        Self(Mutex::new(kept))
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes the answer into the folder of the open run.
    pub(crate) fn finish(&self, lab: &mut Lab) -> krylux::Result<Saved> {
        lab.finish(&**self.kept())
    }

    /// What was found of the answer and of the rig whose photos it is from.
    pub(crate) fn findings(&self, lab: &Lab) -> Vec<Finding> {
        lab.findings_of(&**self.kept())
    }

    /// Compares the photos that the answer predicts with independent ones: `None` where there are none, or where the answer predicts no photos.
    pub(crate) fn check(&self, lab: &mut Lab) -> krylux::Result<Option<Verified>> {
        self.kept().verify(lab)
    }

    /// The verb that asked for the answer.
    pub(crate) fn verb(&self) -> &'static str {
        self.kept().names()[0]
    }
}
