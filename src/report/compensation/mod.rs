//! Files and report page of a light transport compensation.

mod figures;

use std::fmt::Write;
use std::path::Path;

use figures::rows;

use super::colormap::robust_range;
use super::contact_sheet::ContactSheet;
use super::html::{Block, Figure, Outcome, Report, Section, Verdict};
use super::run::{self, Files};
use super::{figure, residuals};
use crate::analysis::{Compensation, MethodRun};
use crate::error::Result;
use crate::image::Image;
use crate::io::tone::exposure;
use crate::io::{atomic, picture};
use crate::measure::RunManifest;

/// A finished compensation and the context that its report needs.
#[derive(Clone, Debug)]
pub struct CompensationRun<'a> {
    /// The page's title.
    pub title: String,
    /// The result.
    pub found: &'a Compensation,
    /// The method's name.
    pub method: &'a str,
    /// The smallest pattern value that was allowed.
    pub floor: f64,
    /// Optional results.
    pub extras: CompensationExtras<'a>,
    /// Unit of the photos' values.
    pub unit: &'a str,
    /// Contact sheet of all photos; `None` if a model answered without photos.
    pub strip: Option<&'a ContactSheet>,
}

/// Optional results; empty by default.
#[derive(Clone, Copy, Debug, Default)]
pub struct CompensationExtras<'a> {
    /// Residuals of every method at equal photo counts.
    pub methods: &'a [MethodRun],
    /// The target's values were mapped to [`lift`, 1].
    pub lift: f64,
}

impl CompensationRun<'_> {
    /// Writes arrays, pictures, `residuals.csv` and `report.html` into `folder` and returns their names. `seconds` is the run's
    /// duration so far.
    ///
    /// The `.png` of the compensation holds the pattern itself (sRGB, readable as a pattern). The `.png` files of the target, the
    /// observed and the uncompensated photo share one exposure.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, folder: &Path, manifest: &RunManifest, seconds: f64) -> Result<Vec<String>> {
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
        if let Some(clamping) = &found.clamping {
            let displayed = residuals::csv("photo", &rows(&clamping.displayed));
            atomic::write_bytes(&files.path("residuals-displayed.csv"), displayed.as_bytes())?;
        }
        if !self.extras.methods.is_empty() {
            let text = figures::csv(self.extras.methods);
            atomic::write_bytes(&files.path("methods.csv"), text.as_bytes())?;
        }
        let figures = pictures.into_iter().map(|(_, figure)| figure).collect();
        self.page(figures, manifest, seconds)?.write(&files.path("report.html"))?;
        Ok(files.names)
    }

    /// The result in one or two sentences.
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
        if let Some(ssim) = found.similarity.ssim {
            let _ = write!(text, " PSNR {:.2} dB, SSIM {ssim:.4}.", found.similarity.psnr);
        }
        if let Some(warning) = found.clamping.as_ref().and_then(crate::analysis::Clamping::warning) {
            let _ = write!(text, " Warning: {warning}.");
        }
        text
    }

    fn pictures(&self) -> Result<Vec<(&'static str, Figure)>> {
        let found = self.found;
        let plain = |image: &Image, scale: f32, caption: String| -> Result<Figure> {
            figure::light(image, scale, self.unit, caption)
        };
        let scale = exposure(&found.target);
        let mut pictures = vec![
            ("target", plain(&found.target, scale, "The target".into())?),
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
            ("compensation", figure::pattern(&found.pattern, "What is projected")?),
        ];
        let errors = [&found.observed, &found.uncompensated].map(|photo| difference(photo, &found.target));
        let range = robust_range(&errors.concat(), None);
        let captions = ["Seen less the target", "Uncompensated less the target"];
        for ((error, caption), name) in errors.iter().zip(captions).zip(["error", "error-uncompensated"]) {
            pictures
                .push((name, figure::signed(found.target.resolution(), error, range, self.unit, caption)?));
        }
        Ok(pictures)
    }

    fn page(&self, figures: Vec<Figure>, manifest: &RunManifest, seconds: f64) -> Result<Report> {
        let found = self.found;
        let mut more = vec![
            ("Peak", format!("{:.5} {}", found.peak, self.unit)),
            ("Photos before the method's", found.preparation.to_string()),
        ];
        let lift = self.extras.lift;
        more.extend((lift > 0.0).then(|| ("Target moved to", format!("[{lift}, 1]"))));
        let mut sections = vec![Section {
            title: "Seen and projected".into(),
            text: "Photos are developed alike. Errors are of all channels together.".into(),
            blocks: vec![Block::Figures(figures), figures::similarity(self)],
        }];
        // A run that is answered by a model has no photos, hence no convergence history.
        if !found.history.is_empty() {
            sections.push(figures::convergence(self));
        }
        sections.extend(found.clamping.as_ref().map(|clamping| figures::clamping(self, clamping)));
        if !self.extras.methods.is_empty() {
            sections.push(figures::methods(self, self.extras.methods));
        }
        if let Some(strip) = self.strip {
            sections.extend(strip.section(self.unit, ORDER)?);
        }
        Ok(Report {
            title: self.title.clone(),
            verdict: Verdict {
                outcome: if found.good { Outcome::Good } else { Outcome::Short },
                sentence: self.sentence(),
            },
            facts: run::facts(manifest, found.photos, more, seconds),
            sections,
            footer: manifest.command.join(" "),
        })
    }
}

/// Explains the order of the photos.
const ORDER: &str = "White comes first, then those that measure a preconditioner, if any, then those of the method; those that only show or compare (the result, the uncompensated target, other methods) come last.";

/// The mean of `a − b` over the channels, for each pixel.
fn difference(a: &Image, b: &Image) -> Vec<f64> {
    let channels = a.channels();
    let pixels = a.samples().chunks_exact(channels).zip(b.samples().chunks_exact(channels));
    pixels
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| f64::from(a - b)).sum::<f64>() / channels as f64)
        .collect()
}
