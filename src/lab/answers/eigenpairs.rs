//! Eigenvalues and eigenvectors.

use super::Answer;
use crate::error::Result;
use crate::krylov::{Eigs, PairStatus};
use crate::lab::{Lab, RunFolder, SourceKind};
use crate::report::eigenpairs::EigenpairsRun;

/// Eigenpairs, and how many were wanted.
#[derive(Clone, Copy, Debug)]
pub struct Eigenpairs<'a> {
    /// The eigenpairs.
    pub found: &'a Eigs,
    /// How many were wanted.
    pub wanted: usize,
}

impl Eigenpairs<'_> {
    /// Whether all that were wanted converged.
    pub fn is_good(&self) -> bool {
        self.found.statuses.iter().all(|&status| status == PairStatus::Converged)
            && self.found.values.len() == self.wanted
    }

    /// The status of each pair, in words.
    pub fn statuses(&self) -> Vec<String> {
        self.found.statuses.iter().map(|&status| in_words(status).to_owned()).collect()
    }
}

impl Answer for Eigenpairs<'_> {
    fn verb(&self) -> &'static str {
        "eigs"
    }

    fn photos(&self) -> usize {
        self.found.stats.products
    }

    fn sentence(&self, _: &Lab) -> String {
        format!("{} photos: {}", self.found.stats.products, self.found.stats.status)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        let has_pictures = lab.kind() != SourceKind::Matrix;
        let sheet = lab.contact_sheet();
        let page = EigenpairsRun {
            title: format!("{} · eigenpairs", lab.name()),
            found: self.found,
            resolution: has_pictures.then(|| lab.resolution()),
            verdicts: &self.statuses(),
            good: self.is_good(),
            strip: has_pictures.then_some((&sheet, lab.unit())),
        };
        page.write(&run.path, &run.manifest, seconds)
    }
}

impl Answer for Eigs {
    fn verb(&self) -> &'static str {
        "eigs"
    }

    fn photos(&self) -> usize {
        self.stats.products
    }

    fn sentence(&self, lab: &Lab) -> String {
        Eigenpairs { found: self, wanted: self.values.len() }.sentence(lab)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        Eigenpairs { found: self, wanted: self.values.len() }.write(lab, run, seconds)
    }
}

fn in_words(status: PairStatus) -> &'static str {
    match status {
        PairStatus::Converged => "converged",
        PairStatus::LimitedByNoise => "limited by noise",
        PairStatus::NotResolved => "not resolved",
    }
}
