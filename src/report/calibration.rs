//! What a calibration's folder holds for people: `report.json` with every figure, and pictures of the curves and the map.

use std::path::Path;

use super::plot::{LinePlot, Series};
use super::{atomic, colormap};
use crate::error::{Error, Result};
use crate::measure::Calibration;
use crate::measure::calibrate::CalibrationReport;

/// Writes `report.json`, `projector-curve.svg`, `latency.svg`, `drift.svg` and `footprints.png` (camera pixels for each projector
/// pixel: brighter is more) into `folder`.
///
/// # Errors
/// [`Error::Write`] naming the file.
pub fn write(folder: &Path, calibration: &Calibration, report: &CalibrationReport) -> Result<()> {
    let path = folder.join("report.json");
    let mut text =
        serde_json::to_string_pretty(report).map_err(|error| Error::writing(&path)(error.into()))?;
    text.push('\n');
    atomic::write_bytes(&path, text.as_bytes())?;
    let curves = calibration.projector.iter().enumerate().map(|(channel, curve)| Series {
        name: format!("channel {channel}"),
        points: curve.iter().enumerate().map(|(level, &light)| (level as f64, light)).collect(),
    });
    plot(folder, "projector-curve.svg", "level", "light, of white", curves.collect())?;
    let stability = &report.stability;
    let line = |points: &[(f64, f64)]| vec![Series { name: String::new(), points: points.to_vec() }];
    plot(folder, "latency.svg", "seconds waited", "light, of white", line(&stability.sweep))?;
    plot(folder, "drift.svg", "seconds", "white, relative to the first", line(&stability.whites))?;
    let rows = &calibration.registration;
    let counts: Vec<f64> = rows.starts.windows(2).map(|ends| (ends[1] - ends[0]) as f64).collect();
    let most = counts.iter().copied().fold(1.0, f64::max);
    colormap::paint_sequential(rows.projector, &counts, None, (0.0, most))?
        .write_png(&folder.join("footprints.png"))
}

fn plot(folder: &Path, name: &str, x_label: &str, y_label: &str, series: Vec<Series>) -> Result<()> {
    let plot = LinePlot {
        x_label: x_label.into(),
        y_label: y_label.into(),
        logarithmic: false,
        series,
        marks: Vec::new(),
    };
    atomic::write_bytes(&folder.join(name), plot.render().as_bytes())
}
