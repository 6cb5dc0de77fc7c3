//! Exposures chosen from white test shots: the shortest such that the brightest pixel comes near saturation but not to
//! it, then longer ones, as many as allowed, until the darkest pixel is well above its noise.

use std::sync::Arc;

use super::averaging::{Exposed, average};
use super::frame_source::FrameSource;
use super::response::CameraCurve;
use crate::error::{Error, Result};
use crate::rig::Frame;

/// Where the brightest pixel of the white photo is put, as a share of saturation. No pattern is brighter than white, and the
/// rest is for noise, a lamp that brightens, and the black photo.
const TARGET: f64 = 0.8;

/// From a saturated shot to the next.
const DOWN: f64 = 1.0 / 8.0;

/// From a shot that is too dark to say where the brightest pixel ends up to the next, at most.
const UP: f64 = 64.0;

/// Below this share of saturation a shot is too dark for that.
const DARK: f64 = 0.05;

/// From one bracket to the next. Between two a pixel loses at most so much light.
const BRACKET: f64 = 4.0;

/// The darkest pixel is seen well when it is so many standard deviations above black.
const WELL: f64 = 20.0;

/// Test shots at most: from the shortest to the longest exposure of any camera.
const SHOTS: usize = 24;

/// Chooses up to `brackets` exposures, shortest first. `used` are the camera pixels that matter.
pub(super) fn choose(
    shots: &mut dyn FrameSource,
    curve: &CameraCurve,
    white: &Arc<Frame>,
    used: &[bool],
    brackets: u32,
) -> Result<Vec<f64>> {
    let [shortest, longest] = shots.camera().exposures;
    let channels = shots.camera().channels;
    let frame_time = shots.projector().frame_time;
    let fit = |seconds: f64| {
        let seconds = seconds.clamp(shortest, longest);
        let whole = (seconds / frame_time).floor() * frame_time;
        if frame_time > 0.0 && whole >= shortest { whole.max(frame_time) } else { seconds }
    };
    let range = curve.brightest() - curve.zero;
    let mut exposure = fit(if frame_time > 0.0 { frame_time } else { (shortest * longest).sqrt() });
    let mut chosen = None;
    for _ in 0..SHOTS {
        let shot = average(shots, curve, white, exposure, 0..1)?;
        let peak = brightest(&shot, used, channels).map(|peak| (peak - curve.zero) / range);
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
        // Whole frames of a projector cannot be shortened further: then by parts of one.
        exposure = if fit(next) == exposure { next.clamp(shortest, longest) } else { fit(next) };
    }
    let mut exposures = vec![chosen.unwrap_or(exposure)];
    while exposures.len() < brackets as usize {
        let last = exposures[exposures.len() - 1];
        let next = fit(last * BRACKET);
        if next <= last || darkest_is_well(&average(shots, curve, white, last, 0..1)?, curve, used, channels)
        {
            break;
        }
        exposures.push(next);
    }
    Ok(exposures)
}

/// Linear DN of the brightest sample; `None` when one is saturated.
fn brightest(shot: &Exposed, used: &[bool], channels: usize) -> Option<f64> {
    let mut brightest = f64::NEG_INFINITY;
    for (sample, &mean) in shot.mean.iter().enumerate().filter(|(sample, _)| used[sample / channels]) {
        if shot.saturated[sample] {
            return None;
        }
        brightest = brightest.max(mean);
    }
    Some(brightest)
}

fn darkest_is_well(shot: &Exposed, curve: &CameraCurve, used: &[bool], channels: usize) -> bool {
    shot.mean.iter().enumerate().filter(|(sample, _)| used[sample / channels]).all(|(sample, &mean)| {
        shot.saturated[sample] || mean - curve.zero >= WELL * shot.variance(curve, sample, mean).sqrt()
    })
}

fn too_bright(shortest: f64) -> Error {
    Error::Saturated {
        device: "camera".into(),
        fault: format!("a white frame saturates it even at its shortest exposure, {shortest} s"),
        help: "close the lens, or darken the projector or the room".into(),
    }
}
