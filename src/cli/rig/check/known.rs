//! The calibration: there, of these devices, and still right.

use std::path::Path;
use std::time::SystemTime;

use anyhow::Result;

use super::super::super::rig_source::RigSource;
use super::super::bench::{self, Bench};
use super::finding::{Finding, Findings, Grade};
use crate::error::Error;
use crate::measure::calibrate::map_check;
use crate::measure::{Calibration, FrameSource};

/// Projector pixels that a map may be off by: as much as calibration itself promises.
const FITS: f64 = 0.1;

/// A map that is off by more is no good: a third of the direct light is counted to the neighbour.
const BROKEN: f64 = 0.3;

/// Standard errors that an offset must lie beyond its bound to count.
const SIGMAS: f64 = 3.0;

/// A picture that agrees less with what was shown is not of it.
const AGREES: f64 = 0.5;

/// Whether there is one; it is handed on where it can be used.
pub(super) fn calibration(source: &RigSource, findings: &mut Findings) -> Result<Option<Calibration>> {
    let (finding, known) = match (bench::calibration(source), &source.file.calibration) {
        (Some(Ok(known)), Some(folder)) => {
            let found = format!(
                "{}{}; light is waited for {:.4} s, and drifts {:.2} % per hour",
                folder.display(),
                age(folder),
                known.stability.settle,
                100.0 * known.stability.drift_per_hour
            );
            (Finding::ok("calibration", found), Some(known))
        }
        (Some(Err(why)), _) => (Finding::error("calibration", &why), None),
        _ => {
            let finding = Finding::graded(
                "calibration",
                Grade::Warning,
                "none is named: responses, noise and pixel map are taken as ideal",
                "the folder that `krylux rig calibrate` wrote",
                "run it, and write calibration = \"…\" into the rig file",
            );
            (finding, None)
        }
    };
    findings.add(finding)?;
    Ok(known)
}

/// `, 3 days old`; nothing where the system does not say.
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

/// Whether its pixel map still fits, by three photos.
pub(super) fn map(
    bench: &Bench,
    shots: &mut dyn FrameSource,
    exposure: f64,
    findings: &mut Findings,
) -> Result<()> {
    let Some(known) = &bench.known else { return Ok(()) };
    let help = "align, and calibrate again: something was moved since";
    let expected = format!("within {FITS} pixels, beyond noise");
    let finding = match map_check(shots, known, exposure) {
        Err(Error::Numerical(fault)) => {
            let fault = fault.lines().next().unwrap_or_default();
            Finding::graded("pixel map", Grade::Fails, fault, expected, help)
        }
        Err(error) => return Err(error.into()),
        Ok(found) if found.agreement < AGREES => Finding::graded(
            "pixel map",
            Grade::Fails,
            format!("what is seen is not what was shown there (correlation {:.2})", found.agreement),
            expected,
            help,
        ),
        Ok(found) => {
            let grade = grade(found.off, found.error);
            let [right, down] = found.shift;
            let text = format!(
                "off by {:.3} ± {:.3} pixels at most, by ({right:.3}, {down:.3}) in the centre",
                found.off, found.error
            );
            Finding::graded("pixel map", grade, text, expected, help)
        }
    };
    findings.add(finding)
}

/// Of an offset that is known to its standard error; one that tells nothing is not fine.
fn grade(off: f64, error: f64) -> Grade {
    match off - SIGMAS * error {
        surely if surely > BROKEN => Grade::Fails,
        surely if surely > FITS => Grade::Warning,
        surely if surely.is_finite() && SIGMAS * error <= BROKEN => Grade::Ok,
        _ => Grade::Warning,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_offset_counts_beyond_its_noise_and_one_that_tells_nothing_is_named() {
        for (off, error, expected) in [
            (0.02, 0.01, Grade::Ok),
            (0.15, 0.03, Grade::Ok),
            (0.2, 0.03, Grade::Warning),
            (0.5, 0.03, Grade::Fails),
            (13.0, 96.0, Grade::Warning),
            (f64::NAN, 0.0, Grade::Warning),
        ] {
            assert_eq!(grade(off, error), expected, "{off} ± {error}");
        }
    }
}
