//! The noise of a photo, measured over predicted: two frames of one capture request should differ by what the
//! noise model says, and by nothing else.

use serde::Serialize;

use super::calibration::CameraResponse;
use super::response::CameraCurve;
use crate::error::{Error, Result};
use crate::rig::RawFrame;

/// How much two frames of one capture request differ, relative to the predicted noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NoiseRatio {
    /// Root mean square of the differences, each divided by its predicted standard deviation. 1: as
    /// predicted.
    pub ratio: f64,
    /// Its standard error, which follows from the number of samples.
    pub error: f64,
    /// Samples compared: those that are not saturated.
    pub samples: usize,
}

/// Compares two frames of one capture request with the noise that `response` predicts for a camera of this
/// many bits. A common change of brightness is divided out. `None` when all samples are saturated.
///
/// # Errors
/// [`Error::Dimension`] when the frames have different sizes; [`Error::Dimension`] or [`Error::Numerical`]
/// when the response does not belong to this camera.
pub fn noise_ratio(
    first: &RawFrame,
    second: &RawFrame,
    response: &CameraResponse,
    bits: u32,
) -> Result<Option<NoiseRatio>> {
    if first.counts.len() != second.counts.len() {
        return Err(Error::Dimension {
            what: "counts of the second of two equal captures",
            expected: first.counts.len().to_string(),
            found: second.counts.len().to_string(),
        });
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
            // The expected value of both is their mean.
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
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;
    use crate::image::Resolution;

    /// A frame of light from 0 to 3000 DN whose noise is `times` what the response predicts. The sum of
    /// twelve uniform numbers is nearly normal.
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
        // 4096 samples give the root mean square to 1.1 %; the tolerance is four of those. Rounding adds 1/12
        // to a variance of 25 and more.
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
