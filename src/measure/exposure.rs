//! The choice of exposures, from test photos of white.
//!
//! The shortest exposure brings the brightest pixel near saturation. Longer exposures follow, up to the
//! allowed number, until the darkest pixel is well above its noise.

use std::sync::Arc;

use super::averaging::{AveragedExposure, average};
use super::frame_source::FrameSource;
use super::response::CameraCurve;
use crate::error::{Error, Result};
use crate::rig::Frame;

/// The brightest pixel of the white photo, as a share of saturation. No pattern is brighter than white. The
/// rest of the range is for noise, for a lamp that becomes brighter, and for the black photo.
const TARGET: f64 = 0.8;

/// The factor from the exposure of a saturated test photo to the next exposure.
const DOWN: f64 = 1.0 / 8.0;

/// The largest factor from the exposure of a test photo that is too dark to the next exposure.
const UP: f64 = 64.0;

/// A test photo whose brightest pixel is below this share of saturation is too dark to predict the exposure.
const DARK: f64 = 0.05;

/// The factor from one exposure of a bracket to the next: the largest loss of light that a pixel suffers by
/// falling between two exposures.
const BRACKET: f64 = 4.0;

/// The darkest pixel is well exposed when it is this many standard deviations above black.
const WELL: f64 = 20.0;

/// The largest number of test photos. It suffices for the way from the shortest to the longest exposure of
/// any camera.
const TEST_PHOTOS: usize = 24;

/// Chooses up to `brackets` exposures in seconds, the shortest first. Only the camera pixels that are `used`
/// count.
pub(super) fn choose(
    frames: &mut dyn FrameSource,
    curve: &CameraCurve,
    white: &Arc<Frame>,
    used: &[bool],
    brackets: u32,
) -> Result<Vec<f64>> {
    let [shortest, longest] = frames.camera().exposures;
    let channels = frames.camera().channels;
    let frame_time = frames.projector().frame_time;
    let fit = |seconds: f64| {
        let seconds = seconds.clamp(shortest, longest);
        let whole = (seconds / frame_time).floor() * frame_time;
        if frame_time > 0.0 && whole >= shortest { whole.max(frame_time) } else { seconds }
    };
    let range = curve.brightest() - curve.zero;
    let mut exposure = fit(if frame_time > 0.0 { frame_time } else { (shortest * longest).sqrt() });
    let mut chosen = None;
    for _ in 0..TEST_PHOTOS {
        let photo = average(frames, curve, white, exposure, 0..1)?;
        let peak = brightest(&photo, used, channels).map(|peak| (peak - curve.zero) / range);
        let next = match peak {
            None if exposure <= shortest => return Err(too_bright(shortest)),
            None => exposure * DOWN,
            Some(peak) if peak < DARK && exposure < fit(longest) => {
                exposure * UP.min(TARGET / peak.max(1e-9))
            }
            Some(peak) => {
                chosen = Some(fit(exposure * TARGET / peak.max(1e-9)));
                break;
            }
        };
        // When one whole refresh of the projector is still too long, parts of a refresh follow.
        exposure = if fit(next) == exposure { next.clamp(shortest, longest) } else { fit(next) };
    }
    let mut exposures = vec![chosen.unwrap_or(exposure)];
    while exposures.len() < brackets as usize {
        let last = exposures[exposures.len() - 1];
        let next = fit(last * BRACKET);
        if next <= last || darkest_is_well(&average(frames, curve, white, last, 0..1)?, curve, used, channels)
        {
            break;
        }
        exposures.push(next);
    }
    Ok(exposures)
}

/// The linear DN of the brightest sample; `None` when a sample is saturated.
fn brightest(photo: &AveragedExposure, used: &[bool], channels: usize) -> Option<f64> {
    let mut brightest = f64::NEG_INFINITY;
    for (sample, &mean) in photo.mean.iter().enumerate().filter(|(sample, _)| used[sample / channels]) {
        if photo.saturated[sample] {
            return None;
        }
        brightest = brightest.max(mean);
    }
    Some(brightest)
}

/// Whether every used sample is either saturated or well above its noise.
fn darkest_is_well(photo: &AveragedExposure, curve: &CameraCurve, used: &[bool], channels: usize) -> bool {
    photo.mean.iter().enumerate().filter(|(sample, _)| used[sample / channels]).all(|(sample, &mean)| {
        photo.saturated[sample] || mean - curve.zero >= WELL * photo.variance(curve, sample, mean).sqrt()
    })
}

fn too_bright(shortest: f64) -> Error {
    Error::Saturated {
        device: "camera".into(),
        fault: format!("a white frame saturates it even at its shortest exposure, {shortest} s"),
        help: "close the lens, or darken the projector or the room".into(),
    }
}
