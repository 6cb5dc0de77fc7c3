//! The latency of the projector: how long after the confirmation of a frame all of its light is there, and
//! none of the frame before.
//!
//! White is shown after black, and photographed after waits of different lengths. While black is still part
//! of the exposure, the photo has less light than white.

use super::measured_value::MeasuredValue;
use super::session::CalibrationSession;
use crate::error::Result;

/// The shortest wait that is tried besides none, in seconds.
const SHORTEST: f64 = 1e-3;

/// The wait in seconds before the latency is known, and the longest one that is tried.
pub(crate) const CAREFUL: f64 = 1.0;

/// The result of the sweep.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Latency {
    /// Seconds until all light is there. The error is half of the last interval of the search.
    pub(crate) settle: MeasuredValue,
    /// The waits in seconds, and the share of white's light after each.
    pub(crate) sweep: Vec<(f64, f64)>,
}

/// Measures the latency by a search over waits. The exposure, in seconds, should be short and must not
/// saturate.
///
/// # Errors
/// Those of taking frames.
pub(crate) fn latency(session: &mut CalibrationSession<'_>, exposure: f64) -> Result<Latency> {
    let (black, white) = (session.filled(0), session.filled(session.top()));
    let step = |session: &mut CalibrationSession<'_>, wait: f64| -> Result<f64> {
        session.set_settle(CAREFUL);
        session.capture(&black, exposure)?;
        session.set_settle(wait);
        let raw = session.capture(&white, exposure)?;
        Ok(raw.counts.iter().map(|&count| f64::from(count)).sum::<f64>() / raw.counts.len() as f64)
    };
    session.set_settle(CAREFUL);
    let dark = session.mean(&black, exposure, 1)?;
    let dark = dark.counts.iter().sum::<f64>() / dark.counts.len() as f64;
    let mut fulls = Vec::new();
    for _ in 0..4 {
        fulls.push(step(session, CAREFUL)?);
    }
    let full = fulls.iter().sum::<f64>() / 4.0;
    let spread = (fulls.iter().map(|value| (value - full).powi(2)).sum::<f64>() / 3.0).sqrt();
    let light = (full - dark).max(f64::MIN_POSITIVE);
    // The spread of four values is uncertain, and drift and flicker may change the light by a thousandth.
    let tolerance = (5.0 * spread / light).max(2e-3);
    let mut sweep = Vec::new();
    let missing =
        |session: &mut CalibrationSession<'_>, wait: f64, sweep: &mut Vec<(f64, f64)>| -> Result<bool> {
            let share = (step(session, wait)? - dark) / light;
            sweep.push((wait, share));
            Ok((share - 1.0).abs() > tolerance)
        };
    let mut found = MeasuredValue::new(0.0, 0.0);
    if missing(session, 0.0, &mut sweep)? {
        let (mut low, mut high) = (0.0, SHORTEST);
        while high < CAREFUL && missing(session, high, &mut sweep)? {
            (low, high) = (high, 2.0 * high);
        }
        for _ in 0..6 {
            let middle = 0.5 * (low + high);
            if missing(session, middle, &mut sweep)? { low = middle } else { high = middle }
        }
        found = MeasuredValue::new(high, 0.5 * (high - low));
    }
    session.set_settle(CAREFUL);
    sweep.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(Latency { settle: found, sweep })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;
    use crate::measure::CaptureRequest;
    use crate::measure::simulated::Simulated;

    const EXPOSURE: f64 = 0.02;

    /// The latency of a rig whose light of white, 50,000 counts above 100, is `share` of the wait in seconds and of the number of the photo of
    /// white. The wait at the end is returned, too.
    fn found(share: impl Fn(f64, usize) -> f64 + Send) -> (Latency, f64) {
        let mut whites = 0;
        let photo = move |request: &CaptureRequest, wait: f64| {
            assert_eq!(request.exposure, EXPOSURE);
            let is_white = request.frame.levels()[0] > 0;
            // Before white, black is always shown long enough.
            assert!(is_white || wait == CAREFUL);
            whites += usize::from(is_white);
            let light = if is_white { 50_000.0 * share(wait, whites) } else { 0.0 };
            vec![(100.0 + light).round() as u16; 6]
        };
        let size = Resolution::new(3, 2);
        let mut frames = Simulated::new(size, size, 16, photo);
        let latency = latency(&mut CalibrationSession::new(&mut frames), EXPOSURE).expect("it never fails");
        (latency, frames.settle)
    }

    #[test]
    fn the_wait_is_found_after_which_all_light_is_there() {
        let late = 0.0137;
        let (latency, wait) = found(|wait, _| (1.0 - (late - wait).max(0.0) / EXPOSURE).max(0.0));
        // Six halvings of the interval from 8 to 16 ms; up to two thousandths of the light may be missing.
        let (value, error) = (latency.settle.value, latency.settle.error);
        assert!((error - 0.5 * 8e-3 / 64.0).abs() < 1e-12, "{error}");
        assert!((late - 2e-3 * EXPOSURE..=late + 2.0 * error).contains(&value), "{value}");
        assert_eq!(latency.sweep.len(), 1 + 5 + 6);
        assert!(latency.sweep.is_sorted_by(|a, b| a.0 < b.0) && latency.sweep[0].0 == 0.0);
        for (wait, share) in latency.sweep {
            let expected = (1.0 - (late - wait).max(0.0) / EXPOSURE).max(0.0);
            assert!((share - expected).abs() < 2e-5, "{share} after {wait}");
        }
        assert_eq!(wait, CAREFUL);
    }

    #[test]
    fn a_projector_without_latency_needs_no_wait_and_one_that_never_settles_the_longest() {
        let (latency, _) = found(|_, _| 1.0);
        assert_eq!((latency.settle, latency.sweep.len()), (MeasuredValue::new(0.0, 0.0), 1));
        // The first four photos of white are the reference.
        let (latency, _) = found(|_, white| if white <= 4 { 1.0 } else { 0.9 });
        assert!(latency.settle.value >= CAREFUL, "{:?}", latency.settle);
    }

    /// Whites of 1 ± 0.005 scatter by 0.0058, of which five times as much is no sign that light is missing: 2.9 %.
    #[test]
    fn light_is_missing_where_it_differs_by_more_than_repeated_whites_do() {
        let flickering = |after: f64| {
            found(move |_, white| match white {
                1 | 3 => 1.005,
                2 | 4 => 0.995,
                _ => after,
            })
        };
        for (after, is_settled) in [(0.975, true), (0.965, false), (1.025, true), (1.035, false)] {
            assert_eq!(flickering(after).0.settle.value == 0.0, is_settled, "{after}");
        }
    }
}
