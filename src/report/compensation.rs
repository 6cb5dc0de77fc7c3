//! The files and the page of a light transport compensation.

use std::fmt::Write;
use std::path::Path;

use super::colormap::{paint_signed, robust_range};
use super::html::{Block, Figure, Legend, Outcome, Report, Section, Verdict};
use super::manifest::Manifest;
use super::run::{self, Files};
use super::tone::{develop, exposure};
use super::{atomic, picture, residuals};
use crate::analysis::{Compensation, CompensationRow};
use crate::error::Result;
use crate::image::Image;

/// A finished compensation with what belongs beside it.
#[derive(Clone, Debug)]
pub struct CompensationRun<'a> {
    /// The page's title.
    pub title: String,
    /// The result.
    pub found: &'a Compensation,
    /// The method's name.
    pub method: &'a str,
    /// The least that was to be projected.
    pub floor: f64,
}

impl CompensationRun<'_> {
    /// Writes arrays, pictures, `residuals.csv` and `report.html` into `folder`; `seconds` is what the run took so
    /// far. Returns the files' names.
    ///
    /// The `.png` of the compensation holds the pattern itself (sRGB, to be read back as such); those of target,
    /// observed and uncompensated photo are developed alike.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, folder: &Path, manifest: &Manifest, seconds: f64) -> Result<Vec<String>> {
        let mut files = Files::new(folder);
        let found = self.found;
        let mut images = vec![
            ("compensation", &found.pattern),
            ("observed", &found.observed),
            ("uncompensated", &found.uncompensated),
            ("target", &found.target),
        ];
        images.extend(found.unclipped.as_ref().map(|image| ("unclipped", image)));
        for (name, image) in images {
            for extension in ["npy", "exr"] {
                picture::write(&files.path(&format!("{name}.{extension}")), image)?;
            }
        }
        let pictures = self.pictures()?;
        for (name, figure) in &pictures {
            atomic::write_bytes(&files.path(&format!("{name}.png")), &figure.png)?;
        }
        atomic::write_bytes(
            &files.path("residuals.csv"),
            residuals::csv("photo", &rows(&found.history)).as_bytes(),
        )?;
        let figures = pictures.into_iter().map(|(_, figure)| figure).collect();
        self.page(figures, manifest, seconds).write(&files.path("report.html"))?;
        Ok(files.names)
    }

    /// How it ended, in one or two sentences.
    pub fn sentence(&self) -> String {
        let found = self.found;
        let mut text = format!(
            "{} photos by {}: {}. What is seen differs from the target by {:.4} of it, uncompensated by {:.4}.",
            found.photos, self.method, found.status, found.residual, found.uncompensated_residual
        );
        if found.unclipped.is_some() {
            let _ = write!(
                text,
                " The answer had to be clipped to [{}, 1]; before that its residual was {:.4}.",
                self.floor, found.unclipped_residual
            );
        }
        text
    }

    fn pictures(&self) -> Result<Vec<(&'static str, Figure)>> {
        let found = self.found;
        let plain = |image: &Image, scale: f32, caption: String| -> Result<Figure> {
            Ok(Figure { png: develop(image, scale).encode_png()?, caption, legend: Legend::None })
        };
        let scale = exposure(&found.target);
        let mut pictures = vec![
            ("target", plain(&found.target, scale, "What is wished".into())?),
            (
                "observed",
                plain(&found.observed, scale, format!("What is seen: residual {:.4}", found.residual))?,
            ),
            (
                "uncompensated",
                plain(
                    &found.uncompensated,
                    scale,
                    format!("Uncompensated: residual {:.4}", found.uncompensated_residual),
                )?,
            ),
            ("compensation", plain(&found.pattern, 1.0, "What is projected".into())?),
        ];
        let errors = [&found.observed, &found.uncompensated].map(|photo| difference(photo, &found.target));
        let range = robust_range(&errors.concat(), None);
        let captions = ["Seen less wished", "Uncompensated less wished"];
        for ((error, caption), name) in errors.iter().zip(captions).zip(["error", "error-uncompensated"]) {
            let figure = Figure {
                png: paint_signed(found.target.resolution(), error, None, range)?.encode_png()?,
                caption: format!("{caption}, W/(m² sr)"),
                legend: Legend::signed(range),
            };
            pictures.push((name, figure));
        }
        Ok(pictures)
    }

    fn page(&self, figures: Vec<Figure>, manifest: &Manifest, seconds: f64) -> Report {
        let found = self.found;
        let more = [
            ("Peak", format!("{:.5} W/(m² sr)", found.peak)),
            ("Photos before the method's", found.preparation.to_string()),
        ];
        Report {
            title: self.title.clone(),
            verdict: Verdict {
                outcome: if found.good { Outcome::Good } else { Outcome::Short },
                sentence: self.sentence(),
            },
            facts: run::facts(manifest, found.photos, more, seconds),
            sections: vec![
                Section {
                    title: "Seen and projected".into(),
                    text: "Photos are developed alike. Errors are of all channels together.".into(),
                    blocks: vec![Block::Figures(figures)],
                },
                Section {
                    title: "Convergence".into(),
                    text: "Residuals are relative to the light wished. The photos that show target and result, and those of the baseline, are not the method's and are not counted.".into(),
                    blocks: vec![self.convergence()],
                },
            ],
            footer: manifest.command.join(" "),
        }
    }

    fn convergence(&self) -> Block {
        let found = self.found;
        let (ours, theirs) = (rows(&found.history), rows(&found.baseline));
        let mut lines: Vec<(&str, &[residuals::Row])> = vec![(self.method, &ours)];
        if self.method != "jacobi" && !theirs.is_empty() {
            lines.push(("projected Jacobi", &theirs));
        }
        let mut marks = vec![(found.uncompensated_residual, "uncompensated".to_owned())];
        if found.unclipped.is_some() {
            marks.push((found.residual, "after clipping".to_owned()));
        }
        let caption = match found.unclipped {
            Some(_) => {
                "The least residual so far, of answers that are not clipped: what can be projected is worse, as marked."
            }
            None => "The least residual so far: what would be seen, had the photos ended there.",
        };
        residuals::plot("photos", &lines, marks, caption)
    }
}

fn rows(history: &[CompensationRow]) -> Vec<residuals::Row> {
    history.iter().map(|row| (row.photo, row.residual)).collect()
}

/// Pixel by pixel, the mean over the channels of `a − b`.
fn difference(a: &Image, b: &Image) -> Vec<f64> {
    let channels = a.channels();
    let pixels = a.samples().chunks_exact(channels).zip(b.samples().chunks_exact(channels));
    pixels
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| f64::from(a - b)).sum::<f64>() / channels as f64)
        .collect()
}
