//! Captures of others as a run: a model of the light transport, and how well it predicts a photo that it never saw.

use std::path::Path;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::analysis::LowRank;
use crate::analysis::captures::{CapturedLight, LeftOut, Prior};
use crate::error::{Error, Result};
use crate::finding::{Finding, Grade, Ratio};
use crate::image::Image;
use crate::io::raster::exposure;
use crate::lab::text::decimal;
use crate::lab::{Answer, ChannelChoice, Lab, Verb};
use crate::report::content::Content;
use crate::report::figure;
use crate::report::html::Block;
use crate::report::run::AnswerPage;
use crate::report::text::percentage;
use crate::transport::Channels;

/// Import a folder of captures that other programs took: patterns, photos, and a captures.toml that says what they are
///
/// A model of the light transport is fitted to the captures. One photo of five is left out and predicted. The run's folder keeps the
/// model, and every verb answers from it without a photo.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[command(
    after_help = "Examples:\n  krylux import captures -o out/imported\n  krylux relight out/imported --pattern checker:4"
)]
pub struct Import {
    /// One gray system, or red, green and blue as three [default: as the photos are]
    #[arg(long, value_enum)]
    #[serde(skip)]
    pub channels: Option<Channels>,
}

impl Verb for Import {
    const NAME: &'static str = "import";
    const IS_CHECKED: bool = false;
    type Answer = Imported;

    fn channels(&self, _: &Path) -> Result<ChannelChoice> {
        Ok(self.channels.map_or(ChannelChoice::Native, Into::into))
    }

    fn check_on(&self, lab: &Lab) -> Result<()> {
        captured(lab).map(drop)
    }

    fn answer(&self, lab: &mut Lab) -> Result<Imported> {
        Ok(Imported { light: Arc::clone(captured(lab)?) })
    }
}

fn captured(lab: &Lab) -> Result<&Arc<CapturedLight>> {
    lab.captured().ok_or_else(|| {
        Error::option("SOURCE", format!("{} is no folder of captures", lab.name())).help(
            "give a folder with a captures.toml that names the patterns and the photos; the guide shows one",
        )
    })
}

/// Captures, the model that was fitted to them, and its prediction of photos that were left out.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The captures and their fit.
    pub light: Arc<CapturedLight>,
}

/// A prediction counts as good if its error is at most this multiple of the noise of a photo.
const OF_NOISE: f64 = 1.5;

/// A model fails if its error is above this multiple of that of the mean photo, each row's average entry times the light of the pattern. A
/// model of photos that do not belong to their patterns has about the error of the mean photo.
const OF_MEAN: f64 = 0.7;

/// Stated errors count as right if the errors of the photos that were left out are within these multiples of them.
const STATED: [f64; 2] = [0.6, 1.6];

/// Stated errors fail if the errors are above this multiple of them.
const FALSE: f64 = 3.0;

impl Imported {
    /// The number of photos.
    fn count(&self) -> usize {
        self.light.captures.photos.len()
    }

    /// A root mean square over all channels.
    fn root(&self, of: impl Fn(&LeftOut) -> f64) -> f64 {
        let count = self.light.left_out.len();
        (self.light.left_out.iter().map(|channel| of(channel).powi(2)).sum::<f64>() / count.max(1) as f64)
            .sqrt()
    }

    /// A root mean square over all channels, relative to that of the photos that were left out.
    fn of_light(&self, of: impl Fn(&LeftOut) -> f64) -> Ratio {
        Ratio::of(self.root(of), self.root(|left| left.light), 0.0)
    }

    /// The error of a photo that was left out, relative to the photo.
    pub fn error(&self) -> Ratio {
        self.of_light(|of| of.error)
    }

    /// The noise of a photo, relative to the photo.
    pub fn noise(&self) -> Ratio {
        self.of_light(|of| of.noise)
    }

    /// The error of photos that were left out over their stated errors.
    pub fn z(&self) -> f64 {
        self.root(|left| left.z)
    }

    fn noise_is_known(&self) -> bool {
        self.light.captures.noise.is_some()
    }

    fn noise_in_words(&self) -> &'static str {
        if self.noise_is_known() {
            "by repeated takes"
        } else {
            "estimated by the fit, since no photo was repeated"
        }
    }
}

impl Answer for Imported {
    fn names(&self) -> [&'static str; 2] {
        [Import::NAME, "light transport from captures"]
    }

    fn photos(&self) -> usize {
        0
    }

    fn headline(&self) -> String {
        format!(
            "photos that were left out are predicted within {} (noise of a photo {}); {} captures",
            percentage(self.error()),
            percentage(self.noise()),
            self.count()
        )
    }

    fn sentence(&self) -> String {
        let left = self.light.left_out.first().map_or(0, |of| of.photos.len());
        format!(
            "{left} of {} photos were left out, and predicted within {} of their light. The noise of a photo is {}, {}.",
            self.count(),
            percentage(self.error()),
            percentage(self.noise()),
            self.noise_in_words()
        )
    }

