//! The response stage: the camera's counts are converted to linear light with its noise, and light to the projector's levels.
//! [`noise_ratio`] compares the noise of two equal captures with the predicted noise. O'Toole and Kutulakos, section 8.1, have linear
//! devices; here any measured response is inverted.

use serde::Serialize;

use super::calibration::CameraResponse;
use crate::error::{Error, Result};
use crate::rig::RawFrame;

/// The smallest variance that is ever predicted, as a fraction of the variance without light. Without this bound, a dark pixel whose
/// expected value is negative by chance would get too large a weight.
const LEAST_VARIANCE: f64 = 0.25;

/// Converts a camera's counts to linear light with its variance.
///
/// A count corresponds to `L` linear DN of light above black, with the variance
///
/// ```text
/// var L = L / gain + read_noise² + (dL/dcount)² / 12
/// ```
///
/// The three terms are shot noise, read noise, and the rounding to integers, which acts through the slope of the curve.
#[derive(Clone, Debug)]
pub(crate) struct CameraCurve {
    linear: Vec<f64>,
    /// The variance of rounding at each count, in linear DN².
    rounding: Vec<f64>,
    /// The linear DN without light. It is 0 when the response is corrected, and the black level otherwise.
    pub(crate) zero: f64,
    /// The lowest saturated count.
    saturation: f64,
    gain: f64,
    read_variance: f64,
}

impl CameraCurve {
    /// The curve of a camera with this many bits. `undo` corrects black level and response. Without `undo`, counts are used as light. Fails
    /// with [`Error::Dimension`] unless there is one value per count, and with [`Error::Numerical`] if gain or read noise is invalid.
    pub(crate) fn new(response: &CameraResponse, bits: u32, undo: bool) -> Result<Self> {
        let counts = 1_usize << bits;
        if let Some(curve) = response.curve.as_ref().filter(|curve| curve.len() != counts) {
            return Err(Error::dimension(
                "values of the camera's response in the calibration",
                format!("{counts}, one for each count of {bits} bits,"),
                curve.len(),
            ));
        }
        if !(response.gain > 0.0 && response.read_noise >= 0.0) {
            return Err(Error::Numerical(format!(
                "the camera's calibration has a gain of {} electrons per DN (more than 0 expected) and a read noise of {} DN (0 or \
                 more expected)\n  help: calibrate the rig again: krylux rig calibrate",
                response.gain, response.read_noise
            )));
        }
        let linear: Vec<f64> = match (&response.curve, undo) {
            (_, false) => (0..counts).map(|count| count as f64).collect(),
            (None, true) => (0..counts).map(|count| count as f64 - response.black).collect(),
            (Some(curve), true) => curve.clone(),
        };
        let slope = |count: usize| {
            let (low, high) = (count.saturating_sub(1), (count + 1).min(counts - 1));
            (linear[high] - linear[low]) / (high - low).max(1) as f64
        };
        Ok(Self {
            rounding: (0..counts).map(|count| slope(count).powi(2) / 12.0).collect(),
            zero: if undo { 0.0 } else { response.black },
            saturation: response.saturation,
            gain: response.gain,
            read_variance: response.read_noise.powi(2),
            linear,
        })
    }

    pub(crate) fn linear(&self, count: u16) -> f64 {
        self.linear[usize::from(count).min(self.linear.len() - 1)]
    }

    pub(crate) fn rounding(&self, count: u16) -> f64 {
        self.rounding[usize::from(count).min(self.rounding.len() - 1)]
    }

    /// Whether a count is saturated, so that the true light may exceed it.
    pub(crate) fn is_saturated(&self, count: u16) -> bool {
        f64::from(count) >= self.saturation
    }

    /// The smallest linear DN whose count is saturated.
    pub(crate) fn brightest(&self) -> f64 {
        let count = (self.saturation.ceil().max(0.0) as usize).min(self.linear.len() - 1);
        self.linear[count]
    }

    /// The variance, in linear DN², of a sample whose *expected* value is `expected` linear DN. `rounding` is the rounding variance of its
    /// count. The measured value must not replace the expected value: samples that are low by chance would then seem more certain.
    pub(crate) fn variance(&self, expected: f64, rounding: f64) -> f64 {
        let dark = self.read_variance + rounding;
        ((expected - self.zero) / self.gain + dark).max(LEAST_VARIANCE * dark)
    }
}

impl CameraCurve {
    /// The variance of a sample that has not been measured yet. The expected count gives its rounding.
    pub(crate) fn variance_of(&self, expected: f64) -> f64 {
        let count = self.linear.partition_point(|&linear| linear < expected).min(self.linear.len() - 1);
        self.variance(expected, self.rounding[count])
    }
}

