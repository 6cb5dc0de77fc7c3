//! Probing: a photo to which only some light paths contribute.

mod mask;
#[cfg(test)]
mod tests;

use std::path::Path;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

pub use mask::MaskChoice;

use super::options::{count, number};
use crate::analysis::planes::{Planes, norm, relative_error, relative_to};
use crate::analysis::probe::{Mask, default_sigma, probe, probe_masked};
use crate::analysis::{Probed, Probing};
use crate::error::{Error, Result};
use crate::finding::{Finding, Grade, Ratio};
use crate::image::{Image, Resolution};
use crate::io::picture;
use crate::io::raster::exposure;
use crate::lab::text;
use crate::lab::{Answer, ChannelChoice, GivenArray, Lab, LabOperator, Verb};
use crate::report::content::Content;
use crate::report::figure;
use crate::report::html::Block;
use crate::report::run::AnswerPage;
use crate::report::text::percentage;
use crate::sparse::Csr;
use crate::transport::{Channels, Part};

/// Masks of at most so many parts are probed part by part if `--photos` is not given.
const MOST_PARTS: usize = 256;

/// Probe light transport: a photo of which only direct, indirect, near or far light paths are let through, or those of a mask
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
    /// Paths by a mask, in place of --paths: row, column or epipolar for light from the row, column or epipolar line of a pixel,
    /// band:A,B for light from columns A to B to its right, beyond:N for light from farther than N pixels, or a matrix file of weights
    #[arg(long, value_name = "NAME|FILE", conflicts_with_all = ["paths", "sigma"])]
    pub mask: Option<MaskChoice>,
    /// Random patterns; near-indirect takes two photos for each, and indirect, far and beyond:N a white one more. A mask of no more
    /// parts, such as rows, takes a photo of each part instead [default: 100, or the parts of a mask up to 256, or the budget of
    /// the run that is SOURCE]
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

    fn check(&self) -> Result<()> {
        match (&self.mask, self.sigma) {
            (Some(mask), Some(_)) => {
                Err(Error::option("--sigma", format!("the mask {mask} takes no distance"))
                    .help("leave out --sigma or --mask"))
            }
            _ => Ok(()),
        }
    }

    fn check_on(&self, lab: &Lab) -> Result<()> {
        match &self.mask {
            Some(mask) => mask.check_on(lab),
            None => self.probing(lab.projector_resolution()).check(),
        }
    }

    fn give(&mut self, given: Vec<GivenArray>) -> Result<()> {
        match given.iter().find(|array| array.field != "mask") {
            Some(array) => Err(array.not_taken()),
            None if given.is_empty() => Ok(()),
            None => MaskChoice::of_arrays(given).map(|mask| self.mask = Some(mask)),
        }
    }

    fn channels(&self, _: &Path) -> Result<ChannelChoice> {
        Ok(self.channels.into())
    }

    /// Probes every channel with the same random patterns.
    fn answer(&self, lab: &mut Lab) -> Result<ProbedLight> {
        let mask = self.mask.as_ref().map(|choice| choice.mask(lab)).transpose()?;
        let parts = mask.as_ref().map(Mask::parts).filter(|&parts| parts <= MOST_PARTS);
        let photos = self.photos.or(lab.photos_of_run()).or(parts).unwrap_or(100);
        lab.allow_photos(photos);
        let (resolution, seed) = (lab.resolution(), lab.seed());
        let projector = lab.projector_resolution();
        let probing = self.probing(projector);
        let mut operators = lab.operators(Part::Full)?;
        lab.expect(mask.as_ref().map_or(probing.photos(photos), |mask| mask.photos(photos)));
        let homes = if mask.is_some() { None } else { lab.homes()? };
        let one = |operator: &mut LabOperator| match &mask {
            Some(mask) => probe_masked(operator, mask, photos, seed),
            None => probe(operator, (projector, homes.as_deref()), probing, photos, seed),
        };
        let found = lab.photos(|_| operators.iter_mut().map(one).collect::<Result<Vec<_>>>())?;
        let matrices = lab.matrices_of(Part::Full)?;
        let exact = |matrix: &Csr| match &mask {
            Some(mask) => mask.exact(matrix),
            None => probing.exact(matrix, projector, homes.as_deref()),
        };
        let truth = matrices.map(|of| of.iter().map(exact).collect());
        let (name, paths) = match &self.mask {
            Some(choice) => (choice.to_string(), format!("light by the mask {choice}")),
            None => (
                self.paths.to_possible_value().map_or_else(String::new, |paths| paths.get_name().into()),
                probing.in_words(),
            ),
        };
        let method = match &mask {
            Some(mask) if mask.parts() <= photos => format!("{PARTS} {MASKED}"),
            Some(_) => format!("{RANDOM} Patterns that make most of the mask come before. {MASKED}"),
            None => RANDOM.into(),
        };
        Ok(ProbedLight::new([name, paths, method], resolution, found, truth))
    }
}

