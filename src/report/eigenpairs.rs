//! Files and report page of a run that computed eigenpairs.

use std::path::Path;

use super::contact_sheet::ContactSheet;
use super::html::{Block, Outcome, Report, Section, Verdict};
use super::run::{self, Files};
use super::spectrum;
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::io::{exr, npy};
use crate::krylov::Eigs;
use crate::measure::RunManifest;

/// Computed eigenpairs and the context that their report needs.
#[derive(Clone, Debug)]
pub struct EigenpairsRun<'a> {
    /// The page's title.
    pub title: String,
    /// The result.
    pub found: &'a Eigs,
    /// Resolution of the eigenvectors as images; `None` if the matrix does not act on images.
    pub resolution: Option<Resolution>,
    /// A short status of each pair.
    pub verdicts: &'a [String],
    /// Whether the result meets the requested accuracy.
    pub good: bool,
    /// Contact sheet of all photos and the photos' unit; `None` if the matrix does not act on images.
    pub strip: Option<(&'a ContactSheet, &'a str)>,
}

impl EigenpairsRun<'_> {
    /// Writes arrays, pictures and `report.html` into `folder` and returns their names. `seconds` is the run's duration so far.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, folder: &Path, manifest: &RunManifest, seconds: f64) -> Result<Vec<String>> {
        let mut files = Files::new(folder);
        let found = self.found;
        let count = found.values.len();
        npy::write_npy(&files.path("eigenvalues.npy"), &[count], &found.values)?;
        npy::write_npy(&files.path("residuals.npy"), &[count], &found.residuals)?;
        npy::write_npy(&files.path("bounds.npy"), &[count], &found.bounds)?;
        self.write_vectors(&mut files, "eigenvectors.npy", &found.vectors)?;
        if found.imaginary_values.iter().any(|&value| value != 0.0) {
            npy::write_npy(&files.path("eigenvalues-imaginary.npy"), &[count], &found.imaginary_values)?;
            // Real eigenpairs have empty imaginary vectors.
            let length = found.vectors.first().map_or(0, Vec::len);
            let padded =
                |vector: &Vec<f64>| if vector.is_empty() { vec![0.0; length] } else { vector.clone() };
            let vectors: Vec<Vec<f64>> = found.imaginary_vectors.iter().map(padded).collect();
            self.write_vectors(&mut files, "eigenvectors-imaginary.npy", &vectors)?;
        }
        let mut pictures = Vec::new();
        if let Some(resolution) = self.resolution {
            self.write_layers(&mut files, resolution)?;
            pictures = spectrum::pictures(resolution, &found.vectors, &found.values, None)?;
            for (name, figure) in &pictures {
                crate::io::atomic::write_bytes(&files.path(&format!("{name}.png")), &figure.png)?;
            }
        }
        let figures = pictures.into_iter().map(|(_, figure)| figure).collect();
        self.page(Block::Figures(figures), manifest, seconds)?.write(&files.path("report.html"))?;
        Ok(files.names)
    }

    /// Writes an array of shape `k×H×W` for images, otherwise `k×n`.
    fn write_vectors(&self, files: &mut Files<'_>, name: &str, vectors: &[Vec<f64>]) -> Result<()> {
        let shape = match self.resolution {
            Some(Resolution { width, height }) => vec![vectors.len(), height, width],
            None => vec![vectors.len(), vectors.first().map_or(0, Vec::len)],
        };
        npy::write_npy(&files.path(name), &shape, &vectors.concat())
    }

    fn write_layers(&self, files: &mut Files<'_>, resolution: Resolution) -> Result<()> {
        let layers = spectrum::layers(resolution, &self.found.vectors)?;
        let layers: Vec<(&str, &Image)> = layers.iter().map(|(name, image)| (name.as_str(), image)).collect();
        exr::write_exr(&files.path("eigenvectors.exr"), &layers)
    }

    fn page(&self, figures: Block, manifest: &RunManifest, seconds: f64) -> Result<Report> {
        let found = self.found;
        let sentence = format!("{} photos: {}.", found.stats.products, found.stats.status);
        let bounds = found.bounds.iter().map(|bound| format!("{bound:.1e}")).collect();
        let mut columns = vec![("error at most", bounds), ("verdict", self.verdicts.to_vec())];
        if found.imaginary_values.iter().any(|&value| value != 0.0) {
            let imaginary = found.imaginary_values.iter().map(|value| format!("{value:+.6} i")).collect();
            columns.insert(0, ("imaginary part", imaginary));
        }
        let mut sections = Vec::new();
        if self.resolution.is_some() {
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
                spectrum::table(&found.values, &found.residuals, &columns),
            ],
        });
        if let Some((strip, unit)) = self.strip {
            sections.extend(strip.section(unit, "")?);
        }
        let outcome = if self.good { Outcome::Good } else { Outcome::Short };
        Ok(Report {
            title: self.title.clone(),
            verdict: Verdict { outcome, sentence },
            facts: run::facts(manifest, found.stats.products, [], seconds),
            sections,
            footer: manifest.command.join(" "),
        })
    }
}
