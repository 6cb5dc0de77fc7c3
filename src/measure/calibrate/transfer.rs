//! The photon transfer curve: gain and read noise from pairs of equal frames.
//!
//! Two frames of one pattern at one exposure differ by noise alone. Half of the variance of their difference
//! is the variance of one frame, `σ² = σ_read² + s/gain`. Here `s` is the signal in linear DN above black,
//! and the gain is in electrons per DN. This is a line over `s` (Janesick, *Photon Transfer*, 2007; EMVA
//! 1288, section 6). The variance of rounding to counts, 1/12, is known. It is subtracted, because the noise
//! model of [`crate::measure`] adds it as a separate term.

use super::least_squares::Normal;
use super::linear::Linear;
use super::measured_value::MeasuredValue;
use crate::error::Result;
use crate::rig::RawFrame;

/// A response with a slope below this, in linear DN per count, is flat.
const FLAT: f64 = 0.2;

/// The variance of rounding, in squared counts.
const ROUNDING: f64 = 1.0 / 12.0;

/// The number of bins by signal into which the pixels of a pair of frames are sorted.
const BINS: usize = 12;

/// The noise of a camera: gain in electrons per linear DN, and read noise in DN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transfer {
    pub(super) gain: MeasuredValue,
    pub(super) read_noise: MeasuredValue,
}

/// One bin: the mean signal in linear DN, the variance of one frame in linear DN², the squared slope of
/// linear DN over counts, and the number of samples.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    signal: f64,
    variance: f64,
    slope: f64,
    samples: f64,
}

/// Fits the line to pairs of frames. The darkest pair should be as dark as possible. Samples of `limit` and
/// more are left out.
///
/// # Errors
/// [`crate::Error::Numerical`] when all pairs have the same brightness.
pub(super) fn transfer(pairs: &[[RawFrame; 2]], linear: &Linear, limit: f64) -> Result<Transfer> {
    let points: Vec<Point> = pairs.iter().flat_map(|pair| bins(pair, linear, limit)).collect();
    let mut estimate = [1.0, 1.0];
    let mut solution = None;
    // The error of a variance is proportional to the variance, so the weights depend on the fit. A few
    // iterations converge.
    for _ in 0..6 {
        let mut normal = Normal::new(2);
        for point in &points {
            let predicted =
                ((estimate[0] + ROUNDING) * point.slope + estimate[1] * point.signal.max(0.0)).max(1e-9);
            let weight = 0.5 * (point.samples - 1.0) / (predicted * predicted);
            normal.add_full(&[point.slope, point.signal], point.variance - point.slope * ROUNDING, weight);
        }
        let found = normal.solve()?;
        estimate = [found.values[0].max(1e-6), found.values[1].max(1e-9)];
        solution = Some(found);
    }
    let Some(solution) = solution else {
        return Err(crate::Error::Numerical("no frames for the photon transfer curve".into()));
    };
    let [read_variance, inverse] = estimate;
    let read = read_variance.sqrt();
    Ok(Transfer {
        gain: MeasuredValue::new(1.0 / inverse, solution.error(1) / (inverse * inverse)),
        read_noise: MeasuredValue::new(read, solution.error(0) / (2.0 * read)),
    })
}

/// The bins of a pair of frames.
fn bins(pair: &[RawFrame; 2], linear: &Linear, limit: f64) -> Vec<Point> {
    let mut samples: Vec<(f64, f64, f64)> = pair[0]
        .counts
        .iter()
        .zip(&pair[1].counts)
        .map(|(&a, &b)| [f64::from(a), f64::from(b)])
        .filter(|counts| counts.iter().all(|&count| count < limit && count > 0.0))
        .map(|[a, b]| {
            let (mean, slope) = (0.5 * (a + b), linear.slope(0.5 * (a + b)));
            (linear.of(mean), slope * (a - b), slope * slope)
        })
        .collect();
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    let size = samples.len().div_ceil(BINS).max(64);
    samples
        .chunks(size)
        .filter(|chunk| chunk.len() >= 32)
        // Where the inverse response is flat, its slope is not known well enough to convert the noise.
        .filter(|chunk| chunk.iter().all(|sample| sample.2 > FLAT * FLAT))
        .map(|chunk| {
            let count = chunk.len() as f64;
            let mean = |of: &dyn Fn(&(f64, f64, f64)) -> f64| chunk.iter().map(of).sum::<f64>() / count;
            // A change of the light between the two frames is the mean of the differences, which is
            // subtracted.
            let drift = mean(&|sample| sample.1);
            let squares: f64 = chunk.iter().map(|sample| (sample.1 - drift).powi(2)).sum();
            Point {
                signal: mean(&|sample| sample.0),
                variance: 0.5 * squares / (count - 1.0),
                slope: mean(&|sample| sample.2),
                samples: count,
            }
        })
        .collect()
}
