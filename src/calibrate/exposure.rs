//! The exposure at which white fills the camera's range, and the count at which the camera saturates.

use std::sync::Arc;

use super::session::CalibrationSession;
use crate::error::{Error, Result};
use crate::image::percentile;
use crate::rig::Frame;

/// The exposure is chosen so that bright pixels reach this fraction of the camera's range.
const FILL: f64 = 0.7;

/// The quantile of the counts that stands for bright pixels. The pixels above it are regarded as highlights.
const BRIGHT: f64 = 0.98;

/// Whether the camera has an exposure that suits a white frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhiteExposure {
    /// White fills about 70 % of the camera's range, or as nearly as the camera's exposures allow.
    Filled,
    /// White saturates the camera even at the shortest exposure.
    TooBright,
    /// White is hardly seen even at the longest exposure.
    TooDark,
}

impl WhiteExposure {
    /// Describes the fault of `exposure` (in seconds) and its remedy. Returns `None` when the exposure suits white.
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

/// Finds the exposure in seconds at which the 98th percentile of the photo of `frame` is about 70 % of the camera's range. If no exposure
/// is long enough, the longest exposure is returned. Fails with [`Error::Saturated`] when even the shortest exposure saturates, and with
/// [`Error::Rig`] when the frame is not seen at the longest exposure.
pub(crate) fn fill(session: &mut CalibrationSession<'_>, frame: &Arc<Frame>) -> Result<f64> {
    match search(session, frame)? {
        (exposure, WhiteExposure::Filled) => Ok(exposure),
        (exposure, WhiteExposure::TooBright) => Err(saturated(exposure)),
        (exposure, WhiteExposure::TooDark) => Err(unseen(exposure)),
    }
}

/// Finds the exposure in seconds at which `frame` fills the camera's range best, and assesses how well this exposure suits the frame.
pub(crate) fn search(
    session: &mut CalibrationSession<'_>,
    frame: &Arc<Frame>,
) -> Result<(f64, WhiteExposure)> {
    let [shortest, longest] = session.camera().exposures;
    let full = session.full();
    let black = session.filled(0);
    let dark = session.capture(&black, shortest)?;
    let floor = dark.percentile(0.5);
    if floor > 0.9 * full {
        // The camera is saturated without a pattern, so no range is left to fill.
        return Ok((shortest, WhiteExposure::TooBright));
    }
    let target = floor + FILL * (full - floor);
    let mut exposure = session.allowed((shortest * longest).sqrt());
    for _ in 0..24 {
        let raw = session.capture(frame, exposure)?;
        let bright = raw.percentile(BRIGHT);
        if (bright - target).abs() < 0.1 * (full - floor) {
            return Ok((raw.exposure, WhiteExposure::Filled));
        }
        // A saturated photo shows only that the exposure was much too long. The camera's full well may saturate below the largest count.
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
    // The camera's full well saturates below the target, so bright pixels cannot reach the target.
    Ok((exposure, WhiteExposure::Filled))
}

fn saturated(exposure: f64) -> Error {
    Error::saturated("camera", format!(
            "the white frame saturates it even at {exposure} s, the shortest exposure that suits the projector"
        )).help("close the lens's aperture, lower the gain, or dim the projector")
}

fn unseen(exposure: f64) -> Error {
    Error::rig("camera", format!("it hardly sees the white frame at {exposure} s, its longest exposure"))
        .help("take off the lens cap, open the aperture, or let the projector light what the camera sees")
}

/// The count that overexposed samples reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plateau {
    pub(crate) count: f64,
    /// Whether samples reached the plateau. Otherwise the photo was not bright enough, and `count` is the largest possible count.
    pub(crate) reached: bool,
    /// Counts of at least this value may be saturated.
    pub(crate) limit: f64,
}

/// Measures the plateau by an exposure of `frame` eight times as long as `exposure` (in seconds). Samples above a third of the range at
/// `exposure` should then reach almost three times the range.
pub(crate) fn plateau(
    session: &mut CalibrationSession<'_>,
    frame: &Arc<Frame>,
    exposure: f64,
    floor: f64,
) -> Result<Plateau> {
    let full = session.full();
    let unreached = Plateau { count: full, reached: false, limit: full };
    let over = session.allowed(8.0 * exposure);
    if over < 4.0 * exposure {
        return Ok(unreached);
    }
    let plain = session.capture(frame, exposure)?;
    let bright = session.capture(frame, over)?;
    let third = floor + 0.33 * (full - floor);
    let pairs = plain.counts.iter().zip(&bright.counts);
    let over: Vec<f64> =
        pairs.filter(|(plain, _)| f64::from(**plain) > third).map(|(_, &b)| b.into()).collect();
    if over.len() < 8 {
        return Ok(unreached);
    }
    let count = percentile(over.iter().copied(), 0.5);
    let low = percentile(over.iter().copied(), 0.02);
    // A plateau is flat. If the overexposed samples still vary with the scene, the well was not full.
    if count - low > 0.02 * (full - floor) {
        return Ok(unreached);
    }
    Ok(Plateau { count, reached: true, limit: low.min(count - 2.0 * (count - low)) })
}

/// Computes the count from which samples are regarded as saturated. This count lies `margin` standard deviations of `noise` below the
/// plateau, so that a sample whose mean is on the plateau is recognized in spite of its noise.
pub(crate) fn limit(plateau: &Plateau, noise: f64, margin: f64) -> f64 {
    (plateau.count - margin * noise).min(plateau.limit).floor()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;
    use crate::measure::CaptureRequest;
    use crate::measure::simulated::Simulated;

    /// Searches the exposure for a hundred pixels. The function `light` gives the light of a pixel, in counts per second above the black
    /// level of 10. Returns the exposure, the outcome and all exposures that were tried. The largest count is 1023. The target for bright
    /// pixels is 10 + 0.7 · 1013 = 719 counts. A difference of up to 101 counts is accepted.
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

    /// Whether the values agree within 2 %, which is the rounding error of some thirty counts.
    fn near(found: &[f64], expected: &[f64]) -> bool {
        found.len() == expected.len() && found.iter().zip(expected).all(|(f, e)| (f / e - 1.0).abs() < 0.02)
    }

    #[test]
    fn the_exposure_goes_in_proportion_to_where_bright_pixels_have_seven_tenths_of_the_range() {
        let start = 0.1_f64.sqrt();
        for (light, expected) in [
            // Bright pixels with 619 and 819 counts are accepted at the first exposure.
            (1950.0, &[start][..]),
            (2530.0, &[start]),
            (1890.0, &[start, 709.0 / 1890.0]),
            (2750.0, &[start, 709.0 / 2750.0]),
            (100.0, &[start, 7.09]),
            // Above 922 counts (nine tenths of the range), the photo may be saturated. The exposure is divided by five, then scaled.
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
        // White is seen if it has a hundredth of the range at the longest exposure.
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

    /// Measures the plateau for a hundred pixels. The function `of` gives the light (in counts per second) and the full well of a pixel.
    /// The camera has a largest count of 1023 and the given longest exposure. White is exposed for one second.
    fn found_of_saturation(longest: f64, of: impl Fn(usize) -> [f64; 2] + Send) -> Plateau {
        let photo =
            move |request: &CaptureRequest, _| (0..100).map(of_pixel(request.exposure, &of)).collect();
        let size = Resolution::new(10, 10);
        let mut frames = Simulated::new(size, size, 10, photo);
        frames.camera.exposures[1] = longest;
        let mut session = CalibrationSession::new(&mut frames);
        let white = session.filled(session.top());
        plateau(&mut session, &white, 1.0, 10.0).expect("it never fails")
    }

    fn of_pixel(seconds: f64, of: &impl Fn(usize) -> [f64; 2]) -> impl Fn(usize) -> u16 {
        move |pixel| {
            let [light, well] = of(pixel);
            (10.0 + light * seconds).min(well).round() as u16
        }
    }

    const UNREACHED: Plateau = Plateau { count: 1023.0, reached: false, limit: 1023.0 };

    #[test]
    fn a_well_that_is_full_below_the_largest_count_is_found() {
        let even = Plateau { count: 900.0, reached: true, limit: 900.0 };
        assert_eq!(found_of_saturation(100.0, |_| [700.0, 900.0]), even);
        // Pixels below a third of the range (344 counts) need not reach the plateau. Eight times 33 counts would not reach it.
        assert_eq!(found_of_saturation(100.0, |pixel| [if pixel < 50 { 33.0 } else { 700.0 }, 900.0]), even);
        // Three of a hundred pixels saturate ten counts lower, so the limit is twice as far below the plateau.
        let uneven = |less: f64| {
            found_of_saturation(100.0, move |pixel| [700.0, if pixel < 3 { 900.0 - less } else { 900.0 }])
        };
        assert_eq!(uneven(10.0), Plateau { limit: 880.0, ..even });
        // A spread of a fiftieth of the range (twenty counts) is still regarded as flat.
        assert_eq!(uneven(20.0), Plateau { limit: 860.0, ..even });
        assert_eq!(uneven(21.0), UNREACHED);
    }

    #[test]
    fn without_enough_light_the_limit_is_the_largest_count() {
        assert_eq!(
            found_of_saturation(3.9, |_| [700.0, 900.0]),
            UNREACHED,
            "less than four times the exposure"
        );
        assert!(found_of_saturation(4.0, |_| [700.0, 900.0]).reached);
        for (bright, reached) in [(7, false), (8, true)] {
            let of = move |pixel: usize| [if pixel < bright { 700.0 } else { 100.0 }, 900.0];
            assert_eq!(found_of_saturation(100.0, of).reached, reached, "{bright} bright pixels");
        }
        // A third of the range begins at 344.3 counts.
        assert!(
            !found_of_saturation(100.0, |_| [334.0, 900.0]).reached
                && found_of_saturation(100.0, |_| [335.0, 900.0]).reached
        );
    }

    #[test]
    fn the_limit_is_a_whole_count_so_many_deviations_below_the_plateau() {
        let plateau = Plateau { count: 900.0, reached: true, limit: 880.0 };
        assert_eq!(limit(&plateau, 7.5, 3.0), 877.0);
        assert_eq!(limit(&plateau, 2.0, 3.0), 880.0);
    }
}
