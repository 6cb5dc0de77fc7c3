//! Files and report page of a light transport compensation.

mod figures;

use std::fmt::Write;

use figures::rows;

use super::colormap::robust_range;
use super::html::{Block, Figure, Report, Section};
use super::run::{Files, Run};
use super::{figure, residuals};
use crate::analysis::planes::{norm, relative_to};
use crate::analysis::{CompensateOptions, Compensation, MethodRun};
use crate::error::Result;
use crate::finding::decimal;
use crate::finding::{Finding, Grade};
use crate::image::Image;
use crate::io::raster::exposure;
use crate::krylov::Method;

/// A compensation with the options that it was found by.
#[derive(Clone, Copy, Debug)]
pub struct Compensated<'a> {
    /// The compensation.
    pub found: &'a Compensation,
    /// Its options.
    pub options: &'a CompensateOptions,
    /// Other methods with as many photos.
    pub methods: &'a [MethodRun],
    /// The name and the unit of the source, where it is a model rather than the laboratory's own.
    pub model: Option<(&'a str, &'a str)>,
    /// Whether photos were taken for it.
    pub has_photos: bool,
    /// The photo of the compensation by independent light, and the standard errors of its samples.
    pub checked: Option<(&'a Image, &'a Image)>,
}

impl<'a> Compensated<'a> {
    /// A compensation from photos of the laboratory's source.
    pub fn new(found: &'a Compensation, options: &'a CompensateOptions) -> Self {
        Self { found, options, methods: &[], model: None, has_photos: true, checked: None }
    }

    /// Writes arrays, pictures, `residuals.csv` and `report.html` into the run's folder and returns their names.
    ///
    /// The `.png` of the compensation holds the pattern itself (sRGB, readable as a pattern). The `.png` files of the target, the
    /// observed and the uncompensated photo share one exposure.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, run: &Run<'_>) -> Result<Vec<String>> {
        let mut files = Files::new(run.folder);
        let found = self.found;
        let mut images = vec![
            ("compensation", &found.pattern),
            ("observed", &found.observed),
            ("uncompensated", &found.uncompensated),
            ("target", &found.target),
        ];
        images.extend(found.unclipped.as_ref().map(|image| ("unclipped", image)));
        for (name, image) in images {
            files.image(name, image)?;
        }
        if let Some((photo, errors)) = self.checked {
            files.image("observed-by-independent-light", photo)?;
            files.image("standard-error", errors)?;
        }
        let pictures = self.pictures(run.unit)?;
        for (name, figure) in &pictures {
            files.picture(name, figure)?;
        }
        files.text("residuals.csv", &residuals::csv("photo", &rows(&found.history)))?;
        if let Some(clamping) = &found.clamping {
            let displayed = residuals::csv("photo", &rows(&clamping.displayed));
            files.text("residuals-displayed.csv", &displayed)?;
        }
        if !self.methods.is_empty() {
            files.text("methods.csv", &figures::csv(self.methods))?;
        }
        let figures = pictures.into_iter().map(|(_, figure)| figure).collect();
        files.finish(self.page(run, figures)?)
    }

    /// Whether the compensation is good, as a finding.
    pub fn findings(&self) -> Vec<Finding> {
        let found = self.found;
        let grade = if found.good { Grade::Ok } else { Grade::Fails };
        let text = match (found.good, found.is_needless()) {
            (true, true) => {
                "the target itself, projected, is seen as well: there is nothing to compensate".to_owned()
            }
            _ => format!(
                "a residual of {}, uncompensated {}",
                decimal(found.residual, 4),
                decimal(found.uncompensated_residual, 4)
            ),
        };
        let help = match self.options.method {
            Method::KrylovBox => "give more --photos, or a target that can be reached (--peak)",
            _ => "use --method krylov-box, or give more --photos",
        };
        let expected = "within the tolerance, or better than no compensation";
        vec![Finding::graded("compensation", grade, text, expected, help)]
    }

    /// The result in one or two sentences.
    pub fn sentence(&self) -> String {
        let found = self.found;
        let mut text = format!(
            "{} photos by {}: {}. What is seen differs from the target by {} of it, uncompensated by {}.",
            found.photos,
            self.method(),
            found.status,
            decimal(found.residual, 4),
            decimal(found.uncompensated_residual, 4)
        );
        if found.unclipped.is_some() {
            let _ = write!(
                text,
                " The answer had to be clipped to [{}, 1]; before that its residual was {}.",
                self.options.floor,
                decimal(found.unclipped_residual, 4)
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

    fn method(&self) -> &'static str {
        self.options.method.facts().name
    }

    fn pictures(&self, unit: &str) -> Result<Vec<(&'static str, Figure)>> {
        let found = self.found;
        let plain = |image: &Image, scale: f32, caption: String| -> Result<Figure> {
            figure::light(image, scale, unit, caption)
        };
        let scale = exposure(&found.target);
        let mut pictures = vec![
            ("target", plain(&found.target, scale, "The target".into())?),
            (
                "observed",
                plain(
                    &found.observed,
                    scale,
                    format!("What is seen: residual {}", decimal(found.residual, 4)),
                )?,
            ),
            (
                "uncompensated",
                plain(
                    &found.uncompensated,
                    scale,
                    format!("Uncompensated: residual {}", decimal(found.uncompensated_residual, 4)),
                )?,
            ),
            ("compensation", figure::pattern(&found.pattern, "What is projected")?),
        ];
        let errors = [&found.observed, &found.uncompensated].map(|photo| difference(photo, &found.target));
        let range = robust_range(&errors.concat(), None);
        let captions = ["Seen less the target", "Uncompensated less the target"];
        for ((error, caption), name) in errors.iter().zip(captions).zip(["error", "error-uncompensated"]) {
            pictures.push((name, figure::signed(found.target.resolution(), error, range, unit, caption)?));
        }
        let named = |(name, figure): (&'static str, Figure)| {
            let file = if name.starts_with("error") { String::new() } else { format!("{name}.npy") };
            let figure = figure.named(name, file);
            let figure = match name {
                "target" => figure.flipped_with(["observed", "uncompensated"]),
                "observed" => figure.flipped_with(["target", "uncompensated"]),
                "uncompensated" => figure.flipped_with(["target", "observed"]),
                "error" => figure.flipped_with(["error-uncompensated"]),
                _ => figure,
            };
            (name, figure)
        };
        Ok(pictures.into_iter().map(named).collect())
    }

    fn page(&self, run: &Run<'_>, figures: Vec<Figure>) -> Result<Report> {
        let found = self.found;
        let mut more = vec![
            ("Peak", format!("{} {}", decimal(found.peak, 5), run.unit)),
            ("Photos before the method's", found.preparation.to_string()),
        ];
        let lift = self.options.lift;
        more.extend((lift > 0.0).then(|| ("Target moved to", format!("[{lift}, 1]"))));
        more.extend(self.checked.map(|(photo, errors)| {
            let (errors, photo) = (errors.planes(), photo.planes());
            ("Standard error of the photo", relative_to(norm(&errors), &photo, &errors).to_string())
        }));
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
        if !self.methods.is_empty() {
            sections.push(figures::methods(self, self.methods));
        }
        sections.extend(run.photos(ORDER)?);
        Ok(run.page((self.findings(), self.sentence()), found.photos, more, sections))
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
