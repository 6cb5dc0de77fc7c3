//! The files and the report page of a separation into direct and global light.

use std::fmt::Write;

use super::Separated;
use super::answer::Layer;
use crate::analysis::planes::{Planes, sum};
use crate::analysis::separate::ComparisonRow;
use crate::error::Result;
use crate::finding::Ratio;
use crate::image::Image;
use crate::io::picture;
use crate::io::raster::exposure;
use crate::lab::Answer;
use crate::report::colormap::robust_range;
use crate::report::figure;
use crate::report::html::{Block, Figure, Report, Section};
use crate::report::planes::{difference, mean, percent};
use crate::report::plot::{LinePlot, Series};
use crate::report::run::{Files, Run};

impl Separated {
    /// Writes images, `errors.csv` and `report.html` into the run's folder and returns their names. The `.png` files of direct and global
    /// light share one exposure.
    pub(super) fn write_page(&self, run: &Run<'_>) -> Result<Vec<String>> {
        let mut files = Files::new(run.folder);
        let image = |planes| Image::from_planes(run.resolution, planes);
        let layers = self.layers().into_iter().map(|layer| Ok((image(layer.planes)?, layer)));
        let layers: Vec<(Image, Layer<'_>)> = layers.collect::<Result<_>>()?;
        for (image, layer) in &layers {
            files.image(layer.file, image)?;
        }
        for errors in self.standard_errors() {
            picture::write(&files.path(&format!("{}.npy", errors.file)), &image(errors.planes)?)?;
        }
        let white: Planes = sum(&self.direct, &self.global);
        let scale = exposure(&image(&white)?);
        let mut figures = Vec::new();
        for (image, Layer { file, caption, .. }) in layers {
            let figure = figure::light(&image, scale, run.unit, caption)?;
            files.picture(file, &figure)?;
            let figure = figure.named(file, format!("{file}.npy"));
            figures.push(match (file, &self.truth) {
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

    fn csv(&self) -> String {
        let mut text = "method,setting,photos,direct_error,global_error\n".to_owned();
        for row in &self.comparison {
            let field = |error: Ratio| error.value().map_or(String::new(), |error| format!("{error:e}"));
            let [direct, global] = [row.error, row.global_error].map(field);
            // Writing to a string cannot fail.
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
        Ok(run.page((self.findings(), self.sentence()), Answer::photos(self), more, sections))
    }

    fn error_figures(&self, run: &Run<'_>) -> Result<Vec<Figure>> {
        let mut figures = Vec::new();
        if let Some(truth) = &self.truth {
            let error = difference(&self.direct, truth);
            let range = robust_range(&error, None);
            let caption = "Direct light found less exact";
            figures.push(figure::signed(run.resolution, &error, range, run.unit, caption)?);
        }
        for errors in self.standard_errors() {
            let amounts = mean(errors.planes);
            figures.push(figure::amounts(run.resolution, &amounts, run.unit, errors.caption)?);
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

const ORDER: &str = "Those of the method come first, those that tell near from far last.";