/// Converts a projector's levels to light, and light to levels.
#[derive(Clone, Debug)]
pub(crate) struct ProjectorCurve {
    /// The light of each level, from 0 to 1.
    light: Vec<f64>,
    /// The widest step between two successive levels.
    pub(crate) widest: f64,
}

impl ProjectorCurve {
    /// The curve of a projector with this many bits: the measured curve with `undo`, and a linear curve without it. Fails with
    /// [`Error::Dimension`] unless the curve has one value per level, and with [`Error::Numerical`] unless it ascends from 0 to 1.
    pub(crate) fn new(curve: &[f64], bits: u32, undo: bool) -> Result<Self> {
        let levels = 1_usize << bits;
        if curve.len() != levels {
            return Err(Error::dimension(
                "values of the projector's response in the calibration",
                format!("{levels}, one for each level of {bits} bits,"),
                curve.len(),
            ));
        }
        let ascends = curve.windows(2).all(|pair| pair[0] <= pair[1]);
        if !(ascends && curve[0] == 0.0 && curve[levels - 1] == 1.0) {
            return Err(Error::Numerical(
                "the projector's response in the calibration does not ascend from 0 to 1\n  help: calibrate the rig again: \
                 krylux rig calibrate"
                    .into(),
            ));
        }
        let light = if undo {
            curve.to_vec()
        } else {
            (0..levels).map(|level| level as f64 / (levels - 1) as f64).collect()
        };
        let widest = light.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
        Ok(Self { light, widest })
    }

    pub(crate) fn light(&self, level: u16) -> f64 {
        self.light[usize::from(level)]
    }

    pub(crate) fn top(&self) -> u16 {
        (self.light.len() - 1) as u16
    }

    /// The brightest level that is not brighter than `light`.
    pub(crate) fn below(&self, light: f64) -> u16 {
        self.light.partition_point(|&of| of <= light).saturating_sub(1) as u16
    }

    pub(crate) fn nearest(&self, light: f64) -> u16 {
        let below = self.below(light);
        let above = below.saturating_add(1).min(self.top());
        if self.light(above) - light < light - self.light(below) { above } else { below }
    }
}

/// The difference between two frames of one capture request, relative to the predicted noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NoiseRatio {
    /// The root mean square of the differences, each divided by its predicted standard deviation. It is 1 for noise as predicted.
    pub ratio: f64,
    /// The standard error of `ratio`, which follows from the number of samples.
    pub error: f64,
    /// The number of compared samples, which are not saturated.
    pub samples: usize,
}

