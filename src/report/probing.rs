//! Files and report page of a probed photo.

use super::colormap::robust_range;
use super::figure;
use super::html::{Block, Figure, Section};
use super::planes::{difference, mean, percent};
use super::run::{Files, Run};
use crate::analysis::planes::{Planes, norm, relative_error, relative_to};
use crate::analysis::{Probed, Probing};
use crate::error::Result;
use crate::finding::{Finding, Grade, Ratio};
use crate::image::Image;
use crate::io::picture;
use crate::io::raster::exposure;

/// A probed photo of every channel.
#[derive(Clone, Debug)]
pub struct ProbedLight {
    /// The paths that were kept.
    pub probing: Probing,
    /// Photos of each channel.
    pub photos: usize,
    /// The photo.
    pub values: Planes,
    /// Its standard errors.
    pub standard_errors: Planes,
    /// The exact photo, if the matrix is known.
    pub truth: Option<Planes>,
}

impl ProbedLight {
    /// The probed channels, with the exact photo if it is known.
    pub fn new(probing: Probing, found: Vec<Probed>, truth: Option<Planes>) -> Self {
        let photos = found.first().map_or(0, |found| found.photos);
        let values = found.iter().map(|found| found.values.clone()).collect();
        let standard_errors = found.into_iter().map(|found| found.standard_errors).collect();
        Self { probing, photos, values, standard_errors, truth }
    }

    /// The relative error, if the exact photo is known.
    pub fn error(&self) -> Option<f64> {
        self.truth.as_ref().and_then(|truth| relative_error(&self.values, truth).value())
    }

    /// Writes `probed`, `standard-error`, `exact` (if known) and `report.html` into the run's folder and returns their names.
    pub fn write(&self, run: &Run<'_>) -> Result<Vec<String>> {
        let mut files = Files::new(run.folder);
        let mut images = vec![("probed", &self.values, format!("Let through: {}", self.probing.in_words()))];
        images.extend(
            self.truth.as_ref().map(|truth| ("exact", truth, "The same from the matrix itself".to_owned())),
        );
        let scale =
            exposure(&Image::from_planes(run.resolution, self.truth.as_ref().unwrap_or(&self.values))?);
        let mut figures = Vec::new();
        for (name, planes, caption) in images {
            let image = Image::from_planes(run.resolution, planes)?;
            files.image(name, &image)?;
            let figure = figure::light(&image, scale, run.unit, caption)?;
            files.picture(name, &figure)?;
            let figure = figure.named(name, format!("{name}.npy"));
            figures.push(match (name, &self.truth) {
                ("probed", Some(_)) => figure.flipped_with(["exact"]),
                ("exact", _) => figure.flipped_with(["probed"]),
                _ => figure,
            });
        }
        let errors = Image::from_planes(run.resolution, &self.standard_errors)?;
        picture::write(&files.path("standard-error.npy"), &errors)?;
        figures.extend(self.error_figures(run)?);
        let mut sections = vec![Section {
            title: "What is let through".into(),
            text: format!(
                "Under an all-ones pattern, in {}. Each random pattern is projected and, sign and all, multiplied into its photo; the mean of these is without bias, and its standard error falls with the square root of the photos.",
                run.unit
            ),
            blocks: vec![Block::Figures(figures)],
        }];
        sections.extend(run.photos("")?);
        let more = [("Paths", self.probing.in_words())];
        files.finish(run.page((self.findings(), self.sentence()), self.photos, more, sections))
    }

    /// The result in one or two sentences.
    pub fn sentence(&self) -> String {
        let mut text = format!(
            "{} photos let through {}, with a standard error of {}.",
            self.photos,
            self.probing.in_words(),
            percent(self.noise())
        );
        if let Some(error) = self.error() {
            text += &format!(" The matrix itself says so within {}.", percent(error));
        }
        text
    }

    /// The root mean square of the standard errors relative to that of the values (the exact ones if known). It has no value without light.
    pub fn noise(&self) -> Ratio {
        let errors = norm(&self.standard_errors);
        match &self.truth {
            Some(truth) => Ratio::of(errors, norm(truth), 0.0),
            None => relative_to(errors, &self.values, &self.standard_errors),
        }
    }

    /// Whether the photo contains any light.
    pub fn findings(&self) -> Vec<Finding> {
        let is_dark = self.noise().value().is_none();
        let found = format!("no {} to measure: it is no more than its error", self.probing.in_words());
        is_dark
            .then(|| Finding::graded("light let through", Grade::Unmeasured, found, "", ""))
            .into_iter()
            .collect()
    }

    fn error_figures(&self, run: &Run<'_>) -> Result<Vec<Figure>> {
        let errors = mean(&self.standard_errors);
        let mut figures = vec![figure::amounts(run.resolution, &errors, run.unit, "Standard error")?];
        if let Some(truth) = &self.truth {
            let error = difference(&self.values, truth);
            let range = robust_range(&error, None);
            figures.push(figure::signed(run.resolution, &error, range, run.unit, "Found less exact")?);
        }
        Ok(figures)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_that_is_not_there_is_a_finding_and_no_number() {
        let of = |values: Vec<f64>, error: f64, truth: Option<Vec<f64>>| {
            let standard_errors = vec![error; values.len()];
            let probed = Probed { values, standard_errors, photos: 3 };
            ProbedLight::new(Probing::Indirect, vec![probed], truth.map(|truth| vec![truth]))
        };
        let (noise, nothing) = (vec![0.1, -0.1, 0.1, -0.1], Some(vec![0.0; 4]));
        for dark in
            [of(vec![0.0; 4], 0.0, nothing.clone()), of(noise.clone(), 0.1, None), of(noise, 0.1, nothing)]
        {
            let [finding] = &dark.findings()[..] else { unreachable!("a finding") };
            assert!(
                finding.grade == Grade::Unmeasured && finding.found.contains("no indirect light to measure")
            );
            assert!(
                !dark.sentence().contains("NaN") && !dark.sentence().contains("inf"),
                "{}",
                dark.sentence()
            );
        }
        let lit = of(vec![1.0; 4], 0.1, None);
        assert!(
            lit.findings().is_empty() && lit.noise().value().is_some_and(|noise| (noise - 0.1).abs() < 1e-3)
        );
    }
}
