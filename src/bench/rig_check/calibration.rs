//! The check of the calibration: whether there is one, whether it belongs to these devices, and whether its
//! pixel map still fits.

use std::path::Path;
use std::time::SystemTime;

use super::thresholds::{MAP_OFFSET_FAILURE, MAP_OFFSET_WARNING, MIN_CORRELATION, SIGMAS};
use super::{Finding, Grade, Recorder};
use crate::calibrate::map_check;
use crate::error::{Error, Result};
use crate::finding::decimal;
use crate::measure::{Calibration, FrameSource, RigFile, pixel_ratio};

/// Loads the calibration. Returns it when it can be used.
pub(crate) fn calibration(file: &RigFile, recorder: &mut Recorder<'_, '_>) -> Result<Option<Calibration>> {
    let (finding, known) = match (file.load_calibration(), &file.calibration) {
        (Some(Ok(known)), Some(folder)) => {
            let found = format!(
                "{}{}; light settles in {} s, and drifts {:.2} % per hour",
                folder.display(),
                age(folder),
                decimal(known.stability.settle, 4),
                100.0 * known.stability.drift_per_hour
            );
            (Finding::ok("calibration", found), Some(known))
        }
        (Some(Err(error)), _) => (Finding::error("calibration", &error), None),
        _ => {
            let finding = Finding::graded(
                "calibration",
                Grade::Warning,
                "the rig file names none: responses, noise and pixel map are assumed to be ideal",
                "the folder that `krylux rig calibrate` wrote",
                "run it with --use, which names its folder in the rig file",
            );
            (finding, None)
        }
    };
    recorder.add(finding)?;
    Ok(known)
}

/// `, 3 days old`; empty where the file system does not say.
fn age(folder: &Path) -> String {
    let written = std::fs::metadata(folder.join("calibration.toml")).and_then(|file| file.modified()).ok();
    let hours = written
        .and_then(|written| SystemTime::now().duration_since(written).ok())
        .map(|age| age.as_secs_f64() / 3600.0);
    match hours {
        Some(hours) if hours >= 48.0 => format!(", {:.0} days old", hours / 24.0),
        Some(hours) => format!(", {hours:.1} hours old"),
        None => String::new(),
    }
}

/// Photographs random squares, and measures how far the pixel map is off: the calibration's, or without one that of two rasters of the same
/// field, which a run would take.
pub(crate) fn pixel_map(
    known: Option<&Calibration>,
    frames: &mut dyn FrameSource,
    exposure: f64,
    recorder: &mut Recorder<'_, '_>,
) -> Result<()> {
    let ideal = Calibration::ideal(frames.projector(), frames.camera());
    let known = known.unwrap_or(&ideal);
    let help = match pixel_ratio::too_few(frames.camera().resolution, frames.projector().resolution) {
        Some(_) => "the camera has too few pixels: see `pixels` above",
        None => {
            "align the bench and calibrate it: the pixel map does not fit, or something has moved since the calibration"
        }
    };
    let expected = format!("within {MAP_OFFSET_WARNING} pixels, beyond noise");
    let finding = match map_check(frames, known, exposure) {
        Err(Error::Numerical(fault)) => {
            let fault = fault.lines().next().unwrap_or_default();
            Finding::graded("pixel map", Grade::Fails, fault, expected, help)
        }
        Err(error) => return Err(error),
        // No shift at all that fits gives no correlation.
        Ok(found) if found.agreement < MIN_CORRELATION || found.agreement.is_nan() => {
            let by = if found.agreement.is_finite() {
                format!(" (correlation {:.2})", found.agreement)
            } else {
                String::new()
            };
            let text = format!("the photo does not show the pattern that was projected{by}");
            Finding::graded("pixel map", Grade::Fails, text, expected, help)
        }
        Ok(found) => {
            let grade = offset_grade(found.off, found.error);
            let [right, down] = found.shift;
            let text = format!(
                "off by {:.3} ± {:.3} pixels at most, by ({right:.3}, {down:.3}) in the centre",
                found.off, found.error
            );
            Finding::graded("pixel map", grade, text, expected, help)
        }
    };
    recorder.add(finding)
}

/// The grade of an offset with this standard error, both in projector pixels. An offset that is too uncertain
/// to be judged is a warning.
fn offset_grade(offset: f64, error: f64) -> Grade {
    match offset - SIGMAS * error {
        surely if surely > MAP_OFFSET_FAILURE => Grade::Fails,
        surely if surely > MAP_OFFSET_WARNING => Grade::Warning,
        surely if surely.is_finite() && SIGMAS * error <= MAP_OFFSET_FAILURE => Grade::Ok,
        _ => Grade::Warning,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_offset_counts_beyond_its_noise_and_an_uncertain_one_is_a_warning() {
        for (offset, error, expected) in [
            (0.02, 0.01, Grade::Ok),
            (0.15, 0.03, Grade::Ok),
            (0.2, 0.03, Grade::Warning),
            (0.5, 0.03, Grade::Fails),
            (13.0, 96.0, Grade::Warning),
            (f64::NAN, 0.0, Grade::Warning),
        ] {
            assert_eq!(offset_grade(offset, error), expected, "{offset} ± {error}");
        }
    }
}
