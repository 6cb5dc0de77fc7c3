//! Files and report page of a probed photo.

use std::path::Path;

use super::colormap::robust_range;
use super::contact_sheet::ContactSheet;
use super::figure;
use super::html::{Block, Figure, Outcome, Report, Section, Verdict};
use super::planes::{difference, mean, percent};
use super::run::{self, Files};
use crate::analysis::Probing;
use crate::analysis::planes::{Planes, relative_error};
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::io::tone::exposure;
use crate::io::{atomic, picture};
use crate::measure::RunManifest;

/// A probed photo and the context that its report needs.
#[derive(Clone, Debug)]
pub struct ProbingRun<'a> {
    /// The page's title.
    pub title: String,
    /// Which light paths contribute.
    pub probing: Probing,
    /// Number of photos taken.
    pub photos: usize,
    /// Resolution of all images.
    pub resolution: Resolution,
    /// Unit of the values.
    pub unit: &'a str,
    /// The estimate of `(Π ∘ A) 1`.
    pub values: &'a Planes,
    /// Standard error of each value.
    pub standard_errors: &'a Planes,
    /// The exact `(Π ∘ A) 1`, computed from the matrix if it is known.
    pub truth: Option<&'a Planes>,
    /// Contact sheet of all photos.
    pub strip: &'a ContactSheet,
}

impl ProbingRun<'_> {
    /// Writes `probed`, `standard-error`, `exact` (if known) and `report.html` into `folder` and returns their names. `seconds`
    /// is the run's duration so far.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, folder: &Path, manifest: &RunManifest, seconds: f64) -> Result<Vec<String>> {
        let mut files = Files::new(folder);
        let mut images = vec![("probed", self.values, format!("Let through: {}", self.probing.in_words()))];
        images.extend(self.truth.map(|truth| ("exact", truth, "The same from the matrix itself".to_owned())));
        let scale = exposure(&Image::from_planes(self.resolution, self.truth.unwrap_or(self.values))?);
        let mut figures = Vec::new();
        for (name, planes, caption) in images {
            let image = Image::from_planes(self.resolution, planes)?;
            for extension in ["npy", "exr"] {
                picture::write(&files.path(&format!("{name}.{extension}")), &image)?;
            }
            let figure = figure::light(&image, scale, self.unit, caption)?;
            atomic::write_bytes(&files.path(&format!("{name}.png")), &figure.png)?;
            figures.push(figure);
        }
        let errors = Image::from_planes(self.resolution, self.standard_errors)?;
        picture::write(&files.path("standard-error.npy"), &errors)?;
        figures.extend(self.error_figures()?);
        let mut sections = vec![Section {
            title: "What is let through".into(),
            text: format!(
                "Under an all-ones pattern, in {}. Each random pattern is projected and, sign and all, multiplied into its photo; the mean of these is without bias, and its standard error falls with the square root of the photos.",
                self.unit
            ),
            blocks: vec![Block::Figures(figures)],
        }];
        sections.extend(self.strip.section(self.unit, "")?);
        let report = Report {
            title: self.title.clone(),
            verdict: Verdict { outcome: Outcome::Good, sentence: self.sentence() },
            facts: run::facts(manifest, self.photos, [("Paths", self.probing.in_words())], seconds),
            sections,
            footer: manifest.command.join(" "),
        };
        report.write(&files.path("report.html"))?;
        Ok(files.names)
    }

    /// The result in one or two sentences.
    pub fn sentence(&self) -> String {
        let mut text = format!(
            "{} photos let through {}, with a standard error of {}.",
            self.photos,
            self.probing.in_words(),
            percent(self.noise())
        );
        if let Some(truth) = self.truth {
            text += &format!(
                " The matrix itself says so within {}.",
                percent(relative_error(self.values, truth))
            );
        }
        text
    }

    /// The root mean square of the standard errors relative to that of the values (the exact ones if known).
    pub fn noise(&self) -> f64 {
        let size = |planes: &Planes| planes.iter().flatten().map(|value| value * value).sum::<f64>().sqrt();
        size(self.standard_errors) / size(self.truth.unwrap_or(self.values))
    }

    fn error_figures(&self) -> Result<Vec<Figure>> {
        let errors = mean(self.standard_errors);
        let mut figures = vec![figure::amounts(self.resolution, &errors, self.unit, "Standard error")?];
        if let Some(truth) = self.truth {
            let error = difference(self.values, truth);
            let range = robust_range(&error, None);
            figures.push(figure::signed(self.resolution, &error, range, self.unit, "Found less exact")?);
        }
        Ok(figures)
    }
}
