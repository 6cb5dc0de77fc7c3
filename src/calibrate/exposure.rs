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
pub(crate) fn fill(session: &mut CalibrationSession<'_>, frame: &Arc<Frame>) -> Result<f64> {
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
pub(crate) fn search(
    session: &mut CalibrationSession<'_>,
    frame: &Arc<Frame>,
) -> Result<(f64, WhiteExposure)> {
    let [shortest, longest] = session.camera().exposures;
    let full = session.full();
    let black = session.filled(0);
    let dark = session.capture(&black, shortest)?;
    let floor = percentile(dark.counts.iter().map(|&count| count.into()), 0.5);
    if floor > 0.9 * full {
        // The camera is saturated without a pattern: no exposure fills a range that is not there.
        return Ok((shortest, WhiteExposure::TooBright));
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;
    use crate::measure::CaptureRequest;
    use crate::measure::simulated::Simulated;

    /// What is found for a hundred pixels with so much light, in counts per second above 10, by a camera of 1023 counts, and all exposures that
    /// were tried. The bright pixels shall have 10 + 0.7 · 1013 = 719 counts, within 101.
    fn found(light: impl Fn(usize) -> f64 + Send) -> (f64, WhiteExposure, Vec<f64>) {
        let photo = move |request: &CaptureRequest, _| {
            let is_white = request.frame.levels()[0] > 0;
            let count = |pixel| if is_white { 10.0 + light(pixel) * request.exposure } else { 10.0 };
            (0..100).map(|pixel| count(pixel).round().min(1023.0) as u16).collect()
        };
        let size = Resolution::new(10, 10);
        let mut frames = Simulated::new(size, size, 10, photo);
        let mut session = CalibrationSession::new(&mut frames);
        let white = session.filled(session.top());
        let (exposure, outcome) = search(&mut session, &white).expect("it never fails");
        let asked: Vec<f64> = frames.asked.iter().map(|asked| asked.exposure).collect();
        assert_eq!(asked[0], 1e-3, "black, at the shortest exposure");
        (exposure, outcome, asked[1..].to_vec())
    }

    /// Equal but for the rounding of some thirty counts.
    fn near(found: &[f64], expected: &[f64]) -> bool {
        found.len() == expected.len() && found.iter().zip(expected).all(|(f, e)| (f / e - 1.0).abs() < 0.02)
    }

    #[test]
    fn the_exposure_goes_in_proportion_to_where_bright_pixels_have_seven_tenths_of_the_range() {
        let start = 0.1_f64.sqrt();
        for (light, expected) in [
            // Near enough at once: 619 and 819 counts are.
            (1950.0, &[start][..]),
            (2530.0, &[start]),
            // In proportion, up and down.
            (1890.0, &[start, 709.0 / 1890.0]),
            (2750.0, &[start, 709.0 / 2750.0]),
            (100.0, &[start, 7.09]),
            // More than nine tenths of the range, 922 counts, may be saturated: a fifth, and then in proportion.
            (2950.0, &[start, start / 5.0, 709.0 / 2950.0]),
            (7e4, &[start, start / 5.0, start / 25.0, 709.0 / 7e4]),
        ] {
            let (exposure, outcome, asked) = found(|_| light);
            assert!(near(&asked, expected), "{light}: {asked:?}");
            assert_eq!((outcome, exposure), (WhiteExposure::Filled, asked[asked.len() - 1]));
        }
    }

    #[test]
    fn highlights_of_two_percent_do_not_count_and_of_three_do() {
        let highlights = |count: usize| found(move |pixel| if pixel < count { 1e5 } else { 100.0 });
        assert!(near(&[highlights(2).0], &[7.09]) && near(&[highlights(3).0], &[709.0 / 1e5]));
    }

    #[test]
    fn light_beyond_the_cameras_exposures_is_too_bright_or_too_dark() {
        let (exposure, outcome, _) = found(|_| 1e8);
        assert_eq!((exposure, outcome), (1e-3, WhiteExposure::TooBright));
        // A hundredth of the range at the longest exposure is seen, if dimly.
        for (light, expected) in
            [(0.0, WhiteExposure::TooDark), (0.09, WhiteExposure::TooDark), (0.12, WhiteExposure::Filled)]
        {
            let (exposure, outcome, asked) = found(|_| light);
            assert_eq!((exposure, outcome), (100.0, expected), "{light}");
            assert!(near(&asked[1..], &[30.0 * asked[0], 100.0]), "{asked:?}");
        }
    }

    #[test]
    fn a_warning_says_the_exposure_and_what_to_do() {
        assert_eq!(WhiteExposure::Filled.warning(1.0), None);
        let warning = |outcome: WhiteExposure| outcome.warning(0.25).unwrap_or_default();
        assert!(warning(WhiteExposure::TooBright).contains("saturates the camera even at 0.25 s"));
        assert!(warning(WhiteExposure::TooDark).contains("hardly seen even at 0.25 s"));
    }
}
