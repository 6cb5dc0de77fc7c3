//! The answer of a separation.

use std::fmt::Write;

use super::Separate;
use crate::analysis::planes::{Planes, norm, relative_error, relative_to, sum};
use crate::analysis::separate::{ComparisonRow, NearFar};
use crate::error::Result;
use crate::finding::{Finding, Grade, Ratio};
use crate::image::Resolution;
use crate::lab::text::{self, decimal};
use crate::lab::{Answer, Lab, Verb, Verified};
use crate::report::content::Content;
use crate::report::run::AnswerPage;
use crate::report::text::percentage;

/// Direct and global light under white, with the further results that were requested.
#[derive(Clone, Debug)]
pub struct Separated {
    /// The method and its settings in words.
    pub method: String,
    /// The method's name.
    pub name: &'static str,
    /// The resolution of all images.
    pub resolution: Resolution,
    /// The number of photos that the method took, without the photos for `near_far`.
    pub photos: usize,
    /// Light of one bounce.
    pub direct: Planes,
    /// Light of two or more bounces.
    pub global: Planes,
    /// The standard errors of `direct`, if the method knows them.
    pub standard_error: Option<Planes>,
    /// The standard errors of `global`, if the method knows them.
    pub global_error: Option<Planes>,
    /// The exact first bounce, if a simulator knows it and another method was used.
    pub truth: Option<Planes>,
    /// The second bounce, and the third and later ones.
    pub bounces: Option<[Planes; 2]>,
    /// Global light split by the distance that it travelled.
    pub near_far: Option<NearFar>,
    /// The errors of every method at several photo counts; may be empty.
    pub comparison: Vec<ComparisonRow>,
    /// The largest acceptable error of `direct`, if one is given.
    pub(super) max_error: Option<f64>,
}

pub(super) struct Layer<'a> {
    pub(super) file: &'static str,
    pub(super) attribute: &'static str,
    pub(super) planes: &'a Planes,
    pub(super) caption: String,
}

impl Separated {
    /// Exact direct and global light from a simulator.
    pub(super) fn exact(asked: &Separate, resolution: Resolution, [direct, global]: [Planes; 2]) -> Self {
        Self {
            method: "the simulator".into(),
            name: "exact",
            resolution,
            photos: 0,
            direct,
            global,
            standard_error: None,
            global_error: None,
            truth: None,
            bounces: None,
            near_far: None,
            comparison: Vec::new(),
            max_error: asked.max_error,
        }
    }

    /// The relative error of the direct light, if the truth is known.
    pub fn error(&self) -> Option<f64> {
        self.truth.as_ref().and_then(|truth| relative_error(&self.direct, truth).value())
    }

    /// The error of the direct light and the largest acceptable error, if the first exceeds the second.
    fn excess(&self) -> Option<[f64; 2]> {
        Some([self.error()?, self.max_error?]).filter(|[error, most]| error > most)
    }

    pub(super) fn layers(&self) -> Vec<Layer<'_>> {
        let layer = |[file, attribute]: [&'static str; 2], planes, caption: &str| Layer {
            file,
            attribute,
            planes,
            caption: caption.into(),
        };
        let mut layers = vec![
            layer(["direct", "direct"], &self.direct, "Direct light: one bounce"),
            layer(["global", "global_"], &self.global, "Global light: two bounces and more"),
        ];
        if let Some([second, rest]) = &self.bounces {
            layers.push(layer(["second", "second"], second, "The second bounce"));
            layers.push(layer(["rest", "rest"], rest, "Three bounces and more"));
        }
        if let Some(reach) = &self.near_far {
            let near = format!("Global light from near by, σ {} px", reach.sigma);
            layers.push(layer(["near-indirect", "near"], &reach.near, &near));
            layers.push(layer(["far-indirect", "far"], &reach.far, "Global light from farther away"));
        }
        if let Some(truth) = &self.truth {
            layers.push(layer(["exact", "truth"], truth, "The exact first bounce"));
        }
        layers
    }

    pub(super) fn standard_errors(&self) -> impl Iterator<Item = Layer<'_>> {
        let known = [
            ("standard-error", "standard_error", &self.standard_error, "direct"),
            ("standard-error-global", "global_error", &self.global_error, "global"),
        ];
        known.into_iter().filter_map(|(file, attribute, errors, whose)| {
            let caption = format!("Standard error of the {whose} light");
            Some(Layer { file, attribute, planes: errors.as_ref()?, caption })
        })
    }

    fn lines(&self, content: &mut Content<'_>) {
        content.line(format_args!("method    {}, {} photos", self.method, self.photos));
        if let Some(error) = self.error() {
            let error = text::percent(error);
            content.line(format_args!("direct    within {error} % of the exact first bounce"));
        }
        if let Some(reach) = &self.near_far {
            let error = reach.error.map(|error| format!(", error {} %", text::percent(error)));
            content.line(format_args!(
                "near      σ {} px, {} photos: noise {} %{}",
                reach.sigma,
                reach.photos,
                text::percent(reach.noise),
                error.unwrap_or_default()
            ));
        }
        for ComparisonRow { error, photos, setting, .. } in &self.comparison {
            let error = text::percent(*error);
            content.line(format_args!("compared  {error:>6} % with {photos:>3} photos: {setting}"));
        }
    }
}

