//! The files and the report page of a light transport compensation.

use super::Compensated;
use super::answer::ssim;
use crate::analysis::planes::{norm, relative_to};
use crate::analysis::{Clamping, CompensationRow, MethodRun, Similarity};
use crate::error::Result;
use crate::finding::decimal;
use crate::image::Image;
use crate::io::raster::exposure;
use crate::report::colormap::robust_range;
use crate::report::figure;
use crate::report::html::{Block, Figure};
use crate::report::residuals::{self, Row};
use crate::report::run::AnswerPage;

impl Compensated {
    /// Writes pictures and residuals.
    pub(super) fn show_on(&self, page: &mut AnswerPage<'_>) -> Result<()> {
        let found = &self.found;
        page.photos = found.photos;
        let figures = Block::Figures(self.figures(page)?);
        let text = "Photos are developed alike. Errors are of all channels together.";
        page.section("Seen and projected", text, [figures, similarity(self)]);
        page.files.text("residuals.csv", residuals::csv("photo", &rows(&found.history)));
        // A model takes no photos, so its answer has no convergence history.
        if !found.history.is_empty() {
            convergence(self, page);
        }
        if let Some(found) = &found.clamping {
            let displayed = residuals::csv("photo", &rows(&found.displayed));
            page.files.text("residuals-displayed.csv", displayed);
            clamping(self, found, page);
        }
        if !self.methods.is_empty() {
            page.files.text("methods.csv", csv(&self.methods));
            compared(self, page);
        }
        page.contact_sheet("White comes first, then those that measure a preconditioner, if any, then those of the method; those that only show or compare (the result, the uncompensated target, other methods) come last.")?;
        page.fact("Peak", format_args!("{} {}", decimal(found.peak, 5), page.unit.clone()));
        page.fact("Photos before the method's", found.preparation);
        if let Some(least) = found.least_residual {
            page.fact("Least residual possible", decimal(least, 4));
        }
        if self.options.lift > 0.0 {
            page.fact("Target moved to", format_args!("[{}, 1]", self.options.lift));
        }
        if let Some([photo, errors]) = self.verified.as_ref().and_then(|found| found.photo.as_ref()) {
            let (errors, photo) = (errors.planes(), photo.planes());
            page.fact("Standard error of the photo", relative_to(norm(&errors), &photo, &errors));
        }
        Ok(())
    }

    /// The `.png` file of the compensation contains the pattern itself (sRGB, readable as a pattern). The `.png` files of the target, of
    /// the observed photo and of the uncompensated photo share one exposure.
    fn figures(&self, page: &mut AnswerPage<'_>) -> Result<Vec<Figure>> {
        let found = &self.found;
        let scale = exposure(&found.target);
        let seen = format!("What is seen: residual {}", decimal(found.residual, 4));
        let plain = format!("Uncompensated: residual {}", decimal(found.uncompensated_residual, 4));
        let light = [
            ("target", &found.target, "The target".to_owned()),
            ("observed", &found.observed, seen),
            ("uncompensated", &found.uncompensated, plain),
        ];
        let mut figures = Vec::new();
        for (name, image, caption) in light {
            let figure = figure::light(image, scale, &page.unit, caption);
            figures.push(figure.named(name, format!("{name}.npy")));
        }
        let pattern = figure::pattern(&found.pattern, "What is projected");
        figures.push(pattern.named("compensation", "compensation.npy"));
        let errors = [&found.observed, &found.uncompensated].map(|photo| difference(photo, &found.target));
        let range = robust_range(&errors.concat(), None);
        let captions = ["Seen less the target", "Uncompensated less the target"];
        for ((error, caption), name) in errors.iter().zip(captions).zip(["error", "error-uncompensated"]) {
            let figure = figure::signed(page.resolution, error, range, &page.unit, caption)?;
            figures.push(figure.named(name, ""));
        }
        figure::flip(&mut figures, &["target", "observed", "uncompensated"]);
        figure::flip(&mut figures, &["error", "error-uncompensated"]);
        figures.iter().for_each(|figure| page.files.png(&figure.name, figure.picture.clone()));
        Ok(figures)
    }
}

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

fn convergence(run: &Compensated, page: &mut AnswerPage<'_>) {
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
    let text = "Residuals are relative to the light of the target. The photos that show target and result, and those of the baseline, are not the method's and are not counted.";
    page.section("Convergence", text, [residuals::plot("photos", &lines, marks, caption)]);
}

/// The residuals of an unconstrained method whose solutions are clamped to the projector's range.
fn clamping(run: &Compensated, clamping: &Clamping, page: &mut AnswerPage<'_>) {
    let (own, displayed, boxed) =
        (rows(&run.found.history), rows(&clamping.displayed), rows(&clamping.boxed));
    let own_name = format!("{}, not clamped", run.method());
    let name = format!("{}, clamped", run.method());
    let lines: [(&str, &[Row]); 3] =
        [(&own_name, &own), (&name, &displayed), ("krylov-box, inside the range", &boxed)];
    let marks = vec![(clamping.uncompensated, "uncompensated".to_owned())];
    let caption = "The residual of what is seen after each photo. The first line cannot be projected.";
    let text = clamping.warning().map_or_else(
        || "The answer leaves what can be projected and is clamped; here that costs little.".into(),
        |warning| format!("Warning: {warning}."),
    );
    page.section("What clamping does", text, [residuals::plot("photos", &lines, marks, caption)]);
}

/// The residuals of every method after the same number of photos, and on a rig also after the same number of frames.
fn compared(run: &Compensated, page: &mut AnswerPage<'_>) {
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
    let text = "All from the same white photo; the light that is seen is what counts.";
    page.section("Every method at equal photos", text, blocks);
}

/// The residuals of a method's displayed patterns over its frames; empty if photos are computed.
fn over_frames(method: &MethodRun) -> Vec<Row> {
    let at = |(row, &frames): (&CompensationRow, &u64)| (frames as usize, row.residual);
    method.displayed.iter().zip(&method.frames).map(at).collect()
}

/// A table of the last result of each method.
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
    Block::table(headers, methods.iter().map(row).collect(), "Relative residuals at the end")
}

fn similarity(run: &Compensated) -> Block {
    let found = &run.found;
    let row = |name: &str, residual: f64, similarity: &Similarity| {
        vec![name.to_owned(), decimal(residual, 4), format!("{:.2}", similarity.psnr), ssim(similarity)]
    };
    let rows = vec![
        row("compensated", found.residual, &found.similarity),
        row("uncompensated", found.uncompensated_residual, &found.uncompensated_similarity),
    ];
    let headers = ["", "relative residual", "PSNR, dB", "SSIM"];
    Block::table(headers, rows, "What is seen against the target; the data range is the peak")
}

/// The content of `methods.csv`: the residual of each method's displayed pattern after each photo, and the frames (empty if none are
/// taken).
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
