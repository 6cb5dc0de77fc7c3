//! The solution of a linear system.

use super::Answer;
use crate::error::Result;
use crate::krylov::{Method, Solution, Status};
use crate::lab::{Lab, RunFolder};
use crate::report::solution::SolutionRun;

/// A solution and the method that found it.
#[derive(Clone, Copy, Debug)]
pub struct Solved<'a> {
    /// The solution.
    pub found: &'a Solution,
    /// The method.
    pub method: Method,
}

impl Solved<'_> {
    /// Whether the method ended because the solution is as good as was asked for, or as good as there is.
    pub fn is_good(&self) -> bool {
        matches!(
            self.found.stats.status,
            Status::ReachedTolerance
                | Status::SpaceExhausted
                | Status::LeastSquares
                | Status::ConstrainedOptimum
        )
    }
}

impl Answer for Solved<'_> {
    fn verb(&self) -> &'static str {
        "solve"
    }

    fn photos(&self) -> usize {
        self.found.stats.products
    }

    fn sentence(&self, _: &Lab) -> String {
        format!("{} products: {}", self.found.stats.products, self.found.stats.status)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        let page = SolutionRun {
            title: format!("{} · linear system", lab.name()),
            found: self.found,
            method: self.method.facts().name,
            good: self.is_good(),
        };
        page.write(&run.path, &run.manifest, seconds)
    }
}
