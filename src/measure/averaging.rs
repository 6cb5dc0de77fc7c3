//! The averaging stage: the mean of repeated takes of one frame, in linear light.

use std::ops::Range;
use std::sync::Arc;

use super::frame_source::{CaptureRequest, FrameSource};
use super::response::CameraCurve;
use crate::error::{Error, Result};
use crate::rig::Frame;

/// The mean of several takes at one exposure. Values are samples of the camera, interleaved as in
/// [`crate::rig::RawFrame`].
#[derive(Clone, Debug)]
pub(crate) struct AveragedExposure {
    /// The exposure of one take, in seconds.
    pub(crate) exposure: f64,
    /// When the first take began, in seconds on the rig's clock.
    pub(crate) started: f64,
    /// The number of takes.
    pub(crate) takes: u32,
    /// The mean, in linear DN.
    pub(crate) mean: Vec<f64>,
    /// The variance that rounding to counts adds to one take, in linear DN².
    pub(crate) rounding: Vec<f64>,
    /// The variance of one take, from the differences between the takes, in linear DN². 0 where there is one take.
    pub(crate) scatter: Vec<f64>,
    /// Which samples were saturated in at least one take. Their mean has no meaning.
    pub(crate) saturated: Vec<bool>,
}

/// Captures `frame` at `exposure` seconds once for each number in `takes`, and averages.
pub(crate) fn average(
    frames: &mut dyn FrameSource,
    curve: &CameraCurve,
    frame: &Arc<Frame>,
    exposure: f64,
    takes: Range<u32>,
) -> Result<AveragedExposure> {
    let samples = frames.camera().resolution.pixels() * frames.camera().channels;
    let count = takes.end - takes.start;
    let mut sum = AveragedExposure {
        exposure,
        started: 0.0,
        takes: count,
        mean: vec![0.0; samples],
        rounding: vec![0.0; samples],
        scatter: vec![0.0; samples],
        saturated: vec![false; samples],
    };
    for take in takes.clone() {
        let raw = frames.capture(&CaptureRequest { frame: Arc::clone(frame), exposure, take })?;
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
        // The sums of squared differences to the mean so far (Welford 1962).
        let before = f64::from(take - takes.start);
        for (sample, &count) in raw.counts.iter().enumerate() {
            let light = curve.linear(count);
            if before > 0.0 {
                let off = light - sum.mean[sample] / before;
                sum.scatter[sample] += off * off * before / (before + 1.0);
            }
            sum.mean[sample] += light;
            sum.rounding[sample] += curve.rounding(count);
            sum.saturated[sample] |= curve.is_saturated(count);
        }
    }
    let share = 1.0 / f64::from(count);
    for value in sum.mean.iter_mut().chain(&mut sum.rounding) {
        *value *= share;
    }
    sum.scatter.iter_mut().for_each(|squares| *squares /= f64::from(count.max(2) - 1));
    Ok(sum)
}

impl AveragedExposure {
    /// The variance of the mean, in linear DN², where the expected value is `expected`.
    pub(crate) fn variance(&self, curve: &CameraCurve, sample: usize, expected: f64) -> f64 {
        curve.variance(expected, self.rounding[sample]) / f64::from(self.takes)
    }
}
