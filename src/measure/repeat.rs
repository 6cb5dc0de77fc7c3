//! Two frames of one shot: do they differ by as much as the noise model says, and by nothing else?

use serde::Serialize;

use super::calibration::CameraResponse;
use super::response::CameraCurve;
use crate::error::{Error, Result};
use crate::rig::RawFrame;

/// How two frames of one shot differ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Repeat {
    /// Root mean square of the differences in units of the noise that is predicted; 1: as predicted.
    pub z: f64,
    /// Its standard error, by the number of samples.
    pub error: f64,
    /// Samples compared: those that are not saturated.
    pub samples: usize,
}

/// Compares two frames, a common change of brightness aside. `None` where all their samples are saturated.
///
/// # Errors
/// [`Error::Dimension`] and [`Error::Numerical`] when the response is not this camera's; [`Error::Dimension`] when the frames are not of
/// one size.
pub fn repeat(
    first: &RawFrame,
    second: &RawFrame,
    response: &CameraResponse,
    bits: u32,
) -> Result<Option<Repeat>> {
    if first.counts.len() != second.counts.len() {
        return Err(Error::Dimension {
            what: "counts of two frames of one shot",
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
    let ratio = light(0) / light(1);
    let ratio = if ratio.is_finite() && ratio > 0.0 { ratio } else { 1.0 };
    let squares: f64 = pairs
        .iter()
        .map(|&[a, b]| {
            let [first, second] = [curve.linear(a), ratio * curve.linear(b)];
            // Both are expected to be their mean.
            let variance = curve.variance(0.5 * (first + second), curve.rounding(a));
            (first - second).powi(2) / (variance * (1.0 + ratio * ratio))
        })
        .sum();
    let samples = pairs.len();
    let z = (squares / samples as f64).sqrt();
    Ok(Some(Repeat { z, error: z / (2.0 * samples as f64).sqrt(), samples }))
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;
    use crate::image::Resolution;

    /// A frame of light from 0 to 3000 DN with noise of `times` what the response says, by a sum of twelve even numbers.
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
    fn noise_as_predicted_is_told_from_more_and_a_brighter_lamp_is_no_noise() {
        let response =
            CameraResponse { black: 100.0, saturation: 4000.0, gain: 2.0, read_noise: 5.0, curve: None };
        let z = |times: f64, brightness: f64| {
            let found = repeat(&frame(1, times, 1.0), &frame(2, times, brightness), &response, 12);
            found.expect("frames of one size").expect("samples that are not saturated").z
        };
        // 4096 samples tell the root mean square to 1.1 %: four of those. Rounding adds 1/12 to a variance of 25 and more.
        assert!((z(1.0, 1.0) - 1.0).abs() < 0.045, "{}", z(1.0, 1.0));
        assert!((z(2.0, 1.0) - 2.0).abs() < 0.09, "{}", z(2.0, 1.0));
        assert!((z(1.0, 1.05) - 1.0).abs() < 0.045, "{}", z(1.0, 1.05));
    }

    #[test]
    fn saturated_frames_tell_nothing() {
        let response =
            CameraResponse { black: 100.0, saturation: 90.0, gain: 2.0, read_noise: 5.0, curve: None };
        let found = repeat(&frame(1, 0.0, 1.0), &frame(2, 0.0, 1.0), &response, 12);
        assert_eq!(found.expect("frames of one size"), None);
    }
}
