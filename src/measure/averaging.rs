//! Repeated takes of one frame, averaged as light.

use std::ops::Range;
use std::sync::Arc;

use super::frame_source::{CaptureRequest, FrameSource};
use super::response::CameraCurve;
use crate::error::{Error, Result};
use crate::rig::Frame;

/// The average of some takes at one exposure, on the camera's pixels, interleaved as in [`crate::rig::RawFrame`].
#[derive(Clone, Debug)]
pub(super) struct Exposed {
    /// Seconds that the sensor was open.
    pub(super) exposure: f64,
    /// When the first take began, on the rig's clock.
    pub(super) started: f64,
    /// How many takes.
    pub(super) takes: u32,
    /// Linear DN.
    pub(super) mean: Vec<f64>,
    /// The variance of rounding of a take, in linear DN².
    pub(super) rounding: Vec<f64>,
    /// Where a take was saturated: there the mean says nothing.
    pub(super) saturated: Vec<bool>,
}

/// Takes `frame` at `exposure` once for each of `takes`, and averages.
pub(super) fn average(
    shots: &mut dyn FrameSource,
    curve: &CameraCurve,
    frame: &Arc<Frame>,
    exposure: f64,
    takes: Range<u32>,
) -> Result<Exposed> {
    let samples = shots.camera().resolution.pixels() * shots.camera().channels;
    let count = takes.end - takes.start;
    let mut sum = Exposed {
        exposure,
        started: 0.0,
        takes: count,
        mean: vec![0.0; samples],
        rounding: vec![0.0; samples],
        saturated: vec![false; samples],
    };
    for take in takes.clone() {
        let raw = shots.capture(&CaptureRequest { frame: Arc::clone(frame), exposure, take })?;
        raw.check()?;
        if raw.counts.len() != samples {
            return Err(Error::Dimension {
                what: "counts of a camera's frame",
                expected: samples.to_string(),
                found: raw.counts.len().to_string(),
            });
        }
        if take == takes.start {
            (sum.started, sum.exposure) = (raw.started, raw.exposure);
        }
        for (sample, &count) in raw.counts.iter().enumerate() {
            sum.mean[sample] += curve.linear(count);
            sum.rounding[sample] += curve.rounding(count);
            sum.saturated[sample] |= curve.is_saturated(count);
        }
    }
    let share = 1.0 / f64::from(count);
    for value in sum.mean.iter_mut().chain(&mut sum.rounding) {
        *value *= share;
    }
    Ok(sum)
}

impl Exposed {
    /// The variance of the mean where it is expected to be `expected`.
    pub(super) fn variance(&self, curve: &CameraCurve, sample: usize, expected: f64) -> f64 {
        curve.variance(expected, self.rounding[sample]) / f64::from(self.takes)
    }
}
