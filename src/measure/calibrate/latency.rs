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
pub(super) const CAREFUL: f64 = 1.0;

/// The result of the sweep.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Latency {
    /// Seconds until all light is there. The error is half of the last interval of the search.
    pub(super) settle: MeasuredValue,
    /// The waits in seconds, and the share of white's light after each.
    pub(super) sweep: Vec<(f64, f64)>,
}

/// Measures the latency by a search over waits. The exposure, in seconds, should be short and must not
/// saturate.
///
/// # Errors
/// Those of taking frames.
pub(super) fn latency(session: &mut CalibrationSession<'_>, exposure: f64) -> Result<Latency> {
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
