//! Files and report page of a run that computed singular values.

use super::eigenpairs::{converged, in_words, write_vectors};
use super::html::{Block, Report, Section};
use super::run::{Files, Run};
use super::spectrum;
use crate::error::Result;
use crate::finding::Finding;
use crate::finding::decimal;
use crate::image::Resolution;
use crate::krylov::Singular;

/// Singular triplets, and how many were wanted.
#[derive(Clone, Copy, Debug)]
pub struct SingularTriplets<'a> {
    /// The triplets.
    pub found: &'a Singular,
    /// How many were wanted.
    pub wanted: usize,
}

impl SingularTriplets<'_> {
    /// Whether all that were wanted were found, and are within the tolerance or the noise of the photos.
    pub fn findings(&self) -> Vec<Finding> {
        vec![self.finding(false)]
    }

    /// The same; a `strict` one does not count what is within the noise, but not within the tolerance.
    pub fn finding(&self, strict: bool) -> Finding {
        converged("singular values", &self.found.statuses, self.wanted, strict)
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
                let caption = format!("{what} {}: σ = {}", index + 1, decimal(found.values[index], 5));
                let figure = super::html::Figure { caption, ..figure };
                files.picture(&format!("{file}-{:02}", index + 1), &figure)?;
                figures.push(figure);
            }
        }
        files.finish(self.page(run, figures)?)
    }

    fn page(&self, run: &Run<'_>, figures: Vec<super::html::Figure>) -> Result<Report> {
        let found = self.found;
        let sentence = format!(
            "{} photos there and back: {}; {}.",
            found.stats.products, found.stats.status, found.completeness
        );
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
