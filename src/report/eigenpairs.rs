//! Files and report page of a run that computed eigenpairs.

use super::html::{Block, Report, Section};
use super::run::{Files, Run};
use super::spectrum;
use super::text::{signed, with_error};
use crate::analysis::EigenpairEstimate;
use crate::error::Result;
use crate::finding::{Finding, Grade};
use crate::image::{Image, Resolution};
use crate::io::exr;
use crate::krylov::{Eigs, PairStatus};

/// Eigenpairs, and how many were wanted.
#[derive(Clone, Copy, Debug)]
pub struct Eigenpairs<'a> {
    /// The eigenpairs.
    pub found: &'a Eigs,
    /// How many were wanted.
    pub wanted: usize,
    /// The eigenpairs of the scene by independent light, one for each that was found; empty where there are none.
    pub estimates: &'a [EigenpairEstimate],
}

impl<'a> Eigenpairs<'a> {
    /// Eigenpairs without independent estimates.
    pub fn new(found: &'a Eigs, wanted: usize) -> Self {
        Self { found, wanted, estimates: &[] }
    }

    /// Whether all that were wanted were found, and are within the tolerance or the noise of the photos.
    pub fn findings(&self) -> Vec<Finding> {
        vec![self.finding(false)]
    }

    /// The same; a `strict` one does not count what is within the noise, but not within the tolerance.
    pub fn finding(&self, strict: bool) -> Finding {
        converged("eigenpairs", &self.found.statuses, self.wanted, strict)
    }

    /// The status of each pair, in words.
    pub fn statuses(&self) -> Vec<String> {
        self.found.statuses.iter().map(|&status| in_words(status).to_owned()).collect()
    }

    /// Writes arrays, pictures and `report.html` into the run's folder and returns their names. Of a matrix that does not act on
    /// images, which has no photos to show, there are no pictures.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, run: &Run<'_>) -> Result<Vec<String>> {
        let mut files = Files::new(run.folder);
        let size = run.strip.as_ref().map(|_| run.resolution);
        let found = self.found;
        let count = found.values.len();
        files.array("eigenvalues", &[count], &found.values)?;
        files.array("residuals", &[count], &found.residuals)?;
        files.array("bounds", &[count], &found.bounds)?;
        if !self.estimates.is_empty() {
            let pairs: Vec<f64> =
                self.estimates.iter().flat_map(|of| [of.value, of.standard_error]).collect();
            files.array("eigenvalues-of-scene", &[count, 2], &pairs)?;
        }
        write_vectors(&mut files, "eigenvectors", size, &found.vectors)?;
        if found.imaginary_values.iter().any(|&value| value != 0.0) {
            files.array("eigenvalues-imaginary", &[count], &found.imaginary_values)?;
            // Real eigenpairs have empty imaginary vectors.
            let length = found.vectors.first().map_or(0, Vec::len);
            let padded =
                |vector: &Vec<f64>| if vector.is_empty() { vec![0.0; length] } else { vector.clone() };
            let vectors: Vec<Vec<f64>> = found.imaginary_vectors.iter().map(padded).collect();
            write_vectors(&mut files, "eigenvectors-imaginary", size, &vectors)?;
        }
        let mut pictures = Vec::new();
        if let Some(resolution) = size {
            self.write_layers(&mut files, resolution)?;
            pictures = spectrum::pictures(resolution, &found.vectors, &found.values, None, None)?;
            for (name, figure) in &pictures {
                files.picture(name, figure)?;
            }
        }
        let figures = pictures.into_iter().map(|(_, figure)| figure).collect();
        files.finish(self.page(run, Block::Figures(figures))?)
    }

    fn write_layers(&self, files: &mut Files<'_>, resolution: Resolution) -> Result<()> {
        let layers = spectrum::layers(resolution, &self.found.vectors)?;
        let layers: Vec<(&str, &Image)> = layers.iter().map(|(name, image)| (name.as_str(), image)).collect();
        exr::write_exr(&files.path("eigenvectors.exr"), &layers)
    }

    fn page(&self, run: &Run<'_>, figures: Block) -> Result<Report> {
        let found = self.found;
        let sentence =
            format!("{} photos: {}; {}.", found.stats.products, found.stats.status, found.completeness);
        let bounds = found.bounds.iter().map(|bound| format!("{bound:.1e}")).collect();
        let mut columns = vec![("error at most", bounds), ("verdict", self.statuses())];
        if !self.estimates.is_empty() {
            let of_scene = |of: &EigenpairEstimate| with_error(of.value, of.standard_error);
            columns.insert(0, ("of the scene", self.estimates.iter().map(of_scene).collect()));
        }
        if found.imaginary_values.iter().any(|&value| value != 0.0) {
            let imaginary = found.imaginary_values.iter().map(|&value| signed(value, 6) + " i").collect();
            columns.insert(0, ("imaginary part", imaginary));
        }
        let mut sections = Vec::new();
        if run.strip.is_some() {
            sections.push(Section {
                title: "Eigenvectors".into(),
                text: "Signed images of norm 1. Projected (as far as signs can be), each would come back as a photo of itself.".into(),
                blocks: vec![figures],
            });
        }
        sections.push(Section {
            title: "Spectrum and convergence".into(),
            text: sentence.clone(),
            blocks: vec![
                spectrum::stems(&found.values, &found.residuals, "Eigenvalues; bars are residual norms."),
                spectrum::convergence(&found.history, 1),
                spectrum::table((&found.values, &found.standard_errors), &found.residuals, &columns),
            ],
        });
        sections.extend(run.photos("")?);
        Ok(run.page((self.findings(), sentence), found.stats.products, [], sections))
    }
}

/// Whether all wanted pairs or triplets were found and are within the tolerance; or, unless it is `strict`, within the noise of the photos.
pub(super) fn converged(name: &'static str, statuses: &[PairStatus], wanted: usize, strict: bool) -> Finding {
    let is_good = |status: &&PairStatus| match status {
        PairStatus::Converged => true,
        PairStatus::LimitedByNoise => !strict,
        PairStatus::NotResolved => false,
    };
    let count = statuses.iter().filter(is_good).count();
    let grade = if count == wanted { Grade::Ok } else { Grade::Fails };
    let within = if strict { "converged" } else { "converged, or are within the noise" };
    let help = "give more --photos, or ask for fewer";
    Finding::graded(name, grade, format!("{count} of {wanted} {within}"), "all that are wanted", help)
}

pub(super) fn in_words(status: PairStatus) -> &'static str {
    match status {
        PairStatus::Converged => "converged",
        PairStatus::LimitedByNoise => "limited by noise",
        PairStatus::NotResolved => "not resolved",
    }
}

/// Writes an array of shape `k×H×W` for images of `size`, otherwise `k×n`.
pub(super) fn write_vectors(
    files: &mut Files<'_>,
    name: &str,
    size: Option<Resolution>,
    vectors: &[Vec<f64>],
) -> Result<()> {
    let shape = match size {
        Some(Resolution { width, height }) => vec![vectors.len(), height, width],
        None => vec![vectors.len(), vectors.first().map_or(0, Vec::len)],
    };
    files.array(name, &shape, &vectors.concat())
}