/// Compares two frames of one capture request with the noise that `response` predicts for a camera of this many bits. A common change of
/// brightness is divided out. The result is `None` when all samples are saturated.
///
/// # Errors
/// [`Error::Dimension`] for frames of different sizes; [`Error::Dimension`] or [`Error::Numerical`] for the response of another camera.
pub fn noise_ratio(
    first: &RawFrame,
    second: &RawFrame,
    response: &CameraResponse,
    bits: u32,
) -> Result<Option<NoiseRatio>> {
    if first.counts.len() != second.counts.len() {
        return Err(Error::dimension(
            "counts of the second of two equal captures",
            first.counts.len(),
            second.counts.len(),
        ));
    }
    let curve = CameraCurve::new(response, bits, true)?;
    let pairs: Vec<[u16; 2]> = first
        .counts
        .iter()
        .zip(&second.counts)
        .map(|(&a, &b)| [a, b])
        .filter(|pair| pair.iter().all(|&count| !curve.is_saturated(count)))
        .collect();
    if pairs.is_empty() {
        return Ok(None);
    }
    let light = |of: usize| pairs.iter().map(|pair| curve.linear(pair[of])).sum::<f64>();
    let brightness = light(0) / light(1);
    let brightness = if brightness.is_finite() && brightness > 0.0 { brightness } else { 1.0 };
    let squares: f64 = pairs
        .iter()
        .map(|&[a, b]| {
            let [first, second] = [curve.linear(a), brightness * curve.linear(b)];
            // The expected value of both samples is their mean.
            let variance = curve.variance(0.5 * (first + second), curve.rounding(a));
            (first - second).powi(2) / (variance * (1.0 + brightness * brightness))
        })
        .sum();
    let samples = pairs.len();
    let ratio = (squares / samples as f64).sqrt();
    Ok(Some(NoiseRatio { ratio, error: ratio / (2.0 * samples as f64).sqrt(), samples }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    fn camera(curve: Option<Vec<f64>>) -> CameraResponse {
        CameraResponse { black: 2.0, saturation: 14.0, gain: 4.0, read_noise: 3.0, curve }
    }

    #[test]
    fn the_variance_is_the_sum_of_shot_noise_read_noise_and_rounding() {
        let curve = CameraCurve::new(&camera(None), 4, true).expect("a linear response fits any camera");
        assert_eq!((curve.linear(2), curve.linear(10), curve.brightest()), (0.0, 8.0, 12.0));
        assert_eq!(curve.variance(8.0, curve.rounding(10)), 8.0 / 4.0 + 9.0 + 1.0 / 12.0);
        // The lower bound is 0.25 of the variance without light.
        assert_eq!(curve.variance(-1000.0, 0.0), 0.25 * 9.0);
        assert!(curve.is_saturated(14) && !curve.is_saturated(13));
    }

    #[test]
    fn the_variance_of_rounding_follows_the_slope_of_the_curve() {
        let square = (0..16).map(|count| f64::from(count * count)).collect();
        let curve = CameraCurve::new(&camera(Some(square)), 4, true).expect("16 values for 4 bits");
        assert_eq!((curve.linear(5), curve.rounding(5)), (25.0, 100.0 / 12.0));
        let raw = CameraCurve::new(&camera(None), 4, false).expect("a linear response fits any camera");
        assert_eq!((raw.linear(5), raw.zero), (5.0, 2.0));
        assert!(CameraCurve::new(&camera(Some(vec![0.0; 15])), 4, true).is_err());
    }

    #[test]
    fn the_nearest_level_has_the_nearest_light() {
        let gamma: Vec<f64> = (0..16).map(|level| (f64::from(level) / 15.0).powf(2.2)).collect();
        let levels = ProjectorCurve::new(&gamma, 4, true).expect("ascends from 0 to 1");
        for step in 0..=1000 {
            let light = f64::from(step) / 1000.0;
            let best = gamma.iter().map(|of| (of - light).abs()).fold(f64::INFINITY, f64::min);
            assert!(((levels.light(levels.nearest(light)) - light).abs() - best).abs() < 1e-15);
            assert!(levels.light(levels.below(light)) <= light);
        }
        assert_eq!((levels.nearest(-3.0), levels.nearest(9.0)), (0, 15));
    }

    /// A frame of light from 0 to 3000 DN whose noise is `times` the predicted noise. The sum of twelve uniform numbers is nearly normal.
    fn frame(seed: u64, times: f64, brightness: f64) -> RawFrame {
        let mut random = Pcg64::seed_from_u64(seed);
        let counts = (0..64 * 64)
            .map(|pixel| {
                let light = brightness * 3000.0 * f64::from(pixel) / 4096.0;
                let normal = (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
                (100.0 + light + times * normal * (light / 2.0 + 25.0).sqrt()).round() as u16
            })
            .collect();
        RawFrame {
            resolution: Resolution::new(64, 64),
            channels: 1,
            counts,
            exposure: 0.1,
            id: 0,
            started: 0.0,
        }
    }

    #[test]
    fn the_ratio_is_1_for_predicted_noise_and_does_not_depend_on_the_lamp() {
        let response =
            CameraResponse { black: 100.0, saturation: 4000.0, gain: 2.0, read_noise: 5.0, curve: None };
        let ratio = |times: f64, brightness: f64| {
            let found = noise_ratio(&frame(1, times, 1.0), &frame(2, times, brightness), &response, 12);
            found.expect("frames of one size").expect("samples that are not saturated").ratio
        };
        // The root mean square of 4096 samples has an error of 1.1 %, and the tolerance is four times this error. Rounding adds 1/12 to a
        // variance of at least 25.
        assert!((ratio(1.0, 1.0) - 1.0).abs() < 0.045, "{}", ratio(1.0, 1.0));
        assert!((ratio(2.0, 1.0) - 2.0).abs() < 0.09, "{}", ratio(2.0, 1.0));
        assert!((ratio(1.0, 1.05) - 1.0).abs() < 0.045, "{}", ratio(1.0, 1.05));
    }

    #[test]
    fn saturated_frames_have_no_ratio() {
        let response =
            CameraResponse { black: 100.0, saturation: 90.0, gain: 2.0, read_noise: 5.0, curve: None };
        let found = noise_ratio(&frame(1, 0.0, 1.0), &frame(2, 0.0, 1.0), &response, 12);
        assert_eq!(found.expect("frames of one size"), None);
    }
}
