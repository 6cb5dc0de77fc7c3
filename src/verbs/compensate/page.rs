//! The files and the report page of a light transport compensation.

use super::Compensated;
use super::answer::ssim;
use crate::analysis::planes::{norm, relative_to};
use crate::analysis::{Clamping, CompensationRow, MethodRun, Similarity};
use crate::error::Result;
use crate::finding::decimal;
use crate::image::Image;
use crate::io::raster::exposure;
use crate::lab::Answer;
use crate::report::colormap::robust_range;
use crate::report::figure;
use crate::report::html::{Block, Figure, Report, Section};
use crate::report::residuals::{self, Row};
use crate::report::run::{Files, Run};

impl Compensated {
    /// Writes arrays, pictures, `residuals.csv` and `report.html` into the run's folder and returns their names.
    ///
    /// The `.png` of the compensation holds the pattern itself (sRGB, readable as a pattern). The `.png` files of the target, the observed
    /// and the uncompensated photo share one exposure.
    pub(super) fn write_page(&self, run: &Run<'_>) -> Result<Vec<String>> {
        let found = &self.found;
        let mut files = Files::of(run.folder, &self.content())?;
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
            files.text("methods.csv", &csv(&self.methods))?;
        }
        let figures = pictures.into_iter().map(|(_, figure)| figure).collect();
        files.finish(self.page(run, figures)?)
    }

    fn pictures(&self, unit: &str) -> Result<Vec<(&'static str, Figure)>> {
        let found = &self.found;
        let scale = exposure(&found.target);
        let light = |image: &Image, caption: String| figure::light(image, scale, unit, caption);
        let mut pictures = vec![
            ("target", light(&found.target, "The target".into())?),
            (
                "observed",
                light(&found.observed, format!("What is seen: residual {}", decimal(found.residual, 4)))?,
            ),
            (
                "uncompensated",
                light(
                    &found.uncompensated,
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
        let found = &self.found;
        let mut more = vec![
            ("Peak", format!("{} {}", decimal(found.peak, 5), run.unit)),
            ("Photos before the method's", found.preparation.to_string()),
        ];
        let lift = self.options.lift;
        more.extend((lift > 0.0).then(|| ("Target moved to", format!("[{lift}, 1]"))));
        let checked = self.verified.as_ref().and_then(|found| found.photo.as_ref());
        more.extend(checked.map(|[photo, errors]| {
            let (errors, photo) = (errors.planes(), photo.planes());
            ("Standard error of the photo", relative_to(norm(&errors), &photo, &errors).to_string())
        }));
        let mut sections = vec![Section {
            title: "Seen and projected".into(),
            text: "Photos are developed alike. Errors are of all channels together.".into(),
            blocks: vec![Block::Figures(figures), similarity(self)],
        }];
        // An answer from a model has no photos, hence no convergence history.
        if !found.history.is_empty() {
            sections.push(convergence(self));
        }
        sections.extend(found.clamping.as_ref().map(|found| clamping(self, found)));
        if !self.methods.is_empty() {
            sections.push(compared(self));
        }
        sections.extend(run.photos(ORDER)?);
        Ok(run.page((self.findings(), self.sentence()), found.photos, more, sections))
    }
}

const ORDER: &str = "White comes first, then those that measure a preconditioner, if any, then those of the method; those that only show or compare (the result, the uncompensated target, other methods) come last.";

/// The mean of `a − b` over the channels, for each pixel.
fn difference(a: &Image, b: &Image) -> Vec<f64> {
    let channels = a.channels();
    let pixels = a.samples().chunks_exact(channels).zip(b.samples().chunks_exact(channels));
    pixels
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| f64::from(a - b)).sum::<f64>() / channels as f64)
        .collect()
}

fn rows(history: &[CompensationRow]) -> Vec<Row> {
    history.iter().map(|row| (row.photo, row.residual)).collect()
}

