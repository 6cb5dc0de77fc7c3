//! The files and the report page of low-rank relighting.

use std::fmt::Write;

use super::Relighting;
use crate::analysis::low_rank::{RankRow, Relit};
use crate::error::Result;
use crate::image::Image;
use crate::io::raster::exposure;
use crate::lab::Answer;
use crate::report::colormap::robust_range;
use crate::report::figure;
use crate::report::html::{Block, Figure, Section};
use crate::report::planes::{difference, percent};
use crate::report::plot::{LinePlot, Series};
use crate::report::run::{Files, Run};

impl Relighting {
    /// Writes images, `error-curve.csv`, `relighting-errors.csv` and `report.html` into the run's folder and returns
    /// their names. Relit and true photos share one exposure.
    pub(super) fn write_page(&self, run: &Run<'_>) -> Result<Vec<String>> {
        let mut files = Files::new(run.folder);
        let mut sections = vec![self.relit_section(&mut files)?];
        if !self.curve.is_empty() {
            sections.push(self.curve_section(&mut files)?);
        }
        if !self.reduced.is_empty() {
            sections.push(self.reduced_section(&mut files)?);
        }
        if !self.duals.is_empty() {
            sections.push(self.dual_section(&mut files)?);
        }
        sections.extend(run.photos(ORDER)?);
        let more = [("Rank of the model", self.model.rank().to_string())];
        files.finish(run.page((self.findings(), self.sentence()), self.photos, more, sections))
    }

    fn relit_section(&self, files: &mut Files<'_>) -> Result<Section> {
        let mut figures = Vec::new();
        for (index, relit) in self.relit.iter().enumerate() {
            let number = index + 1;
            let scale = exposure(relit.truth.as_ref().unwrap_or(&relit.relit));
            let pattern = figure::pattern(&relit.pattern, format!("Pattern {number}: {}", relit.name))?
                .named(format!("pattern-{number}"), String::new());
            files.picture(&format!("pattern-{number}"), &pattern)?;
            figures.push(pattern);
            let caption = match relit.errors.last() {
                Some(error) => format!("Relit {number}: within {}", percent(*error)),
                None => format!(
                    "Relit {number}: about {} off, by what the photos leave open",
                    percent(relit.stated)
                ),
            };
            let [own, other] = ["relit", "true"].map(|name| format!("{name}-{number}"));
            let found = self.image(files, &own, &relit.relit, scale, caption)?;
            let Some(truth) = &relit.truth else {
                figures.push(found);
                continue;
            };
            let error = self.error(&relit.relit, truth, format!("Relit {number} less true"))?;
            let caption = format!("True photo {number}");
            let truth = self.image(files, &other, truth, scale, caption)?.flipped_with([&own]);
            figures.extend([found.flipped_with([&other]), truth, error]);
        }
        let mut blocks = vec![Block::Figures(figures)];
        if self.relit.iter().any(|relit| relit.errors.len() > 1) {
            blocks.push(self.errors_by_rank(files)?);
        }
        Ok(Section {
            title: "Relit".into(),
            text: "Direct light is kept apart, and exact; of global light the model knows what its photos told it. No photo of these patterns was taken for it.".into(),
            blocks,
        })
    }

    fn reduced_section(&self, files: &mut Files<'_>) -> Result<Section> {
        let mut figures = Vec::new();
        for (index, reduced) in self.reduced.iter().enumerate() {
            let number = index + 1;
            let scale = exposure(&reduced.photo);
            let caption = format!("Photo {number}: {}", reduced.name);
            figures.push(figure::light(&reduced.photo, scale, &self.model.unit, caption)?);
            let caption = match reduced.error {
                Some(error) => format!("Direct light alone {number}: within {}", percent(error)),
                None => format!("Direct light alone {number}"),
            };
            let name = format!("direct-only-{number}");
            figures.push(self.image(files, &name, &reduced.direct, scale, caption)?);
            if let Some(truth) = &reduced.truth {
                let caption = format!("True direct light {number}");
                let name = format!("direct-only-true-{number}");
                figures.push(self.image(files, &name, truth, scale, caption)?);
                let caption = format!("Direct light {number} less true");
                figures.push(self.error(&reduced.direct, truth, caption)?);
            }
        }
        Ok(Section {
            title: "Without interreflections".into(),
            text: "A photo taken under an unknown pattern, and what it would be if light bounced only once: D A⁻¹ y, by the model.".into(),
            blocks: vec![Block::Figures(figures)],
        })
    }

    fn dual_section(&self, files: &mut Files<'_>) -> Result<Section> {
        let mut figures = Vec::new();
        for (index, dual) in self.duals.iter().enumerate() {
            let number = index + 1;
            let caption = match dual.error {
                Some(error) => format!("Lit from the camera by {}: within {}", dual.name, percent(error)),
                None => format!("Lit from the camera by {}", dual.name),
            };
            let scale = exposure(&dual.image);
            figures.push(self.image(files, &format!("dual-{number}"), &dual.image, scale, caption)?);
        }
        Ok(Section {
            title: "Dual photographs".into(),
            text: "The scene as the projector would see it, were it the camera: Aᵀ y. Of a coaxial rig this is what the camera sees.".into(),
            blocks: vec![Block::Figures(figures)],
        })
    }

