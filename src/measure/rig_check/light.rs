//! The check of the light: exposure, saturation and ambient light.

use super::sequence::{Photos, mean, percentile};
use super::thresholds::{AMBIENT, DIM_WHITE, INVISIBLE_WHITE, SATURATED_FAILURE, SATURATED_WARNING};
use super::{Finding, Grade, Recorder};
use crate::error::Result;
use crate::measure::Calibration;
use crate::measure::calibrate::WhiteExposure;

/// How white was exposed.
pub(super) struct Exposure {
    /// The exposure, in seconds.
    pub(super) seconds: f64,
    /// Whether the camera's exposures suit white.
    pub(super) outcome: WhiteExposure,
    /// The bits of a count.
    pub(super) bits: u32,
}

/// Examines exposure, saturation and ambient light. Returns whether white can be seen at all, and whether hardly any
/// of its samples is saturated.
pub(super) fn light(
    known: Option<&Calibration>,
    photos: &Photos,
    exposure: Exposure,
    recorder: &mut Recorder<'_, '_>,
) -> Result<(bool, bool)> {
    let full = f64::from((1_u32 << exposure.bits) - 1);
    let limit = known.map_or(full, |known| known.camera.saturation);
    let (dark, white) = (photos.dark_count, &photos.whites[0][1]);
    let reached = (percentile(white, 0.98) - dark) / (full - dark);
    recorder.add(range(reached, &exposure))?;
    let saturated = white.counts.iter().filter(|&&count| f64::from(count) >= limit).count() as f64;
    let saturated = saturated / white.counts.len() as f64;
    recorder.add(saturation(saturated))?;
    recorder.add(ambient((mean(&photos.black) - dark) / (mean(white) - dark).max(1.0)))?;
    Ok((reached >= INVISIBLE_WHITE, saturated <= SATURATED_WARNING))
}

/// The part of the camera's range that white fills: `reached` is its 98th percentile above black, as a share
/// of the range.
fn range(reached: f64, exposure: &Exposure) -> Finding {
    let found = format!("white reaches {:.0} % of the range in {:.4} s", 100.0 * reached, exposure.seconds);
    let expected = format!("{:.0} % to 90 %", 100.0 * DIM_WHITE);
    let (grade, help) = match (exposure.outcome, reached) {
        (WhiteExposure::TooBright, _) => {
            (Grade::Fails, "close the lens, lower the gain, or dim the projector")
        }
        (_, share) if share < INVISIBLE_WHITE => (
            Grade::Fails,
            "take off the lens cap, open the lens, or let the projector light what the camera sees",
        ),
        (_, share) if share < DIM_WHITE => (Grade::Warning, "expose longer, or open the lens"),
        _ => (Grade::Ok, ""),
    };
    Finding::graded("exposure", grade, found, expected, help)
}

/// The share of white's samples that are saturated.
fn saturation(share: f64) -> Finding {
    let grade = match share {
        share if share > SATURATED_FAILURE => Grade::Fails,
        share if share > SATURATED_WARNING => Grade::Warning,
        _ => Grade::Ok,
    };
    Finding::graded(
        "saturation",
        grade,
        format!("{:.2} % of white's samples", 100.0 * share),
        format!("at most {:.0} %", 100.0 * SATURATED_WARNING),
        "add a shorter exposure, close the lens, or remove highlights from the scene",
    )
}

/// The light of black, as a share of white's.
fn ambient(share: f64) -> Finding {
    Finding::graded(
        "ambient",
        if share > AMBIENT { Grade::Warning } else { Grade::Ok },
        format!("black has {:.1} % of white's light", 100.0 * share),
        format!("less than {:.0} %", 100.0 * AMBIENT),
        "darken the room: ambient light is subtracted, but its noise remains",
    )
}
