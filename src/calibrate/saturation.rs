//! The saturation of the camera: a full well, or the largest count of the converter.

use std::sync::Arc;

use super::session::CalibrationSession;
use crate::error::Result;
use crate::image::percentile;
use crate::rig::Frame;

/// The count that overexposed samples reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plateau {
    /// The count of the plateau.
    pub(crate) count: f64,
    /// Whether samples reached it. Otherwise the light did not suffice, and it is the largest possible count.
    pub(crate) reached: bool,
    /// Counts from here on may be saturated.
    pub(crate) limit: f64,
}

/// Measures the plateau by overexposing `frame` eightfold. Samples above a third of the range at `exposure`
/// seconds should then reach almost three times the range.
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

/// The count from which on samples are regarded as saturated: `margin` standard deviations of `noise` below
/// the plateau. So a sample whose mean is on the plateau is recognized in spite of its noise.
pub(crate) fn limit(plateau: &Plateau, noise: f64, margin: f64) -> f64 {
    (plateau.count - margin * noise).min(plateau.limit).floor()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;
    use crate::measure::CaptureRequest;
    use crate::measure::simulated::Simulated;

    /// The plateau of a hundred pixels, each with its light in counts per second above 10 and its full well, by a camera of 1023 counts
    /// whose longest exposure is given; white is exposed for one second.
    fn found(longest: f64, of: impl Fn(usize) -> [f64; 2] + Send) -> Plateau {
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
        assert_eq!(found(100.0, |_| [700.0, 900.0]), even);
        // Pixels below a third of the range, 344 counts, need not reach it: eight times 33 would not.
        assert_eq!(found(100.0, |pixel| [if pixel < 50 { 33.0 } else { 700.0 }, 900.0]), even);
        // Three of a hundred are full ten counts earlier: the limit is twice as far below.
        let uneven =
            |less: f64| found(100.0, move |pixel| [700.0, if pixel < 3 { 900.0 - less } else { 900.0 }]);
        assert_eq!(uneven(10.0), Plateau { limit: 880.0, ..even });
        // A fiftieth of the range, twenty counts, is still flat.
        assert_eq!(uneven(20.0), Plateau { limit: 860.0, ..even });
        assert_eq!(uneven(21.0), UNREACHED);
    }

    #[test]
    fn without_enough_light_the_limit_is_the_largest_count() {
        assert_eq!(found(3.9, |_| [700.0, 900.0]), UNREACHED, "less than four times the exposure");
        assert!(found(4.0, |_| [700.0, 900.0]).reached);
        for (bright, reached) in [(7, false), (8, true)] {
            let of = move |pixel: usize| [if pixel < bright { 700.0 } else { 100.0 }, 900.0];
            assert_eq!(found(100.0, of).reached, reached, "{bright} bright pixels");
        }
        // A third of the range begins at 344.3 counts.
        assert!(!found(100.0, |_| [334.0, 900.0]).reached && found(100.0, |_| [335.0, 900.0]).reached);
    }

    #[test]
    fn the_limit_is_a_whole_count_so_many_deviations_below_the_plateau() {
        let plateau = Plateau { count: 900.0, reached: true, limit: 880.0 };
        assert_eq!(limit(&plateau, 7.5, 3.0), 877.0);
        assert_eq!(limit(&plateau, 2.0, 3.0), 880.0);
    }
}
