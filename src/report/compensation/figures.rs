//! Plots and tables of a compensation: convergence, the effect of clamping, all methods at equal photo counts, and similarity.

use super::Compensated;
use crate::analysis::{Clamping, CompensationRow, MethodRun, Similarity};
use crate::finding::decimal;
use crate::report::html::{Block, Section};
use crate::report::residuals::{self, Row};

pub(super) fn rows(history: &[CompensationRow]) -> Vec<Row> {
    history.iter().map(|row| (row.photo, row.residual)).collect()
}

pub(super) fn convergence(run: &Compensated<'_>) -> Section {
    let found = run.found;
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

/// Residuals of an unconstrained method whose answers are clamped to the projector's range.
pub(super) fn clamping(run: &Compensated<'_>, clamping: &Clamping) -> Section {
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

/// Residuals of every method at equal photo counts, and on a rig at equal frames.
pub(super) fn methods(run: &Compensated<'_>, methods: &[MethodRun]) -> Section {
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

/// The displayed residuals of a method over its frames; none where photos are computed.
fn over_frames(method: &MethodRun) -> Vec<Row> {
    let at = |(row, &frames): (&CompensationRow, &u64)| (frames as usize, row.residual);
    method.displayed.iter().zip(&method.frames).map(at).collect()
}

/// Table of what each method reached with all of its photos.
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

/// Table of the similarity of the observed photos to the target.
pub(super) fn similarity(run: &Compensated<'_>) -> Block {
    let found = run.found;
    let row = |name: &str, residual: f64, similarity: &Similarity| {
        let ssim = similarity.ssim.map_or("–".into(), |ssim| format!("{ssim:.4}"));
        vec![name.to_owned(), decimal(residual, 4), format!("{:.2}", similarity.psnr), ssim]
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

/// Content of `methods.csv`: the residual of each method's displayed photo after each photo, and the frames that it took; these are empty
/// where photos are computed.
pub(super) fn csv(methods: &[MethodRun]) -> String {
    let mut text = String::from("method,photo,frames,relative_residual_displayed\n");
    for method in methods {
        for (index, row) in method.displayed.iter().enumerate() {
            let frames = method.frames.get(index).map_or(String::new(), u64::to_string);
            text += &format!("{},{},{frames},{:e}\n", method.name, row.photo, row.residual);
        }
    }
    text
}