const RANDOM: &str = "Each random pattern is projected and, sign and all, multiplied into its photo; the mean of these is without bias, and its standard error falls with the square root of the photos.";
const PARTS: &str = "Each part of the mask is projected, and its photo is multiplied by the weights of this part; the sum of these is the photo under the mask.";
const MASKED: &str =
    "No light was blocked before the camera: masked light still brings its shot noise and its saturation.";

/// A probed photo in every channel.
#[derive(Clone, Debug)]
pub struct ProbedLight {
    /// The name of the light paths, or of the mask.
    pub name: String,
    /// The light paths that contribute, in words.
    pub paths: String,
    /// How the photos tell this light, in sentences.
    pub method: String,
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
        [name, paths, method]: [String; 3],
        resolution: Resolution,
        found: Vec<Probed>,
        truth: Option<Planes>,
    ) -> Self {
        let photos = found.first().map_or(0, |found| found.photos);
        let (values, standard_errors) =
            found.into_iter().map(|found| (found.values, found.standard_errors)).unzip();
        Self { name, paths, method, resolution, photos, values, standard_errors, truth }
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
        let (paths, noise) = (&self.paths, percentage(self.noise()));
        format!("{paths}, with a standard error of {noise}; {} photos", self.photos)
    }

    fn sentence(&self) -> String {
        let (paths, noise) = (&self.paths, percentage(self.noise()));
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
        content.detail("name", &self.name);
        content.fact("paths", &self.paths);
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
        let found = format!("no {} to measure: it is no more than its error", self.paths);
        vec![Finding::graded("light let through", Grade::Unmeasured, found, "", "")]
    }

    fn show(&self, _: &mut Lab, page: &mut AnswerPage<'_>) -> Result<()> {
        let image = |planes: &Planes| Image::from_planes(self.resolution, planes);
        let values = image(&self.values)?;
        let truth = self.truth.as_ref().map(image).transpose()?;
        let scale = exposure(truth.as_ref().unwrap_or(&values));
        let caption = format!("Let through: {}", self.paths);
        let mut figures = vec![page.light("probed", &values, scale, caption)];
        if let Some(truth) = &truth {
            figures.push(page.light("exact", truth, scale, "The same from the matrix itself"));
            figure::flip(&mut figures, &["probed", "exact"]);
        }
        let errors = image(&self.standard_errors)?;
        page.files.later("standard-error.npy", move |path| picture::write(path, &errors));
        figures.push(page.errors(&self.standard_errors, "Standard error")?);
        if let Some(truth) = &self.truth {
            figures.push(page.difference(&self.values, truth, "Found less exact")?);
        }
        let text = format!("Under an all-ones pattern, in {}. {}", page.unit, self.method);
        page.section("What is let through", text, [Block::Figures(figures)]);
        page.contact_sheet("")?;
        page.fact("Paths", &self.paths);
        Ok(())
    }
}