fn convergence(run: &Compensated) -> Section {
    let found = &run.found;
    let (ours, theirs) = (rows(&found.history), rows(&found.baseline));
    let mut lines: Vec<(&str, &[Row])> = vec![(run.method(), &ours)];
    if run.method() != "jacobi" && !theirs.is_empty() {
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
    Section {
        title: "Convergence".into(),
        text: "Residuals are relative to the light of the target. The photos that show target and result, and those of the baseline, are not the method's and are not counted.".into(),
        blocks: vec![residuals::plot("photos", &lines, marks, caption)],
    }
}

/// The residuals of an unconstrained method whose answers are clamped to the projector's range.
fn clamping(run: &Compensated, clamping: &Clamping) -> Section {
    let (own, displayed, boxed) =
        (rows(&run.found.history), rows(&clamping.displayed), rows(&clamping.boxed));
    let own_name = format!("{}, not clamped", run.method());
    let name = format!("{}, clamped", run.method());
    let lines: [(&str, &[Row]); 3] =
        [(&own_name, &own), (&name, &displayed), ("krylov-box, inside the range", &boxed)];
    let marks = vec![(clamping.uncompensated, "uncompensated".to_owned())];
    let caption = "The residual of what is seen after each photo. The first line cannot be projected.";
    Section {
        title: "What clamping does".into(),
        text: clamping.warning().map_or_else(
            || "The answer leaves what can be projected and is clamped; here that costs little.".into(),
            |warning| format!("Warning: {warning}."),
        ),
        blocks: vec![residuals::plot("photos", &lines, marks, caption)],
    }
}

/// The residuals of every method at equal photo counts, and on a rig at equal frames.
fn compared(run: &Compensated) -> Section {
    let methods = &run.methods;
    let marks = || vec![(run.found.uncompensated_residual, "uncompensated".to_owned())];
    let plot = |count: &str, histories: &[Vec<Row>], caption: &str| {
        let lines: Vec<(&str, &[Row])> =
            methods.iter().zip(histories).map(|(method, rows)| (method.name, rows.as_slice())).collect();
        residuals::multiples(count, &lines, marks(), caption)
    };
    let photos: Vec<Vec<Row>> = methods.iter().map(|method| rows(&method.displayed)).collect();
    let caption = "The residual of what is seen after each photo: answers that leave the projector's range are clamped.";
    let mut blocks = vec![plot("photos", &photos, caption)];
    let frames: Vec<Vec<Row>> = methods.iter().map(over_frames).collect();
    if frames.iter().any(|rows| !rows.is_empty()) {
        let caption = "The same over what the camera took: a photo of a signed pattern, in bit planes, at several exposures or in \
                       several takes is several frames, and a sentinel is one. Those of white and black are common to all.";
        blocks.push(plot("frames", &frames, caption));
    }
    blocks.push(at_the_end(methods));
    Section {
        title: "Every method at equal photos".into(),
        text: "All from the same white photo; the light that is seen is what counts.".into(),
        blocks,
    }
}

/// The displayed residuals of a method over its frames; empty if photos are computed.
fn over_frames(method: &MethodRun) -> Vec<Row> {
    let at = |(row, &frames): (&CompensationRow, &u64)| (frames as usize, row.residual);
    method.displayed.iter().zip(&method.frames).map(at).collect()
}

/// A table of the final result of each method.
fn at_the_end(methods: &[MethodRun]) -> Block {
    let number = |value: f64| decimal(value, 4);
    let row = |method: &MethodRun| {
        vec![
            method.name.to_owned(),
            method.photos.to_string(),
            method.frames.last().map_or("–".into(), u64::to_string),
            number(method.residual),
            method.history.last().map_or("–".into(), |row| number(row.residual)),
            method.ssim.map_or("–".into(), number),
        ]
    };
    let headers = ["method", "photos", "frames", "seen", "before clamping", "SSIM"];
    Block::Table {
        headers: headers.map(String::from).into(),
        rows: methods.iter().map(row).collect(),
        caption: "Relative residuals at the end".into(),
    }
}

fn similarity(run: &Compensated) -> Block {
    let found = &run.found;
    let row = |name: &str, residual: f64, similarity: &Similarity| {
        vec![name.to_owned(), decimal(residual, 4), format!("{:.2}", similarity.psnr), ssim(similarity)]
    };
    Block::Table {
        headers: ["", "relative residual", "PSNR, dB", "SSIM"].map(String::from).into(),
        rows: vec![
            row("compensated", found.residual, &found.similarity),
            row("uncompensated", found.uncompensated_residual, &found.uncompensated_similarity),
        ],
        caption: "What is seen against the target; the data range is the peak".into(),
    }
}

/// The content of `methods.csv`: the displayed residual of each method after each photo, and its frames (empty if photos are computed).
fn csv(methods: &[MethodRun]) -> String {
    let mut text = String::from("method,photo,frames,relative_residual_displayed\n");
    for method in methods {
        for (index, row) in method.displayed.iter().enumerate() {
            let frames = method.frames.get(index).map_or(String::new(), u64::to_string);
            text += &format!("{},{},{frames},{:e}\n", method.name, row.photo, row.residual);
        }
    }
    text
}
