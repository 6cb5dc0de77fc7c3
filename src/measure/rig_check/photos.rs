//! The check by photos of black and white: what they show of frames, settling, repeatability and noise.

use super::light::{Exposure, light};
use super::sequence::{Photos, mean, take};
use super::thresholds::{NOISE_RATIO, REPEATABILITY, SETTLING, SIGMAS};
use super::{Finding, Grade, Recorder};
use crate::error::Result;
use crate::measure::calibrate::{StructuredLight, WhiteExposure};
use crate::measure::{Calibration, Effort, FrameSource, noise_ratio};

/// How the photos of the check are taken.
pub(super) struct Setup<'a> {
    /// Seconds between the confirmation of a frame and its photo.
    pub(super) settle: f64,
    /// The exposure that the rig file gives, in seconds.
    pub(super) exposure: Option<f64>,
    /// The calibration, where there is a usable one.
    pub(super) known: Option<&'a Calibration>,
}

/// What the photos of black and white allow to examine further.
pub(super) struct Seen {
    /// The exposure of white, in seconds.
    pub(super) exposure: f64,
    /// The photos.
    pub(super) photos: Photos,
    /// Whether the first photo of a frame has all of its light.
    pub(super) settled: bool,
    /// Whether hardly any sample of white is saturated.
    pub(super) in_range: bool,
}

/// Takes photos of black and white, and examines them. Returns them when white can be seen.
pub(super) fn photos(
    setup: &Setup<'_>,
    frames: &mut dyn FrameSource,
    recorder: &mut Recorder<'_, '_>,
) -> Result<Option<Seen>> {
    let (seconds, outcome) = match setup.exposure {
        Some(seconds) => (seconds, WhiteExposure::Filled),
        None => StructuredLight::white_exposure(frames)?,
    };
    let photos = take(frames, seconds)?;
    let bits = frames.camera().bits;
    let (is_visible, in_range) = light(setup.known, &photos, Exposure { seconds, outcome, bits }, recorder)?;
    recorder.add(sequence(&photos.effort))?;
    if !is_visible {
        return Ok(None);
    }
    let means: Vec<[f64; 2]> = photos
        .whites
        .iter()
        .map(|pair| pair.each_ref().map(|white| mean(white) - photos.dark_count))
        .collect();
    let settling = settling(&means, setup.settle);
    let settled = settling.grade == Grade::Ok;
    recorder.add(settling)?;
    recorder.add(repeatability(&means))?;
    if let Some(known) = setup.known {
        let [first, second] = &photos.whites[0];
        // A white that is saturated everywhere is a finding already.
        if let Some(found) = noise_ratio(first, second, &known.camera, bits)? {
            recorder.add(noise(found.ratio, found.error))?;
        }
    }
    Ok(Some(Seen { exposure: seconds, photos, settled, in_range }))
}

/// Whether frames came in order, each exposed after its pattern had settled.
fn sequence(effort: &Effort) -> Finding {
    let refused = effort.dropped + effort.repeated + effort.late;
    let found = match refused {
        0 => format!("{} came in order, each exposed after its pattern", effort.taken),
        _ => format!(
            "of {} frames {} did not arrive, {} arrived twice, {} were exposed too early; {} restarts of the camera",
            effort.taken + refused,
            effort.dropped,
            effort.repeated,
            effort.late,
            effort.restarts
        ),
    };
    let grade = if refused == 0 { Grade::Ok } else { Grade::Warning };
    let resent = match effort.resent {
        0 => String::new(),
        packets => format!("; {packets} packets were lost and sent again"),
    };
    Finding::graded(
        "frames",
        grade,
        found + &resent,
        "no refused frames: each is taken again, which costs time",
        "check cable and network; a free-running camera must be triggered",
    )
}

/// Whether all light of white is there when it is photographed right after black. `means` are the mean counts
/// of the two photos of white in each round.
fn settling(means: &[[f64; 2]], settle: f64) -> Finding {
    let missing: Vec<f64> = means.iter().map(|[first, again]| 1.0 - first / again).collect();
    let (average, error) = average(&missing);
    let is_short = average.abs() - SIGMAS * error > SETTLING;
    Finding::graded(
        "settling",
        if is_short { Grade::Fails } else { Grade::Ok },
        format!(
            "{settle:.4} s after a frame, white after black has {:.2} ± {:.2} % less light than a repeated white",
            100.0 * average,
            100.0 * error
        ),
        format!("at most {} %", 100.0 * SETTLING),
        "give a longer settle in [measurement], or calibrate",
    )
}

/// Whether repeated photos of white have the same brightness.
fn repeatability(means: &[[f64; 2]]) -> Finding {
    let repeated: Vec<f64> = means.iter().map(|[_, again]| *again).collect();
    let (middle, _) = average(&repeated);
    let most = repeated.iter().map(|value| (value / middle - 1.0).abs()).fold(0.0, f64::max);
    Finding::graded(
        "repeatability",
        if most > REPEATABILITY { Grade::Warning } else { Grade::Ok },
        format!("white's light changes by {:.3} % from photo to photo", 100.0 * most),
        format!("at most {:.0} %", 100.0 * REPEATABILITY),
        "use exposures that are whole multiples of the refresh and of the mains period; let the lamp warm up",
    )
}

/// Whether the noise of a photo is what the calibration predicts. `ratio` is measured over predicted noise.
fn noise(ratio: f64, error: f64) -> Finding {
    let [least, most] = NOISE_RATIO;
    let is_off = ratio - SIGMAS * error > most || ratio + SIGMAS * error < least;
    Finding::graded(
        "noise",
        if is_off { Grade::Warning } else { Grade::Ok },
        format!("two photos of white differ by {ratio:.3} ± {error:.3} times what the calibration predicts"),
        format!("{least} to {most}"),
        "more noise may be vibration or flicker; more or less may be another gain: calibrate again",
    )
}

/// The mean of a few values, and its standard error.
fn average(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0).max(1.0) / count).sqrt())
}
