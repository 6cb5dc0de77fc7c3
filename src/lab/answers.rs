//! The answers of the Krylov methods and of the analyses, as files in a run's folder.

use super::{Answer, Lab, RunFolder};
use crate::bench::audit::Audit;
use crate::error::Result;
use crate::finding::Finding;
use crate::report;
use crate::report::probing::ProbedLight;
use crate::report::solution::Solved;

impl Answer for Audit {
    fn verb(&self) -> &'static str {
        "audit"
    }

    fn photos(&self) -> usize {
        self.photos
    }

    fn sentence(&self) -> String {
        Self::sentence(self)
    }

    /// An audit that failed by saturation has no white photo, and so no known noise.
    fn has_white(&self) -> bool {
        !self.white.is_empty()
    }

    fn findings(&self) -> Vec<Finding> {
        Self::findings(self)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        report::audit::write(self, &lab.page("audit", run, seconds))
    }
}

impl Answer for ProbedLight {
    fn verb(&self) -> &'static str {
        "probe"
    }

    fn photos(&self) -> usize {
        self.photos
    }

    fn sentence(&self) -> String {
        Self::sentence(self)
    }

    fn findings(&self) -> Vec<Finding> {
        Self::findings(self)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        Self::write(self, &lab.page("probing of light transport", run, seconds))
    }
}

impl Answer for Solved<'_> {
    fn verb(&self) -> &'static str {
        "solve"
    }

    fn photos(&self) -> usize {
        self.found.stats.products
    }

    fn sentence(&self) -> String {
        format!("{} products: {}", self.found.stats.products, self.found.stats.status)
    }

    fn findings(&self) -> Vec<Finding> {
        Self::findings(self)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        Self::write(self, &lab.page("linear system", run, seconds))
    }
}
