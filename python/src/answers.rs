//! Answers of a laboratory, kept until they are saved.

use std::sync::{Mutex, PoisonError};

use krylux::analysis::EigenpairEstimate;
use krylux::analysis::segment::{SegmentRequest, Segmented, Truth};
use krylux::bench::audit::Audit;
use krylux::finding::Finding;
use krylux::image::Image;
use krylux::io::manifest::Verification;
use krylux::krylov::{Eigs, Method, Singular, Solution};
use krylux::lab::{
    CompensateAnswer, CompensateRequest, Compensated, Eigenpairs, Lab, ProbedLight, Relighting, Saved,
    Scored, Separated, SingularTriplets, Solved, VerifiedCompensation, VerifiedEigenpairs,
};
use krylux::transport::Part;
use pyo3::prelude::*;

/// An answer as krylux has it.
#[pyclass(frozen, module = "krylux._krylux", name = "Answer")]
pub(crate) struct Answer(Mutex<Kept>);

/// Each kind of answer, with what its report shows beside it.
pub(crate) enum Kept {
    Audit(Audit),
    Compensate(Box<CompensateRequest>, Box<CompensateAnswer>),
    Eigs {
        found: Box<Eigs>,
        wanted: usize,
        part: Part,
    },
    Probe(ProbedLight),
    Relight(Box<Relighting>),
    Segment {
        request: Box<SegmentRequest>,
        found: Box<Segmented>,
        truth: Option<Truth>,
        scores: Vec<(usize, f64)>,
    },
    Separate(Box<Separated>),
    Singular {
        found: Box<Singular>,
        wanted: usize,
    },
    Solve {
        found: Box<Solution>,
        method: Method,
    },
}

impl Kept {
    /// Lets `work` use the answer as its report shows it.
    fn shown<T>(&self, work: impl FnOnce(&dyn krylux::lab::Answer) -> T) -> T {
        match self {
            Self::Audit(found) => work(found),
            Self::Compensate(request, answer) => {
                let shown = Compensated::new(&answer.found, &request.options);
                work(&Compensated { methods: &answer.methods, ..shown })
            }
            Self::Eigs { found, wanted, .. } => work(&Eigenpairs::new(found, *wanted)),
            Self::Probe(found) => work(found),
            Self::Relight(found) => work(&**found),
            Self::Segment { found, truth, scores, .. } => work(&Scored::new(found, truth.as_ref(), scores)),
            Self::Separate(found) => work(&**found),
            Self::Singular { found, wanted } => work(&SingularTriplets { found, wanted: *wanted }),
            Self::Solve { found, method } => work(&Solved { found, method: *method }),
        }
    }
}

/// What independent light says of an answer.
pub(crate) struct Checked {
    pub(crate) verification: Verification,
    pub(crate) estimates: Vec<EigenpairEstimate>,
    pub(crate) residual: Option<f64>,
    /// The photo by independent light, and the standard error of each of its samples.
    pub(crate) photo: Option<[Image; 2]>,
}

impl Answer {
    pub(crate) fn new(kept: Kept) -> Self {
        Self(Mutex::new(kept))
    }

    /// Writes the answer into the folder of the open run.
    pub(crate) fn finish(&self, lab: &mut Lab) -> krylux::Result<Saved> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let saved = kept.shown(|answer| lab.finish(answer))?;
        if let Kept::Relight(found) = &mut *kept {
            // Another folder gets a model of its own.
            found.files = None;
        }
        Ok(saved)
    }

    /// What was found of the answer and of the rig whose photos it is from.
    pub(crate) fn findings(&self, lab: &Lab) -> Vec<Finding> {
        let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.shown(|answer| lab.findings_of(answer))
    }

    /// Compares the photos that the answer predicts with independent ones: `None` where there are none, or where the answer predicts no photos.
    pub(crate) fn check(&self, lab: &mut Lab) -> krylux::Result<Option<Checked>> {
        let whole =
            |verification| Checked { verification, estimates: Vec::new(), residual: None, photo: None };
        let of_pairs =
            |VerifiedEigenpairs { verification, estimates, .. }| Checked { estimates, ..whole(verification) };
        let of_compensation = |found: VerifiedCompensation| Checked {
            residual: Some(found.residual),
            photo: Some([found.photo, found.standard_error]),
            ..whole(found.verification)
        };
        Ok(match &*self.0.lock().unwrap_or_else(PoisonError::into_inner) {
            Kept::Eigs { found, part, .. } => lab.verify_eigenpairs(*part, found)?.map(of_pairs),
            Kept::Segment { request, found, .. } if request.is_of_photos_as_taken(found) => {
                let (part, cut) = (request.part(), request.options.cut);
                lab.verify_segmentation(part, cut, &found.segmentation)?.map(of_pairs)
            }
            // Where the colours of projector and camera mix, the photo is not the sum of what single channels see.
            Kept::Compensate(request, answer) if request.colors.is_none() => {
                lab.verify_compensation(&answer.found)?.map(of_compensation)
            }
            Kept::Relight(found) => lab.verify_relighting(found)?.map(whole),
            Kept::Separate(found) => lab.verify_separation(found)?.map(whole),
            _ => None,
        })
    }

    /// The verb that asked for the answer.
    pub(crate) fn verb(&self) -> &'static str {
        match &*self.0.lock().unwrap_or_else(PoisonError::into_inner) {
            Kept::Audit(_) => "audit",
            Kept::Compensate(..) => "compensate",
            Kept::Eigs { .. } | Kept::Singular { .. } => "eigs",
            Kept::Probe(_) => "probe",
            Kept::Relight(_) => "relight",
            Kept::Segment { .. } => "segment",
            Kept::Separate(_) => "separate",
            Kept::Solve { .. } => "solve",
        }
    }
}
