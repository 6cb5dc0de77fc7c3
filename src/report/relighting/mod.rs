//! Files and report page of low-rank relighting.

mod curves;

use std::fmt::Write;
use std::path::Path;

use super::colormap::robust_range;
use super::contact_sheet::ContactSheet;
use super::figure;
use super::html::{Block, Figure, Outcome, Report, Section, Verdict};
use super::planes::{difference, percent};
use super::run::{self, Files};
use crate::analysis::low_rank::{Dual, RankRow, Reduced, Relit};
use crate::error::Result;
use crate::image::Image;
use crate::io::tone::exposure;
use crate::io::{atomic, picture};
use crate::measure::RunManifest;

/// Results of a low-rank model and the context that their report needs.
#[derive(Clone, Debug)]
pub struct RelightingRun<'a> {
    /// The page's title.
    pub title: String,
    /// Number of photos that this run took.
    pub photos: usize,
    /// Number of photos that the model was captured from.
    pub rank: usize,
    /// Unit of the values.
    pub unit: &'a str,
    /// Relit photos.
    pub relit: &'a [Relit],
    /// Dual photographs: the scene from the projector's viewpoint, lit from the camera.
    pub duals: &'a [Dual],
    /// Photos with their interreflections removed.
    pub reduced: &'a [Reduced],
    /// Error of the model against the true matrix for each rank; empty if the true matrix is unknown.
    pub curve: &'a [RankRow],
    /// Whether the result meets the requested accuracy.
    pub good: bool,
    /// Contact sheet of the capture; `None` if the model already existed.
    pub strip: Option<&'a ContactSheet>,
}

impl RelightingRun<'_> {
    /// Writes images, `error-curve.csv`, `relighting-errors.csv` and `report.html` into `folder` and returns their names.
    /// `seconds` is the run's duration so far. Relit and true photos share one exposure.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, folder: &Path, manifest: &RunManifest, seconds: f64) -> Result<Vec<String>> {
        let mut files = Files::new(folder);
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
        if let Some(strip) = self.strip {
            sections.extend(strip.section(self.unit, ORDER)?);
        }
        let more = [("Rank of the model", self.rank.to_string())];
        let report = Report {
            title: self.title.clone(),
            verdict: Verdict {
                outcome: if self.good { Outcome::Good } else { Outcome::Short },
                sentence: self.sentence(),
            },
            facts: run::facts(manifest, self.photos, more, seconds),
            sections,
            footer: manifest.command.join(" "),
        };
        report.write(&files.path("report.html"))?;
        Ok(files.names)
    }

    /// The result in one or two sentences.
    pub fn sentence(&self) -> String {
        let count = match self.relit.len() {
            1 => "1 pattern".to_owned(),
            count => format!("{count} patterns"),
        };
        let mut text = format!("A model from {} photos relit {count}", self.rank);
        if self.photos == 0 {
            text += " at no further photo";
        }
        match self.worst() {
            Some(worst) => {
                let _ = write!(text, ", at worst within {} of the true photo.", percent(worst));
            }
            None => text.push('.'),
        }
        if let Some(row) = self.curve.last()
            && let Some(optimal) = row.optimal
        {
            let _ = write!(
                text,
                " Its error as a matrix is {:.3} of the best that any matrix of that rank has.",
                row.error / optimal
            );
        }
        text
    }

    /// The largest error of all relit photos; `None` if no true photo is known.
    pub fn worst(&self) -> Option<f64> {
        self.relit.iter().filter_map(|relit| relit.errors.last().copied()).reduce(f64::max)
    }

    fn relit_section(&self, files: &mut Files<'_>) -> Result<Section> {
        let mut figures = Vec::new();
        for (index, relit) in self.relit.iter().enumerate() {
            let number = index + 1;
            let scale = exposure(relit.truth.as_ref().unwrap_or(&relit.relit));
            let pattern = figure::pattern(&relit.pattern, format!("Pattern {number}: {}", relit.name))?;
            atomic::write_bytes(&files.path(&format!("pattern-{number}.png")), &pattern.png)?;
            figures.push(pattern);
            let caption = match relit.errors.last() {
                Some(error) => format!("Relit {number}: within {}", percent(*error)),
                None => format!("Relit {number}"),
            };
            figures.push(self.image(files, &format!("relit-{number}"), &relit.relit, scale, caption)?);
            if let Some(truth) = &relit.truth {
                let caption = format!("True photo {number}");
                figures.push(self.image(files, &format!("true-{number}"), truth, scale, caption)?);
                figures.push(self.error(&relit.relit, truth, format!("Relit {number} less true"))?);
            }
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
            figures.push(figure::light(&reduced.photo, scale, self.unit, caption)?);
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
        figure::signed(found.resolution(), &error, robust_range(&error, None), self.unit, caption)
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
        for extension in ["npy", "exr"] {
            picture::write(&files.path(&format!("{name}.{extension}")), image)?;
        }
        let figure = figure::light(image, scale, self.unit, caption)?;
        atomic::write_bytes(&files.path(&format!("{name}.png")), &figure.png)?;
        Ok(figure)
    }
}

/// Explains the order of the photos.
const ORDER: &str = "White and smooth random patterns come first, then photos that are projected back. Direct light, which is kept apart, is not in them.";
