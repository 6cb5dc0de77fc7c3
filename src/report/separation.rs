//! Files and report page of a separation into direct and global light.

use std::fmt::Write;

use super::colormap::robust_range;
use super::figure;
use super::html::{Block, Figure, Report, Section};
use super::planes::{difference, mean, percent};
use super::plot::{LinePlot, Series};
use super::run::{Files, Run};
use crate::analysis::planes::{Planes, norm, relative_error, relative_to, sum};
use crate::analysis::separate::{ComparisonRow, NearFar};
use crate::error::Result;
use crate::finding::{Finding, Grade, Ratio};
use crate::image::{Image, Resolution};
use crate::io::picture;
use crate::io::raster::exposure;

/// Direct and global light under an all-ones pattern, with what was asked beside it.
#[derive(Clone, Debug)]
pub struct Separated {
    /// The method with its setting, in words.
    pub method: String,
    /// The method's name.
    pub name: &'static str,
    /// Photos that the method took; those of `near_far` are beside them.
    pub photos: usize,
    /// One bounce.
    pub direct: Planes,
    /// Two bounces and more.
    pub global: Planes,
    /// Standard errors of `direct`, where the method knows them.
    pub standard_error: Option<Planes>,
    /// Standard errors of `global`, where the method knows them.
    pub global_error: Option<Planes>,
    /// The exact first bounce, where a simulator knows it and the method is another.
    pub truth: Option<Planes>,
    /// The second bounce, and three and more.
    pub bounces: Option<[Planes; 2]>,
    /// Global light by how far it went.
    pub near_far: Option<NearFar>,
    /// Every method at several photo counts; may be empty.
    pub comparison: Vec<ComparisonRow>,
    /// The largest error of `direct` that is good enough, where there is one.
    pub max_error: Option<f64>,
}

impl Separated {
    /// The relative error of the direct light, where the truth is known.
    pub fn error(&self) -> Option<f64> {
        self.truth.as_ref().and_then(|truth| relative_error(&self.direct, truth).value())
    }

    /// Whether it is as good as was asked for.
    pub fn is_good(&self) -> bool {
        match (self.max_error, self.error()) {
            (Some(most), Some(error)) => error <= most,
            _ => true,
        }
    }

