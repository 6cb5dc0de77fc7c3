//! Files and report page of a run that solved a linear system.

use std::path::Path;

use super::html::{Outcome, Report, Section, Verdict};
use super::residuals;
use super::run::{self, Files};
use crate::error::Result;
use crate::io::{atomic, npy};
use crate::krylov::Solution;
use crate::measure::RunManifest;

/// A solution and the context that its report needs.
#[derive(Clone, Debug)]
pub struct SolutionRun<'a> {
    /// The page's title.
    pub title: String,
    /// The result.
    pub found: &'a Solution,
    /// The method's name.
    pub method: &'a str,
    /// Whether the result meets the requested accuracy.
    pub good: bool,
}

impl SolutionRun<'_> {
    /// Writes `solution.npy`, `residuals.csv` and `report.html` into `folder` and returns their names. `seconds` is the run's
    /// duration so far.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, folder: &Path, manifest: &RunManifest, seconds: f64) -> Result<Vec<String>> {
        let mut files = Files::new(folder);
        let found = self.found;
        npy::write_npy(&files.path("solution.npy"), &[found.x.len()], &found.x)?;
        let history: Vec<residuals::Row> =
            found.history.iter().map(|row| (row.products, row.residual)).collect();
        atomic::write_bytes(&files.path("residuals.csv"), residuals::csv("products", &history).as_bytes())?;
        let plot = residuals::plot(
            "products",
            &[(self.method, &history)],
            Vec::new(),
            "The residual of each iterate, as the method knows it: no product is spent on it.",
        );
        let sentence = format!(
            "{} products by {}: {}. The residual is {:.3e} of the right-hand side.",
            found.stats.products, self.method, found.stats.status, found.residual
        );
        let report = Report {
            title: self.title.clone(),
            verdict: Verdict { outcome: if self.good { Outcome::Good } else { Outcome::Short }, sentence },
            facts: run::facts(manifest, found.stats.products, [], seconds),
            sections: vec![Section { title: "Convergence".into(), text: String::new(), blocks: vec![plot] }],
            footer: manifest.command.join(" "),
        };
        report.write(&files.path("report.html"))?;
        Ok(files.names)
    }
}
