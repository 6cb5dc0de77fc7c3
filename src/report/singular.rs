//! Files and report page of a run that computed singular values.

use super::eigenpairs::{converged, in_words, write_vectors};
use super::html::{Block, Report, Section};
use super::run::{Files, Run};
use super::spectrum;
use crate::error::Result;
use crate::finding::{Finding, Grade};
use crate::image::Resolution;
use crate::krylov::{PairStatus, Singular};

/// Singular triplets, and how many were wanted.
#[derive(Clone, Copy, Debug)]
pub struct SingularTriplets<'a> {
    /// The triplets.
    pub found: &'a Singular,
    /// How many were wanted.
    pub wanted: usize,
}

impl SingularTriplets<'_> {
    /// Whether all that were wanted converged.
    pub fn is_good(&self) -> bool {
        self.found.statuses.iter().all(|&status| status == PairStatus::Converged)
            && self.found.values.len() == self.wanted
    }

    /// As [`Eigenpairs::findings`](super::eigenpairs::Eigenpairs::findings).
    pub fn findings(&self) -> Vec<Finding> {
        vec![self.finding(Grade::Warning)]
    }

    /// The same with this grade where some did not converge.
    pub fn finding(&self, otherwise: Grade) -> Finding {
        converged("singular values", self.is_good(), &self.found.statuses, self.wanted, otherwise)
    }

    /// The status of each triplet, in words.
    pub fn statuses(&self) -> Vec<String> {
        self.found.statuses.iter().map(|&status| in_words(status).to_owned()).collect()
    }

    /// Writes arrays, pictures and `report.html` into the run's folder and returns their names. `sizes` are the pixels of photos and of patterns;
    /// without them, as of a matrix that does not act on images, there are no pictures.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, run: &Run<'_>, sizes: Option<[Resolution; 2]>) -> Result<Vec<String>> {
        let mut files = Files::new(run.folder);
        let found = self.found;
        let count = found.values.len();
        files.array("singular-values", &[count], &found.values)?;
        files.array("residuals", &[count], &found.residuals)?;
        files.array("standard-errors", &[count], &found.standard_errors)?;
        let [of_photos, of_patterns] = [0, 1].map(|side| sizes.map(|sizes| sizes[side]));
        write_vectors(&mut files, "left-vectors", of_photos, &found.left)?;
        write_vectors(&mut files, "right-vectors", of_patterns, &found.right)?;
        let mut figures = Vec::new();
        for (what, file, size, vectors) in
            [("pattern", "right", of_patterns, &found.right), ("photo", "left", of_photos, &found.left)]
        {
            let Some(size) = size else { continue };
            for (index, (_, figure)) in
                spectrum::pictures(size, vectors, &found.values, None, None)?.into_iter().enumerate()
            {
                let figure = figure
                    .named(format!("{what} {}", index + 1), format!("{file}-vectors.npy[{index}]"))
                    .in_series(what);
                let caption = format!("{what} {}: σ = {:.5}", index + 1, found.values[index]);
                let figure = super::html::Figure { caption, ..figure };
                files.picture(&format!("{file}-{:02}", index + 1), &figure)?;
                figures.push(figure);
            }
        }
        files.finish(self.page(run, figures)?)
    }

    fn page(&self, run: &Run<'_>, figures: Vec<super::html::Figure>) -> Result<Report> {
        let found = self.found;
        let sentence = format!("{} photos there and back: {}.", found.stats.products, found.stats.status);
        let mut sections = Vec::new();
        if !figures.is_empty() {
            sections.push(Section {
                title: "Patterns and their photos".into(),
                text: "Signed images of norm 1. Each pattern (right singular vector), projected as far as signs can be, comes back as its photo (left singular vector), σ times as bright; the photo, projected by the exchanged devices, comes back as the pattern.".into(),
                blocks: vec![Block::Figures(figures)],
            });
        }
        sections.push(Section {
            title: "Singular values and convergence".into(),
            text: sentence.clone(),
            blocks: vec![
                spectrum::stems(&found.values, &found.residuals, "Singular values; bars are residual norms."),
                spectrum::convergence(&found.history, 1),
                spectrum::table(
                    (&found.values, &found.standard_errors),
                    &found.residuals,
                    &[("verdict", self.statuses())],
                ),
            ],
        });
        sections.extend(run.photos("")?);
        Ok(run.page((self.findings(), sentence), found.stats.products, [], sections))
    }
}
