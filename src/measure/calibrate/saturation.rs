//! The saturation of the camera: a full well, or the largest count of the converter.

use std::sync::Arc;

use super::session::CalibrationSession;
use crate::error::Result;
use crate::image::percentile;
use crate::rig::Frame;

/// The count that overexposed samples reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plateau {
    /// The count of the plateau.
    pub(super) count: f64,
    /// Whether samples reached it. Otherwise the light did not suffice, and it is the largest possible count.
    pub(super) reached: bool,
    /// Counts from here on may be saturated.
    pub(super) limit: f64,
}

/// Measures the plateau by overexposing `frame` eightfold. Samples above a third of the range at `exposure`
/// seconds should then reach almost three times the range.
pub(super) fn plateau(
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
pub(super) fn limit(plateau: &Plateau, noise: f64, margin: f64) -> f64 {
    (plateau.count - margin * noise).min(plateau.limit).floor()
}
