//! The exposure at which white fills the camera's range.

use std::sync::Arc;

use super::session::CalibrationSession;
use crate::error::{Error, Result};
use crate::image::percentile;
use crate::rig::Frame;

/// The share of the range that the bright pixels should reach.
const FILL: f64 = 0.7;

/// The quantile of the pixels that counts as bright. The pixels above it are highlights.
const BRIGHT: f64 = 0.98;

/// How well the camera's exposures suit a white frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhiteExposure {
    /// White fills about 70 % of the camera's range, or as near to that as the camera's exposures allow.
    Filled,
    /// White saturates the camera even at the shortest exposure.
    TooBright,
    /// White is hardly seen even at the longest exposure.
    TooDark,
}

impl WhiteExposure {
    /// What is wrong with `exposure`, in seconds, and what to do. `None` when it suits white.
    pub fn warning(self, exposure: f64) -> Option<String> {
        match self {
            Self::Filled => None,
            Self::TooBright => Some(format!(
                "white saturates the camera even at {exposure} s, its shortest exposure: close the lens, or lower its gain"
            )),
            Self::TooDark => Some(format!(
                "white is hardly seen even at {exposure} s, the longest exposure: take off the lens cap, or open the lens"
            )),
        }
    }
}

/// The exposure in seconds at which the 98th percentile of the photo of `frame` is about 70 % of the camera's
/// range, or the longest exposure when that is too short.
///
/// # Errors
/// [`Error::Saturated`] when even the shortest exposure saturates; [`Error::Rig`] when the longest exposure
/// shows nothing.
pub(super) fn fill(session: &mut CalibrationSession<'_>, frame: &Arc<Frame>) -> Result<f64> {
    match search(session, frame)? {
        (exposure, WhiteExposure::Filled) => Ok(exposure),
        (exposure, WhiteExposure::TooBright) => Err(saturated(exposure)),
        (exposure, WhiteExposure::TooDark) => Err(unseen(exposure)),
    }
}

/// The exposure in seconds at which `frame` fills the range best, and whether it suits the frame.
///
/// # Errors
/// Those of taking frames.
pub(super) fn search(
    session: &mut CalibrationSession<'_>,
    frame: &Arc<Frame>,
) -> Result<(f64, WhiteExposure)> {
    let [shortest, longest] = session.camera().exposures;
    let full = session.full();
    let black = session.filled(0);
    let dark = session.capture(&black, shortest)?;
    let floor = percentile(dark.counts.iter().map(|&count| count.into()), 0.5);
    let target = floor + FILL * (full - floor);
    let mut exposure = session.allowed((shortest * longest).sqrt());
    for _ in 0..24 {
        let raw = session.capture(frame, exposure)?;
        let bright = percentile(raw.counts.iter().map(|&count| count.into()), BRIGHT);
        if (bright - target).abs() < 0.1 * (full - floor) {
            return Ok((raw.exposure, WhiteExposure::Filled));
        }
        // A saturated photo only says that the exposure was much too long. A full well may saturate below the
        // largest count.
        let factor = if bright > floor + 0.9 * (full - floor) {
            0.2
        } else {
            ((target - floor) / (bright - floor).max(1e-3 * (full - floor))).clamp(0.2, 30.0)
        };
        let next = session.allowed(exposure * factor);
        if next == exposure {
            return if factor < 1.0 {
                Ok((exposure, WhiteExposure::TooBright))
            } else if bright - floor < 0.01 * (full - floor) {
                Ok((exposure, WhiteExposure::TooDark))
            } else {
                Ok((raw.exposure, WhiteExposure::Filled))
            };
        }
        exposure = next;
    }
    // The well is full below the target, which bright pixels therefore cannot reach.
    Ok((exposure, WhiteExposure::Filled))
}

fn saturated(exposure: f64) -> Error {
    Error::Saturated {
        device: "camera".into(),
        fault: format!(
            "the white frame saturates it even at {exposure} s, the shortest exposure that suits the projector"
        ),
        help: "close the lens's aperture, lower the gain, or dim the projector".into(),
    }
}

fn unseen(exposure: f64) -> Error {
    Error::Rig {
        device: "camera".into(),
        fault: format!("it hardly sees the white frame at {exposure} s, its longest exposure"),
        help: "take off the lens cap, open the aperture, or let the projector light what the camera sees"
            .into(),
    }
}