    /// Whether there is global light beyond its error, and whether the direct light is as good as was asked for.
    pub fn findings(&self) -> Vec<Finding> {
        let share = match &self.global_error {
            Some(errors) => relative_to(1.0, &self.global, errors),
            // Photos are products of numbers of single precision.
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
                let grade = if self.is_good() { Grade::Ok } else { Grade::Fails };
                let found = format!("within {} of the exact first bounce", percent(error));
                let expected = format!("within {}", percent(most));
                Finding::graded("direct light", grade, found, expected, "give more photos, or another --by")
            }
            None => Finding::unmeasured("direct light", "there is none, or its true value is not known"),
        }));
        findings
    }

    /// Writes images, `errors.csv` and `report.html` into the run's folder and returns their names. The `.png` files of direct and
    /// global light share one exposure.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, run: &Run<'_>) -> Result<Vec<String>> {
        let mut files = Files::new(run.folder);
        let images = self.images(run.resolution)?;
        for (name, image, _) in &images {
            files.image(name, image)?;
        }
        for (name, errors) in self.standard_errors() {
            let image = Image::from_planes(run.resolution, errors)?;
            picture::write(&files.path(name), &image)?;
        }
        let white: Planes = sum(&self.direct, &self.global);
        let scale = exposure(&Image::from_planes(run.resolution, &white)?);
        let mut figures = Vec::new();
        for (name, image, caption) in &images {
            let figure = figure::light(image, scale, run.unit, caption.clone())?;
            files.picture(name, &figure)?;
            let figure = figure.named(*name, format!("{name}.npy"));
            figures.push(match (*name, &self.truth) {
                ("direct", Some(_)) => figure.flipped_with(["exact"]),
                ("exact", _) => figure.flipped_with(["direct"]),
                _ => figure,
            });
        }
        if !self.comparison.is_empty() {
            files.text("errors.csv", &self.csv())?;
        }
        files.finish(self.page(run, figures)?)
    }

    /// The standard errors that are known, with the names of their files.
    fn standard_errors(&self) -> impl Iterator<Item = (&'static str, &Planes)> {
        let known = [("standard-error.npy", &self.standard_error), (GLOBAL_ERROR, &self.global_error)];
        known.into_iter().filter_map(|(name, errors)| Some((name, errors.as_ref()?)))
    }

    /// The standard errors of direct and of global light over all pixels, relative to each light, where they are known.
    pub fn relative_errors(&self) -> Option<[Ratio; 2]> {
        let (direct, global) = (self.standard_error.as_ref()?, self.global_error.as_ref()?);
        Some(
            [(direct, &self.direct), (global, &self.global)]
                .map(|(errors, light)| relative_to(norm(errors), light, errors)),
        )
    }

    /// The photos of the method, and those that tell near from far.
    pub fn all_photos(&self) -> usize {
        self.photos + self.near_far.as_ref().map_or(0, |near_far| near_far.photos)
    }

    /// The result in one sentence.
    pub fn sentence(&self) -> String {
        let share = Ratio::of(norm(&self.global), norm(&sum(&self.direct, &self.global)), 0.0);
        let mut text = format!(
            "By {}{}: global light is {} of all that is seen under white.",
            self.method,
            match self.photos {
                0 => String::new(),
                photos => format!(", {photos} photos"),
            },
            percent(share)
        );
        if let Some(error) = self.error() {
            let _ = write!(text, " The direct light is within {} of the exact first bounce.", percent(error));
        }
        if let Some([direct, global]) = self.relative_errors() {
            let _ = write!(
                text,
                " Standard errors: {} of the direct light, {} of the global.",
                percent(direct),
                percent(global)
            );
        }
        text
    }

    /// All images with their file names and captions.
    fn images(&self, resolution: Resolution) -> Result<Vec<(&'static str, Image, String)>> {
        let mut found = Vec::new();
        let mut add = |name, planes: &Planes, caption: String| -> Result<()> {
            found.push((name, Image::from_planes(resolution, planes)?, caption));
            Ok(())
        };
        add("direct", &self.direct, "Direct light: one bounce".into())?;
        add("global", &self.global, "Global light: two bounces and more".into())?;
        if let Some([second, rest]) = &self.bounces {
            add("second", second, "The second bounce".into())?;
            add("rest", rest, "Three bounces and more".into())?;
        }
        if let Some(reach) = &self.near_far {
            let sigma = reach.sigma;
            add("near-indirect", &reach.near, format!("Global light from near by, σ {sigma} px"))?;
            add("far-indirect", &reach.far, "Global light from farther away".into())?;
        }
        if let Some(truth) = &self.truth {
            add("exact", truth, "The exact first bounce".into())?;
        }
        Ok(found)
    }

    fn csv(&self) -> String {
        let mut text = "method,setting,photos,direct_error,global_error\n".to_owned();
        for row in &self.comparison {
            // Writing to a string cannot fail.
            // A field is empty where there is nothing to measure.
            let field = |error: Ratio| error.value().map_or(String::new(), |error| format!("{error:e}"));
            let [direct, global] = [row.error, row.global_error].map(field);
            let _ = writeln!(text, "{},\"{}\",{},{direct},{global}", row.method, row.setting, row.photos);
        }
        text
    }

    fn page(&self, run: &Run<'_>, figures: Vec<Figure>) -> Result<Report> {
        let mut sections = vec![Section {
            title: "Where the light comes from".into(),
            text: format!("Under an all-ones pattern, in {}; all developed alike.", run.unit),
            blocks: vec![Block::Figures(figures)],
        }];
        let errors = self.error_figures(run)?;
        if !errors.is_empty() {
            sections.push(Section {
                title: "How right it is".into(),
                text: "Light that comes back to its own pixel, or to its neighbours, cannot be distinguished from direct light by patterns.".into(),
                blocks: vec![Block::Figures(errors)],
            });
        }
        if !self.comparison.is_empty() {
            sections.push(self.compared());
        }
        sections.extend(run.photos(ORDER)?);
        let mut more = vec![("Method", self.method.clone())];
        if let Some(reach) = &self.near_far {
            let mut text = format!("{} photos, noise {}", reach.photos, percent(reach.noise));
            if let Some(error) = reach.error {
                let _ = write!(text, ", error {}", percent(error));
            }
            more.push(("Near indirect light by probing", text));
        }
        Ok(run.page((self.findings(), self.sentence()), self.all_photos(), more, sections))
    }

    fn error_figures(&self, run: &Run<'_>) -> Result<Vec<Figure>> {
        let mut figures = Vec::new();
        if let Some(truth) = &self.truth {
            let error = difference(&self.direct, truth);
            let range = robust_range(&error, None);
            let caption = "Direct light found less exact";
            figures.push(figure::signed(run.resolution, &error, range, run.unit, caption)?);
        }
        for (name, errors) in self.standard_errors() {
            let errors = mean(errors);
            let whose = if name == GLOBAL_ERROR { "global" } else { "direct" };
            let caption = format!("Standard error of the {whose} light");
            figures.push(figure::amounts(run.resolution, &errors, run.unit, caption)?);
        }
        Ok(figures)
    }

    fn compared(&self) -> Section {
        let mut names: Vec<&'static str> = Vec::new();
        for row in &self.comparison {
            if !names.contains(&row.method) {
                names.push(row.method);
            }
        }
        let points = |name: &str| {
            let rows = self.comparison.iter().filter(|row| row.method == name);
            rows.filter_map(|row| Some((row.photos as f64, row.error.value()?))).collect()
        };
        let plot = LinePlot {
            x_label: "photos".into(),
            y_label: "relative error of the direct light".into(),
            logarithmic: true,
            series: names.iter().map(|name| Series { name: (*name).into(), points: points(name) }).collect(),
            marks: Vec::new(),
        };
        let row = |row: &ComparisonRow| {
            vec![row.setting.clone(), row.photos.to_string(), percent(row.error), percent(row.global_error)]
        };
        let table = Block::Table {
            headers: ["method", "photos", "direct", "global"].map(String::from).to_vec(),
            rows: self.comparison.iter().map(row).collect(),
            caption: "Errors of direct and global light, relative to the exact ones".into(),
        };
        Section {
            title: "Every method at several photo counts".into(),
            text: "Against the exact first bounce. Random patterns are right on average for the light that comes back to its own pixel, and their noise falls with more of them; checkerboards and sinusoids keep what is as sharp as they are; the patterns of one capture all carry the signs of its start, so that more of them hardly help.".into(),
            blocks: vec![Block::Plot { svg: plot.render(), caption: String::new() }, table],
        }
    }
}

/// The file of the standard errors of global light.
const GLOBAL_ERROR: &str = "standard-error-global.npy";

/// Explains the order of the photos.
const ORDER: &str = "Those of the method come first, those that tell near from far last.";
