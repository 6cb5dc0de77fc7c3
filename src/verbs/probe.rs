//! Probing: a photo to which only some light paths contribute.

use std::path::Path;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::options::{count, defaults, number};
use crate::analysis::planes::{Planes, norm, relative_error, relative_to};
use crate::analysis::probe::{default_sigma, probe};
use crate::analysis::{Probed, Probing};
use crate::error::Result;
use crate::finding::{Finding, Grade, Ratio};
use crate::image::{Image, Resolution};
use crate::io::picture;
use crate::io::raster::exposure;
use crate::lab::text;
use crate::lab::{Answer, ChannelChoice, Lab, LabOperator, Verb};
use crate::report::content::Content;
use crate::report::figure;
use crate::report::html::Block;
use crate::report::run::AnswerPage;
use crate::report::text::percentage;
use crate::sparse::Csr;
use crate::transport::{Channels, Part};

/// Probe light transport: a photo of which only direct, indirect, near or far light paths are let through
#[derive(Clone, Debug, PartialEq, clap::Args, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[command(after_help = "Example:\n  krylux probe scene.glb --paths indirect -o out/probed")]
pub struct Probe {
    /// One gray system, or red, green and blue as three
    #[arg(long, value_enum, default_value = "luma")]
    #[serde(skip)]
    pub channels: Channels,
    /// Which paths are let through, by how far from its own pixel light comes back
    #[arg(long, value_enum, value_name = "NAME", default_value = "indirect")]
    pub paths: Paths,
    /// Near light is weighted by exp(−d²/2σ²) of the distance d in pixels [default: a sixteenth of the width]
    #[arg(long, value_name = "σ", value_parser = number::<f64>)]
    pub sigma: Option<f64>,
    /// Random patterns; near-indirect takes two photos for each, and indirect and far a white one more [default: 100, or the
    /// budget of the run that is SOURCE]
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    pub photos: Option<usize>,
}

/// Light paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Paths {
    /// Back to the pixel that they started from
    Direct,
    /// All others
    Indirect,
    /// Back near to where they started, direct light among them
    Near,
    /// All others
    Far,
    /// Near, without direct light
    NearIndirect,
}

impl Default for Probe {
    fn default() -> Self {
        defaults()
    }
}

impl Probe {
    fn probing(&self, resolution: Resolution) -> Probing {
        let sigma = self.sigma.unwrap_or_else(|| default_sigma(resolution));
        match self.paths {
            Paths::Direct => Probing::Direct,
            Paths::Indirect => Probing::Indirect,
            Paths::Near => Probing::Near { sigma },
            Paths::Far => Probing::Far { sigma },
            Paths::NearIndirect => Probing::NearIndirect { sigma },
        }
    }
}

impl Verb for Probe {
    const NAME: &'static str = "probe";
    const NEEDS_PICTURES: bool = true;
    const IS_CHECKED: bool = false;
    type Answer = ProbedLight;

    fn check_on(&self, lab: &Lab) -> Result<()> {
        self.probing(lab.projector_resolution()).check()
    }

    fn channels(&self, _: &Path) -> Result<ChannelChoice> {
        Ok(self.channels.into())
    }

    /// Probes every channel with the same random patterns.
    fn answer(&self, lab: &mut Lab) -> Result<ProbedLight> {
        let photos = self.photos.or(lab.photos_of_run()).unwrap_or(100);
        lab.allow_photos(photos);
        let (resolution, seed) = (lab.resolution(), lab.seed());
        let probing = self.probing(lab.projector_resolution());
        let mut operators = lab.operators(Part::Full)?;
        lab.expect(probing.photos(photos));
        let projector = lab.projector_resolution();
        let homes = lab.homes()?;
        let one = |operator: &mut LabOperator| {
            probe(operator, (projector, homes.as_deref()), probing, photos, seed)
        };
        let found = lab.photos(|_| operators.iter_mut().map(one).collect::<Result<Vec<_>>>())?;
        let matrices = lab.matrices_of(Part::Full)?;
        let exact = |matrix: &Csr| probing.exact(matrix, projector, homes.as_deref());
        let truth = matrices.map(|of| of.iter().map(exact).collect());
        Ok(ProbedLight::new((self.paths, probing), resolution, found, truth))
    }
}

/// A probed photo in every channel.
#[derive(Clone, Debug)]
pub struct ProbedLight {
    /// The name of the light paths.
    pub paths: Paths,
    /// The light paths that contribute.
    pub probing: Probing,
    /// The resolution of all images.
    pub resolution: Resolution,
    /// The number of photos taken for each channel.
    pub photos: usize,
    /// The values of the probed photo.
    pub values: Planes,
    /// The standard errors of the values.
    pub standard_errors: Planes,
    /// The exact probed photo, if the matrix is known.
    pub truth: Option<Planes>,
}

