//! Files and report page of a separation into direct and global light.

use std::fmt::Write;
use std::path::Path;

use super::colormap::robust_range;
use super::contact_sheet::ContactSheet;
use super::figure;
use super::html::{Block, Figure, Outcome, Report, Section, Verdict};
use super::planes::{difference, mean, percent};
use super::plot::{LinePlot, Series};
use super::run::{self, Files};
use crate::analysis::planes::{Planes, norm, relative_error, sum};
use crate::analysis::separate::{ComparisonRow, NearFar};
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::io::tone::exposure;
use crate::io::{atomic, picture};
use crate::measure::RunManifest;

/// A finished separation and the context that its report needs. All images are under an all-ones pattern.
#[derive(Clone, Debug)]
pub struct SeparationRun<'a> {
    /// The page's title.
    pub title: String,
    /// The method and its settings, in words.
    pub method: String,
    /// Number of photos of the method, without those of `reach`.
    pub photos: usize,
    /// Resolution of all images.
    pub resolution: Resolution,
    /// Unit of the values.
    pub unit: &'a str,
    /// Direct light: one bounce.
    pub direct: &'a Planes,
    /// Global light: two or more bounces.
    pub global: &'a Planes,
    /// Standard errors of `direct`, if the method estimates them.
    pub standard_error: Option<&'a Planes>,
    /// The exact first bounce, if a simulator knows it and another method was used.
    pub truth: Option<&'a Planes>,
    /// The second bounce, and the sum of the third and later ones.
    pub bounces: Option<&'a [Planes; 2]>,
    /// Global light, split by the distance it travelled.
    pub reach: Option<&'a NearFar>,
    /// Errors of every method at several photo counts; may be empty.
    pub comparison: &'a [ComparisonRow],
    /// Whether the result meets the requested accuracy.
    pub good: bool,
    /// Contact sheet of all photos.
    pub strip: &'a ContactSheet,
}

impl SeparationRun<'_> {
    /// Writes images, `errors.csv` and `report.html` into `folder` and returns their names. `seconds` is the run's duration so
    /// far. The `.png` files of direct and global light share one exposure.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, folder: &Path, manifest: &RunManifest, seconds: f64) -> Result<Vec<String>> {
        let mut files = Files::new(folder);
        let images = self.images()?;
        for (name, image, _) in &images {
            for extension in ["npy", "exr"] {
                picture::write(&files.path(&format!("{name}.{extension}")), image)?;
            }
        }
        if let Some(errors) = self.standard_error {
            let image = Image::from_planes(self.resolution, errors)?;
            picture::write(&files.path("standard-error.npy"), &image)?;
        }
        let white: Planes = sum(self.direct, self.global);
        let scale = exposure(&Image::from_planes(self.resolution, &white)?);
        let mut figures = Vec::new();
        for (name, image, caption) in &images {
            let figure = figure::light(image, scale, self.unit, caption.clone())?;
            atomic::write_bytes(&files.path(&format!("{name}.png")), &figure.png)?;
            figures.push(figure);
        }
        if !self.comparison.is_empty() {
            atomic::write_bytes(&files.path("errors.csv"), self.csv().as_bytes())?;
        }
        self.page(figures, manifest, seconds)?.write(&files.path("report.html"))?;
        Ok(files.names)
    }

    /// The result in one sentence.
    pub fn sentence(&self) -> String {
        let share = norm(self.global) / norm(&sum(self.direct, self.global));
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
        text
    }

    /// `‖direct − exact‖ / ‖exact‖`, if the exact first bounce is known.
    pub fn error(&self) -> Option<f64> {
        self.truth.map(|truth| relative_error(self.direct, truth))
    }

    /// All images with their file names and captions.
    fn images(&self) -> Result<Vec<(&'static str, Image, String)>> {
        let mut found = Vec::new();
        let mut add = |name, planes: &Planes, caption: String| -> Result<()> {
            found.push((name, Image::from_planes(self.resolution, planes)?, caption));
            Ok(())
        };
        add("direct", self.direct, "Direct light: one bounce".into())?;
        add("global", self.global, "Global light: two bounces and more".into())?;
        if let Some([second, rest]) = self.bounces {
            add("second", second, "The second bounce".into())?;
            add("rest", rest, "Three bounces and more".into())?;
        }
        if let Some(reach) = self.reach {
            let sigma = reach.sigma;
            add("near-indirect", &reach.near, format!("Global light from near by, σ {sigma} px"))?;
            add("far-indirect", &reach.far, "Global light from farther away".into())?;
        }
        if let Some(truth) = self.truth {
            add("exact", truth, "The exact first bounce".into())?;
        }
        Ok(found)
    }

    fn csv(&self) -> String {
        let mut text = "method,setting,photos,direct_error,global_error\n".to_owned();
        for row in self.comparison {
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{},\"{}\",{},{:e},{:e}",
                row.method, row.setting, row.photos, row.error, row.global_error
            );
        }
        text
    }

    fn page(&self, figures: Vec<Figure>, manifest: &RunManifest, seconds: f64) -> Result<Report> {
        let mut sections = vec![Section {
            title: "Where the light comes from".into(),
            text: format!("Under an all-ones pattern, in {}; all developed alike.", self.unit),
            blocks: vec![Block::Figures(figures)],
        }];
        let errors = self.error_figures()?;
        if !errors.is_empty() {
            sections.push(Section {
                title: "How right it is".into(),
                text: "Light that comes back to its own pixel, or to its neighbours, cannot be told from direct light by patterns.".into(),
                blocks: vec![Block::Figures(errors)],
            });
        }
        if !self.comparison.is_empty() {
            sections.push(self.compared());
        }
        sections.extend(self.strip.section(self.unit, ORDER)?);
        let mut more = vec![("Method", self.method.clone())];
        if let Some(reach) = self.reach {
            let mut text = format!("{} photos, noise {}", reach.photos, percent(reach.noise));
            if let Some(error) = reach.error {
                let _ = write!(text, ", error {}", percent(error));
            }
            more.push(("Near indirect light by probing", text));
        }
        Ok(Report {
            title: self.title.clone(),
            verdict: Verdict {
                outcome: if self.good { Outcome::Good } else { Outcome::Short },
                sentence: self.sentence(),
            },
            facts: run::facts(
                manifest,
                self.photos + self.reach.map_or(0, |reach| reach.photos),
                more,
                seconds,
            ),
            sections,
            footer: manifest.command.join(" "),
        })
    }

    fn error_figures(&self) -> Result<Vec<Figure>> {
        let mut figures = Vec::new();
        if let Some(truth) = self.truth {
            let error = difference(self.direct, truth);
            let range = robust_range(&error, None);
            let caption = "Direct light found less exact";
            figures.push(figure::signed(self.resolution, &error, range, self.unit, caption)?);
        }
        if let Some(errors) = self.standard_error {
            let errors = mean(errors);
            let caption = "Standard error of the direct light";
            figures.push(figure::amounts(self.resolution, &errors, self.unit, caption)?);
        }
        Ok(figures)
    }

    fn compared(&self) -> Section {
        let mut names: Vec<&'static str> = Vec::new();
        for row in self.comparison {
            if !names.contains(&row.method) {
                names.push(row.method);
            }
        }
        let points = |name: &str| {
            let rows = self.comparison.iter().filter(|row| row.method == name);
            rows.map(|row| (row.photos as f64, row.error)).collect()
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

/// Explains the order of the photos.
const ORDER: &str = "Those of the method come first, those that tell near from far last.";