    fn error(&self, found: &Image, truth: &Image, caption: String) -> Result<Figure> {
        let error = difference(&found.planes(), &truth.planes());
        figure::signed(found.resolution(), &error, robust_range(&error, None), &self.model.unit, caption)
    }

    /// Writes an image in all three formats; `scale` is the exposure of the `.png`.
    fn image(
        &self,
        files: &mut Files<'_>,
        name: &str,
        image: &Image,
        scale: f32,
        caption: String,
    ) -> Result<Figure> {
        files.image(name, image)?;
        let figure = figure::light(image, scale, &self.model.unit, caption)?;
        files.picture(name, &figure)?;
        Ok(figure.named(name, format!("{name}.npy")))
    }

    /// The error of each relit photo after each photo of the capture.
    fn errors_by_rank(&self, files: &mut Files<'_>) -> Result<Block> {
        let known: Vec<(usize, &Relit)> =
            self.relit.iter().enumerate().filter(|(_, relit)| relit.errors.len() > 1).collect();
        let mut csv = "photos".to_owned();
        for (index, _) in &known {
            // Writing to a string cannot fail.
            let _ = write!(csv, ",pattern_{}", index + 1);
        }
        csv.push('\n');
        for photos in 0..self.model.rank() {
            let _ = write!(csv, "{}", photos + 1);
            for (_, relit) in &known {
                let error = relit.errors.get(photos.min(relit.errors.len() - 1)).copied();
                let _ = write!(csv, ",{:e}", error.unwrap_or(f64::NAN));
            }
            csv.push('\n');
        }
        files.text("relighting-errors.csv", &csv)?;
        let series = |(index, relit): &(usize, &Relit)| Series {
            name: format!("{}: {}", index + 1, short(&relit.name)),
            points: relit.errors.iter().enumerate().map(|(k, &error)| ((k + 1) as f64, error)).collect(),
        };
        let plot = LinePlot {
            x_label: "photos".into(),
            y_label: "relative error of the photo".into(),
            logarithmic: true,
            series: known.iter().map(series).collect(),
            marks: Vec::new(),
        };
        let caption = "The relit photos' errors, had the capture ended after so many photos.";
        Ok(Block::Plot { svg: plot.render(), caption: caption.into() })
    }

    /// The error of the model matrix after each photo.
    fn curve_section(&self, files: &mut Files<'_>) -> Result<Section> {
        let mut csv = "photos,error,one_sided_error,optimal_error\n".to_owned();
        for row in &self.curve {
            let optimal = row.optimal.map_or_else(String::new, |optimal| format!("{optimal:e}"));
            let _ = writeln!(csv, "{},{:e},{:e},{optimal}", row.photos, row.error, row.one_sided);
        }
        files.text("error-curve.csv", &csv)?;
        let line = |name: &str, of: fn(&RankRow) -> Option<f64>| Series {
            name: name.into(),
            points: self.curve.iter().filter_map(|row| Some((row.photos as f64, of(row)?))).collect(),
        };
        let plot = LinePlot {
            x_label: "photos (rank)".into(),
            y_label: "relative error of global light, Frobenius norm".into(),
            logarithmic: true,
            series: vec![
                line("the model", |row| Some(row.error)),
                line("W Qᵀ alone", |row| Some(row.one_sided)),
                line("the best of this rank", |row| row.optimal),
            ],
            marks: Vec::new(),
        };
        let marked = |row: &&RankRow| {
            [1, 2, 5, 10, 20, 40, 80, 160].contains(&row.photos) || row.photos == self.curve.len()
        };
        let row = |row: &RankRow| {
            vec![
                row.photos.to_string(),
                percent(row.error),
                percent(row.one_sided),
                row.optimal.map_or_else(|| "–".into(), percent),
                row.optimal.map_or_else(|| "–".into(), |optimal| format!("{:.3}", row.error / optimal)),
            ]
        };
        let table = Block::Table {
            headers: ["photos", "the model", "W Qᵀ alone", "best of this rank", "ratio to the best"]
                .map(String::from)
                .to_vec(),
            rows: self.curve.iter().filter(marked).map(row).collect(),
            caption: "Errors of the global part of the matrix, relative to it, in the Frobenius norm".into(),
        };
        Ok(Section {
            title: "Error by rank".into(),
            text: "Against the true matrix, whose own sampling noise has no low rank: no model comes near 0 here, and what counts is the ratio to the best one (by singular values).".into(),
            blocks: vec![Block::Plot { svg: plot.render(), caption: String::new() }, table],
        })
    }
}

const ORDER: &str = "White and smooth random patterns come first, then photos that are projected back. Direct light, which is kept apart, is not in them.";

fn short(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}
