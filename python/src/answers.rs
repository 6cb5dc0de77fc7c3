//! Answers of a laboratory, kept until they are saved.

use std::sync::{Mutex, PoisonError};

use krylux::bench::audit::Audit;
use krylux::finding::Finding;
use krylux::krylov::{Method, Solution};
use krylux::lab::{Lab, ProbedLight, Saved, Solved, Verified};
use pyo3::prelude::*;

/// An answer as krylux has it.
#[pyclass(frozen, module = "krylux._krylux", name = "Answer")]
pub(crate) struct Answer(Mutex<Kept>);

/// Each kind of answer, with what its report shows beside it.
pub(crate) enum Kept {
    Audit(Audit),
    Probe(ProbedLight),
    Asked(Box<dyn krylux::lab::Answer + Send>),
    Solve { found: Box<Solution>, method: Method },
}

impl Kept {
    /// Lets `work` use the answer as its report shows it.
    fn shown<T>(&self, work: impl FnOnce(&dyn krylux::lab::Answer) -> T) -> T {
        match self {
            Self::Audit(found) => work(found),
            Self::Probe(found) => work(found),
            Self::Asked(found) => work(&**found),
            Self::Solve { found, method } => work(&Solved { found, method: *method }),
        }
    }
}

impl Answer {
    pub(crate) fn new(kept: Kept) -> Self {
        Self(Mutex::new(kept))
    }

    /// Writes the answer into the folder of the open run.
    pub(crate) fn finish(&self, lab: &mut Lab) -> krylux::Result<Saved> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).shown(|answer| lab.finish(answer))
    }

    /// What was found of the answer and of the rig whose photos it is from.
    pub(crate) fn findings(&self, lab: &Lab) -> Vec<Finding> {
        let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.shown(|answer| lab.findings_of(answer))
    }

    /// Compares the photos that the answer predicts with independent ones: `None` where there are none, or where the answer predicts no photos.
    pub(crate) fn check(&self, lab: &mut Lab) -> krylux::Result<Option<Verified>> {
        Ok(match &mut *self.0.lock().unwrap_or_else(PoisonError::into_inner) {
            Kept::Asked(found) => found.verify(lab)?,
            _ => None,
        })
    }

    /// The verb that asked for the answer.
    pub(crate) fn verb(&self) -> &'static str {
        match &*self.0.lock().unwrap_or_else(PoisonError::into_inner) {
            Kept::Audit(_) => "audit",
            Kept::Probe(_) => "probe",
            Kept::Asked(found) => found.verb(),
            Kept::Solve { .. } => "solve",
        }
    }
}