impl ProbedLight {
    fn new(
        (paths, probing): (Paths, Probing),
        resolution: Resolution,
        found: Vec<Probed>,
        truth: Option<Planes>,
    ) -> Self {
        let photos = found.first().map_or(0, |found| found.photos);
        let (values, standard_errors) =
            found.into_iter().map(|found| (found.values, found.standard_errors)).unzip();
        Self { paths, probing, resolution, photos, values, standard_errors, truth }
    }

    /// The relative error, if the exact photo is known.
    pub fn error(&self) -> Option<f64> {
        self.truth.as_ref().and_then(|truth| relative_error(&self.values, truth).value())
    }

    /// The root mean square of the standard errors, divided by that of the photo (the exact photo if it is known). Undefined without light.
    pub fn noise(&self) -> Ratio {
        let errors = norm(&self.standard_errors);
        match &self.truth {
            Some(truth) => Ratio::of(errors, norm(truth), 0.0),
            None => relative_to(errors, &self.values, &self.standard_errors),
        }
    }
}

impl Answer for ProbedLight {
    fn names(&self) -> [&'static str; 2] {
        [Probe::NAME, "probing of light transport"]
    }

    fn photos(&self) -> usize {
        self.photos
    }

    fn headline(&self) -> String {
        let (paths, noise) = (self.probing.in_words(), percentage(self.noise()));
        format!("{paths}, with a standard error of {noise}; {} photos", self.photos)
    }

    fn sentence(&self) -> String {
        let (paths, noise) = (self.probing.in_words(), percentage(self.noise()));
        let text = format!("{} photos let through {paths}, with a standard error of {noise}.", self.photos);
        match self.error() {
            Some(error) => format!("{text} The matrix itself says so within {}.", percentage(error)),
            None => text,
        }
    }

    fn content(&self) -> Content<'_> {
        let mut content = Content::default();
        content.planes("values", self.resolution, &self.values);
        content.planes("standard_errors", self.resolution, &self.standard_errors);
        if let Some(truth) = &self.truth {
            content.planes("truth", self.resolution, truth);
        }
        let (noise, error) = (self.noise(), self.error());
        content.detail("name", self.paths);
        content.fact("paths", self.probing.in_words());
        content.fact("photos", self.photos);
        content.fact("relative_standard_error", noise);
        content.fact("relative_error", error);
        if let Some(error) = error {
            let error = text::percent(error);
            content.line(format_args!("error     {error} % of what the matrix itself says"));
        }
        content
    }

    /// One finding: whether the photo contains any light.
    fn findings(&self) -> Vec<Finding> {
        if self.noise().value().is_some() {
            return Vec::new();
        }
        let found = format!("no {} to measure: it is no more than its error", self.probing.in_words());
        vec![Finding::graded("light let through", Grade::Unmeasured, found, "", "")]
    }

    fn show(&self, _: &mut Lab, page: &mut AnswerPage<'_>) -> Result<()> {
        let image = |planes: &Planes| Image::from_planes(self.resolution, planes);
        let values = image(&self.values)?;
        let truth = self.truth.as_ref().map(image).transpose()?;
        let scale = exposure(truth.as_ref().unwrap_or(&values));
        let caption = format!("Let through: {}", self.probing.in_words());
        let mut figures = vec![page.light("probed", &values, scale, caption)?];
        if let Some(truth) = &truth {
            figures.push(page.light("exact", truth, scale, "The same from the matrix itself")?);
            figure::flip(&mut figures, &["probed", "exact"]);
        }
        picture::write(&page.files.path("standard-error.npy"), &image(&self.standard_errors)?)?;
        figures.push(page.errors(&self.standard_errors, "Standard error")?);
        if let Some(truth) = &self.truth {
            figures.push(page.difference(&self.values, truth, "Found less exact")?);
        }
        let text = format!(
            "Under an all-ones pattern, in {}. Each random pattern is projected and, sign and all, multiplied into its photo; the mean of these is without bias, and its standard error falls with the square root of the photos.",
            page.unit
        );
        page.section("What is let through", text, [Block::Figures(figures)]);
        page.contact_sheet("")?;
        page.fact("Paths", self.probing.in_words());
        Ok(())
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
            let truth = truth.map(|truth| vec![truth]);
            ProbedLight::new((Paths::Indirect, Probing::Indirect), Resolution::new(2, 2), vec![probed], truth)
        };
        let (noise, nothing) = (vec![0.1, -0.1, 0.1, -0.1], Some(vec![0.0; 4]));
        for dark in
            [of(vec![0.0; 4], 0.0, nothing.clone()), of(noise.clone(), 0.1, None), of(noise, 0.1, nothing)]
        {
            let [finding] = &dark.findings()[..] else { unreachable!("a finding") };
            assert!(
                finding.grade == Grade::Unmeasured && finding.found.contains("no indirect light to measure")
            );
            let sentence = dark.sentence();
            assert!(!sentence.contains("NaN") && !sentence.contains("inf"), "{sentence}");
        }
        let lit = of(vec![1.0; 4], 0.1, None);
        assert!(
            lit.findings().is_empty() && lit.noise().value().is_some_and(|noise| (noise - 0.1).abs() < 1e-3)
        );
    }
}
