//! Files and report page of a run that solved a linear system.

use super::html::Section;
use super::residuals;
use super::run::{Files, Run};
use crate::error::Result;
use crate::finding::{Finding, Grade};
use crate::krylov::{Method, Solution, Status};

/// A solution and the method that found it.
#[derive(Clone, Copy, Debug)]
pub struct Solved<'a> {
    /// The solution.
    pub found: &'a Solution,
    /// The method.
    pub method: Method,
}

impl Solved<'_> {
    /// Whether the solution is as good as requested, or as good as possible.
    pub fn is_good(&self) -> bool {
        matches!(
            self.found.stats.status,
            Status::ReachedTolerance
                | Status::NoiseFloor
                | Status::SpaceExhausted
                | Status::LeastSquares
                | Status::ConstrainedOptimum
        )
    }

    /// The quality of the solution as a finding.
    pub fn findings(&self) -> Vec<Finding> {
        let grade = if self.is_good() { Grade::Ok } else { Grade::Fails };
        let status = self.found.stats.status.to_string();
        vec![Finding::graded("solution", grade, status, "a residual within --rtol", "give more --photos")]
    }

    /// Writes `solution.npy`, `residuals.csv` and `report.html` into the run's folder and returns their names.
    pub fn write(&self, run: &Run<'_>) -> Result<Vec<String>> {
        let mut files = Files::new(run.folder);
        let (found, method) = (self.found, self.method.facts().name);
        files.array("solution", &[found.x.len()], &found.x)?;
        let history: Vec<residuals::Row> =
            found.history.iter().map(|row| (row.products, row.residual)).collect();
        files.text("residuals.csv", &residuals::csv("products", &history))?;
        let plot = residuals::plot(
            "products",
            &[(method, &history)],
            Vec::new(),
            "The residual of each iterate, as the method knows it: no product is spent on it.",
        );
        let sentence = format!(
            "{} products by {method}: {}. The residual is {:.3e} of the right-hand side.",
            found.stats.products, found.stats.status, found.residual
        );
        let sections = vec![Section { title: "Convergence".into(), text: String::new(), blocks: vec![plot] }];
        files.finish(run.page((self.findings(), sentence), found.stats.products, [], sections))
    }
}