    fn content(&self) -> Content<'_> {
        let mut content = Content::default();
        let light = &*self.light;
        content.fact("captures", self.count());
        content.fact("relative_error_left_out", self.error());
        content.fact("relative_noise", self.noise());
        content.fact("noise_is_measured", self.noise_is_known());
        content.fact("error_over_stated", self.z());
        content.fact("photos_left_out", light.left_out.first().map(|of| &of.photos));
        let posteriors = light.model.channels.iter().filter_map(LowRank::posterior);
        let priors: Vec<Prior> = posteriors.map(|posterior| posterior.state().prior).collect();
        content.fact("prior", priors);
        let checkerboards = light.model.captured_checkerboards();
        content.fact("checkerboards", checkerboards);
        if let Some([square, shifts]) = checkerboards {
            content.line(format_args!(
                "boards    checkerboards of {square} px at {shifts}×{shifts} places, for `separate`"
            ));
        }
        content.line(format_args!(
            "errors    {} times what is stated, in photos that were left out",
            decimal(self.z(), 2)
        ));
        content
    }

    fn findings(&self) -> Vec<Finding> {
        const PHOTOS: &str = "left-out photos";
        let help = "capture more patterns, or patterns of more kinds: coarse and fine, random and smooth";
        let by_mean = Ratio::of(self.root(|left| left.error), self.root(|left| left.by_mean), 0.0);
        let by_mean = by_mean.value().unwrap_or(f64::INFINITY);
        let mut found = vec![match (self.error().value(), self.noise().value(), self.noise_is_known()) {
            (Some(_), ..) if by_mean > OF_MEAN => {
                let found = format!("predicted with {} times the error of a mean photo", decimal(by_mean, 2));
                let help = "check that each photo belongs to its pattern, and the responses; or capture more patterns";
                Finding::graded(PHOTOS, Grade::Fails, found, format!("at most {OF_MEAN}"), help)
            }
            (Some(error), Some(noise), true) => {
                let ratio = error / noise;
                let found = format!("predicted within {} times the noise of a photo", decimal(ratio, 2));
                let expected = format!("at most {OF_NOISE}");
                Finding::at_most(PHOTOS, [ratio, 0.0, OF_NOISE], Grade::Warning, found, expected, help)
            }
            (Some(error), ..) => Finding::ok(PHOTOS, format!("predicted within {}", percentage(error))),
            _ => Finding::unmeasured(PHOTOS, "they are dark"),
        }];
        let z = self.z();
        let grade = match z {
            z if (STATED[0]..=STATED[1]).contains(&z) => Grade::Ok,
            z if z <= FALSE => Grade::Warning,
            _ => Grade::Fails,
        };
        let differ =
            format!("photos that were left out differ by {} times their stated errors", decimal(z, 2));
        let expected = format!("{} to {}", STATED[0], STATED[1]);
        let help = "the captures do not follow the model: check the responses, the exposures and the map";
        found.push(Finding::graded("stated errors", grade, differ, expected, help));
        if !self.noise_is_known() {
            let because = "no photo was repeated; the fit estimates it";
            found.push(Finding::unmeasured("noise of a photo", because));
        }
        found.extend(self.light.found.as_ref().map(|map| {
            let known = map.homes.iter().filter(|home| home.is_some()).count();
            let grade = if 2 * known >= map.lit && known > 0 { Grade::Ok } else { Grade::Warning };
            let found =
                format!("{known} of {} lit camera pixels have a projector pixel of their own", map.lit);
            let help = "direct light counts as smooth elsewhere; capture Gray codes, or give the map";
            Finding::graded("pixel map", grade, found, "at least half", help)
        }));
        found
    }

    fn show(&self, _: &mut Lab, page: &mut AnswerPage<'_>) -> Result<()> {
        let light = &*self.light;
        let folder = page.files.folder;
        page.files.names.extend(light.model.write(folder)?);
        page.unit.clone_from(&light.model.unit);
        page.strip = None;
        let Some(first) = light.left_out.first() else { return Ok(()) };
        for (at, &photo) in first.photos.iter().enumerate().take(SHOWN) {
            let planes = |of: &dyn Fn(usize) -> Vec<f64>| -> Vec<Vec<f64>> {
                (0..light.left_out.len()).map(of).collect()
            };
            let taken = planes(&|c| filled(&light.photos[c][photo]));
            let predicted = planes(&|c| light.left_out[c].predicted[at].clone());
            let [shown, told] =
                [&taken, &predicted].map(|planes| Image::from_planes(light.model.resolution, planes));
            let (shown, told) = (shown?, told?);
            let scale = exposure(&shown);
            let names = [format!("taken-{photo}"), format!("predicted-{photo}")];
            let mut figures = vec![
                page.light(&names[0], &shown, scale, "The photo"),
                page.light(&names[1], &told, scale, "As predicted without it"),
            ];
            figure::flip(&mut figures, &[&names[0], &names[1]]);
            figures.push(page.difference(&predicted, &taken, "Predicted less taken")?);
            let text = format!("Pattern {photo} of {}, counted from 0, in {}.", self.count(), page.unit);
            page.section(format!("Photo {photo}, left out"), text, [Block::Figures(figures)]);
        }
        page.fact("Captures", self.count());
        page.fact("Noise of a photo", format!("{}, {}", percentage(self.noise()), self.noise_in_words()));
        Ok(())
    }
}

/// The number of photos on the page that were left out.
const SHOWN: usize = 3;

/// A photo whose saturated samples have the value of its brightest one.
fn filled(photo: &[f64]) -> Vec<f64> {
    let brightest = photo.iter().copied().filter(|value| !value.is_nan()).fold(0.0, f64::max);
    photo.iter().map(|value| if value.is_nan() { brightest } else { *value }).collect()
}
