//! The calibration report: `report.json` with all figures, pictures of the curves and of the registration, and a page that shows them.

use std::path::Path;

use super::colormap;
use super::figure;
use super::html::{Block, Outcome, Report, Section, Verdict};
use super::plot::{LinePlot, Series};
use super::run;
use crate::calibrate::CalibrationReport;
use crate::error::{Error, Result};
use crate::io::atomic;
use crate::measure::Calibration;
use crate::measure::RunManifest;

/// Writes `report.json`, `projector-curve.svg`, `latency.svg`, `drift.svg` and `footprints.png` into `folder`. The last one shows the
/// number of camera pixels per projector pixel; brighter is more. Fails with [`Error::Write`].
pub fn write(folder: &Path, calibration: &Calibration, report: &CalibrationReport) -> Result<()> {
    let path = folder.join("report.json");
    let mut text =
        serde_json::to_string_pretty(report).map_err(|error| Error::writing(&path)(error.into()))?;
    text.push('\n');
    atomic::write_bytes(&path, text.as_bytes())?;
    for (name, _, plot) in plots(calibration, report) {
        atomic::write_bytes(&folder.join(format!("{name}.svg")), plot.render().as_bytes())?;
    }
    let counts = footprints(calibration);
    let most = counts.iter().copied().fold(1.0, f64::max);
    colormap::paint_sequential(calibration.registration.projector, &counts, None, (0.0, most))?
        .write_png(&folder.join("footprints.png"))
}

/// Writes `report.html`. `figures` are names and values of the measured quantities; `seconds` is the run's duration so far.
pub fn write_page(
    folder: &Path,
    (title, figures): (String, &[[String; 2]]),
    (calibration, report): (&Calibration, &CalibrationReport),
    manifest: &RunManifest,
    seconds: f64,
) -> Result<()> {
    let table = Block::Table {
        headers: ["Of", "Measured"].map(str::to_owned).to_vec(),
        rows: figures.iter().map(|row| row.to_vec()).collect(),
        caption: String::new(),
    };
    let map = figure::amounts(
        calibration.registration.projector,
        &footprints(calibration),
        "camera pixels",
        "Camera pixels that see each pixel of the projector",
    )?;
    let curves = plots(calibration, report)
        .map(|(_, caption, plot)| Block::Plot { svg: plot.render(), caption: caption.into() });
    let section =
        |title: &str, text: &str, blocks| Section { title: title.into(), text: text.into(), blocks };
    let taken = report.effort.frames();
    let page = Report {
        title,
        verdict: Verdict {
            outcome: Outcome::Good,
            sentence: format!("Calibrated from {taken} frames, from captures alone."),
        },
        facts: run::facts(manifest, usize::try_from(taken).unwrap_or(usize::MAX), [], seconds),
        sections: vec![
            section("Figures", "Each with its standard error.", vec![table]),
            section("Curves", "", curves.into()),
            section("Pixel map", "", vec![Block::Figures(vec![map])]),
        ],
        footer: manifest.command_line(),
        ..Report::default()
    };
    page.write(&folder.join("report.html"))
}

fn plots(
    calibration: &Calibration,
    report: &CalibrationReport,
) -> [(&'static str, &'static str, LinePlot); 3] {
    let curves = calibration.projector.iter().enumerate().map(|(channel, curve)| Series {
        name: format!("channel {channel}"),
        points: curve.iter().enumerate().map(|(level, &light)| (level as f64, light)).collect(),
    });
    let stability = &report.stability;
    let line = |points: &[(f64, f64)]| vec![Series { name: String::new(), points: points.to_vec() }];
    let plot = |x: &str, y: &str, series| LinePlot {
        x_label: x.into(),
        y_label: y.into(),
        logarithmic: false,
        series,
        marks: Vec::new(),
    };
    [
        (
            "projector-curve",
            "The projector's response: light by level, in shares of the light of white.",
            plot("level", "light, of white", curves.collect()),
        ),
        (
            "latency",
            "How much of a frame's light is there after a wait.",
            plot("seconds waited", "light, of white", line(&stability.sweep)),
        ),
        (
            "drift",
            "The lamp, by white photos in the course of the calibration.",
            plot("seconds", "white, relative to the first", line(&stability.whites)),
        ),
    ]
}

fn footprints(calibration: &Calibration) -> Vec<f64> {
    calibration.registration.starts.windows(2).map(|ends| (ends[1] - ends[0]) as f64).collect()
}