impl Answer for Separated {
    fn names(&self) -> [&'static str; 2] {
        [Separate::NAME, "direct and global light"]
    }

    /// The number of photos, including those that separate near from far light.
    fn photos(&self) -> usize {
        self.photos + self.near_far.as_ref().map_or(0, |near_far| near_far.photos)
    }

    fn headline(&self) -> String {
        let share = Ratio::of(norm(&self.global), norm(&sum(&self.direct, &self.global)), 0.0);
        let direct = self.error().map(|error| format!("; direct light within {}", percentage(error)));
        let direct = direct.unwrap_or_default();
        let photos = if self.photos() > 0 { format!("{} photos", self.photos()) } else { "no photo".into() };
        format!("global light is {} of the light under white{direct}; {photos}", percentage(share))
    }

    fn sentence(&self) -> String {
        let share = Ratio::of(norm(&self.global), norm(&sum(&self.direct, &self.global)), 0.0);
        let photos = if self.photos > 0 { format!(", {} photos", self.photos) } else { String::new() };
        let mut text = format!(
            "By {}{photos}: global light is {} of all that is seen under white.",
            self.method,
            percentage(share)
        );
        if let Some(error) = self.error() {
            let _ =
                write!(text, " The direct light is within {} of the exact first bounce.", percentage(error));
        }
        if let (Some(direct), Some(global)) = (&self.standard_error, &self.global_error) {
            let [direct, global] = [(direct, &self.direct), (global, &self.global)]
                .map(|(errors, light)| percentage(relative_to(norm(errors), light, errors)));
            let _ = write!(text, " Standard errors: {direct} of the direct light, {global} of the global.");
        }
        text
    }

    fn content(&self) -> Content<'_> {
        let mut content = Content::default();
        for layer in self.layers().into_iter().chain(self.standard_errors()) {
            content.planes(layer.attribute, self.resolution, layer.planes);
        }
        let near_far = self.near_far.as_ref();
        content.fact("method", self.name);
        content.fact("photos", self.photos);
        content.fact("photos_near_far", near_far.map_or(0, |near_far| near_far.photos));
        content.fact("relative_error", self.error());
        content.fact("near_indirect_noise", near_far.map(|near_far| near_far.noise));
        content.fact("near_indirect_error", near_far.and_then(|near_far| near_far.error));
        content.fact("comparison", &self.comparison);
        content.detail("good", self.excess().is_none());
        self.lines(&mut content);
        if let Some([error, most]) = self.excess() {
            let error = decimal(error, 5);
            content.note(format_args!("the error of the direct light, {error}, is above {most}"));
        }
        content
    }

    /// Two findings: whether the global light exceeds its error, and whether the direct light is as accurate as requested.
    fn findings(&self) -> Vec<Finding> {
        let share = match &self.global_error {
            Some(errors) => relative_to(1.0, &self.global, errors),
            // Without known errors, the noise is the rounding of photos, which are computed in single precision.
            None => Ratio::of(
                1.0,
                norm(&self.global),
                f64::from(f32::EPSILON) * norm(&sum(&self.direct, &self.global)),
            ),
        };
        let mut findings = Vec::new();
        if share.value().is_none() {
            let found = "no global light to measure: it is no more than its error";
            findings.push(Finding::graded("global light", Grade::Unmeasured, found, "", ""));
        }
        findings.extend(self.max_error.map(|most| match self.error() {
            Some(error) => {
                let grade = if self.excess().is_none() { Grade::Ok } else { Grade::Fails };
                let found = format!("within {} of the exact first bounce", percentage(error));
                let expected = format!("within {}", percentage(most));
                Finding::graded("direct light", grade, found, expected, "give more photos, or another --by")
            }
            None => Finding::unmeasured("direct light", "there is none, or its true value is not known"),
        }));
        findings
    }

    fn verify(&mut self, lab: &mut Lab) -> Result<Option<Verified>> {
        let error = self.error().unwrap_or(0.0);
        Ok(lab.verify_separation(&self.direct, &self.global, error)?.map(Verified::from))
    }

    fn show(&self, _: &mut Lab, page: &mut AnswerPage<'_>) -> Result<()> {
        self.show_on(page)
    }
}
