//! The calibration of the camera, from frames of white and black at many exposures and from the photon transfer curve.

use std::sync::Arc;

use super::exposure::{limit, plateau};
use super::least_squares::Normal;
use super::report::{CameraFigures, MeasuredValue};
use super::response::response;
use super::session::{CalibrationSession, Linear};
use crate::error::{Error, Result};
use crate::measure::CameraResponse;
use crate::rig::{Frame, RawFrame};

/// The number of exposures from white's exposure downwards, in steps of √2. The series also has one longer exposure.
const SERIES: i32 = 15;

/// The number of pairs of black frames at the shortest exposure.
const DARK_PAIRS: usize = 4;

/// The saturation limit lies this many standard deviations of the noise below the plateau.
const MARGIN: f64 = 4.0;

#[derive(Clone, Debug)]
pub(crate) struct CalibratedCamera {
    pub(crate) response: CameraResponse,
    pub(crate) figures: CameraFigures,
    /// The relative noise of one white photo at an average pixel.
    pub(crate) white_noise: f64,
}

/// Calibrates the camera. White fills the range at `exposure` seconds. Fails with [`Error::Rig`] when frames cannot be taken, and with
/// [`Error::Numerical`] when they do not determine the camera's values.
pub(crate) fn camera(
    session: &mut CalibrationSession<'_>,
    white: &Arc<Frame>,
    exposure: f64,
) -> Result<CalibratedCamera> {
    let full = session.full();
    let shortest = session.camera().exposures[0];
    let black = session.filled(0);
    let dark: Vec<[RawFrame; 2]> = (0..DARK_PAIRS)
        .map(|_| Ok([session.capture(&black, shortest)?, session.capture(&black, shortest)?]))
        .collect::<Result<_>>()?;
    let floor = dark[0][0].percentile(0.5);
    let plateau = plateau(session, white, exposure, floor)?;
    let (up, down) = series(session, white, exposure)?;
    let darks = dark_series(session, &black, exposure)?;
    let sorting = session.capture(white, exposure)?;
    // The gain is not known yet. One electron per DN is assumed, because real cameras have less noise than that.
    let careful = limit(&plateau, (plateau.count - floor).sqrt(), MARGIN);
    let whites: Vec<RawFrame> = up.iter().chain(&down).cloned().collect();
    let blacks: Vec<RawFrame> = dark.iter().flatten().chain(&darks).cloned().collect();
    let found = response(&whites, &blacks, &sorting, floor, careful, full)?;
    let mut linear = Linear { black: found.black, curve: found.curve };
    let mut black_error = found.black_error;
    let mut pairs = dark.clone();
    pairs.extend(up.iter().cloned().zip(down.iter().cloned()).map(|(up, down)| [up, down]));
    let first = transfer(&pairs, &linear, careful)?;
    let dark_rate = if linear.curve.is_none() {
        let line = dark_line(&dark, &darks, first.gain.value, first.read_noise.value)?;
        linear.black = line[0].value;
        black_error = line[0].error;
        line[1]
    } else {
        curved_dark_rate(&darks, &linear)
    };
    let noise = transfer(&pairs, &linear, careful)?;
    let top = linear.of(plateau.count);
    let spread = (top.max(0.0) / noise.gain.value + noise.read_noise.value.powi(2)).sqrt();
    let limit = limit(&plateau, spread / linear.slope(plateau.count).max(1e-3), MARGIN);
    let white_noise = white_noise(&sorting, &linear, noise.gain.value, noise.read_noise.value);
    Ok(CalibratedCamera {
        figures: CameraFigures {
            black: MeasuredValue::new(linear.black, black_error),
            read_noise: noise.read_noise,
            gain: noise.gain,
            plateau: plateau.count,
            plateau_reached: plateau.reached,
            full_well: noise.gain.scaled(top),
            departure: found.departure,
            linear: linear.curve.is_none(),
            dark_rate,
            exposure,
        },
        response: CameraResponse {
            black: linear.black,
            saturation: limit,
            gain: noise.gain.value,
            read_noise: noise.read_noise.value,
            curve: linear.curve,
        },
        white_noise,
    })
}

/// Captures white at ascending exposures, then at descending exposures, so that a drift of the light cancels.
fn series(
    session: &mut CalibrationSession<'_>,
    white: &Arc<Frame>,
    exposure: f64,
) -> Result<(Vec<RawFrame>, Vec<RawFrame>)> {
    let mut exposures: Vec<f64> =
        (-1..SERIES).map(|step| session.allowed(exposure * 2_f64.powf(-0.5 * f64::from(step)))).collect();
    exposures.dedup();
    exposures.reverse();
    let up = exposures.iter().map(|&e| session.capture(white, e)).collect::<Result<Vec<_>>>()?;
    let mut down = exposures.iter().rev().map(|&e| session.capture(white, e)).collect::<Result<Vec<_>>>()?;
    down.reverse();
    if up.len() < 3 {
        let fault = "its exposures leave no room for a series: white fills the range near the shortest";
        let help = "close the aperture, lower the gain, or dim the projector";
        return Err(Error::rig("camera", fault).help(help));
    }
    Ok((up, down))
}

/// Captures black at white's exposure and at three shorter exposures.
fn dark_series(
    session: &mut CalibrationSession<'_>,
    black: &Arc<Frame>,
    exposure: f64,
) -> Result<Vec<RawFrame>> {
    let mut frames = Vec::new();
    for step in 0..4 {
        let exposure = session.allowed(exposure * 2_f64.powi(-step));
        for _ in 0..2 {
            frames.push(session.capture(black, exposure)?);
        }
    }
    Ok(frames)
}

/// Fits a line to the mean counts of black frames over their exposure. Returns the black level in DN, and the slope in DN per second.
fn dark_line(
    dark: &[[RawFrame; 2]],
    darks: &[RawFrame],
    gain: f64,
    read_noise: f64,
) -> Result<[MeasuredValue; 2]> {
    let mut normal = Normal::new(2);
    for frame in dark.iter().flatten().chain(darks) {
        let samples = frame.counts.len() as f64;
        let mean = frame.mean();
        // The mean count, black level included, is taken as light. This gives an upper bound of the shot noise.
        let variance = (read_noise.powi(2) + mean / gain) / samples;
        normal.add_full(&[1.0, frame.exposure], mean, 1.0 / variance.max(1e-9));
    }
    let line = normal.solve()?;
    Ok([0, 1].map(|at| MeasuredValue::new(line.values[at], line.error(at))))
}

/// The mean light of black frames, in linear DN per second, for a camera with a curved response.
fn curved_dark_rate(darks: &[RawFrame], linear: &Linear) -> MeasuredValue {
    let rates: Vec<f64> = darks
        .iter()
        .map(|frame| {
            let sum: f64 = frame.counts.iter().map(|&count| linear.of(count.into())).sum();
            sum / frame.counts.len() as f64 / frame.exposure
        })
        .collect();
    let count = rates.len() as f64;
    let mean = rates.iter().sum::<f64>() / count;
    let squares: f64 = rates.iter().map(|rate| (rate - mean).powi(2)).sum();
    MeasuredValue::new(mean, (squares / (count - 1.0).max(1.0) / count).sqrt())
}

/// The noise of a white photo at a pixel with the mean light, relative to this light.
fn white_noise(white: &RawFrame, linear: &Linear, gain: f64, read_noise: f64) -> f64 {
    let light = white.counts.iter().map(|&count| linear.of(count.into()).max(0.0)).sum::<f64>()
        / white.counts.len() as f64;
    (light / gain + read_noise.powi(2)).sqrt() / light.max(f64::MIN_POSITIVE)
}

// The photon transfer curve: gain and read noise from pairs of equal frames.
//
// Two frames of one pattern at one exposure differ only by noise. The variance of one frame is half of the variance of their difference. It
// is `σ² = σ_read² + s/gain`, where `σ_read` is the read noise, `s` is the signal in linear DN above black, and the gain is in electrons
// per DN. The variance is thus a linear function of `s` (Janesick, *Photon Transfer*, 2007; EMVA 1288, section 6). The known variance of
// rounding to counts, 1/12, is subtracted, because the noise model of [`crate::measure`] adds it as a separate term.

/// A response is flat where its slope is less than this, in linear DN per count.
const FLAT: f64 = 0.2;

/// The variance of rounding, in squared counts.
const ROUNDING: f64 = 1.0 / 12.0;

/// The number of bins into which the pixels of a pair of frames are sorted by signal.
const BINS: usize = 12;

/// The noise of a camera: gain in electrons per linear DN, and read noise in DN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Transfer {
    pub(crate) gain: MeasuredValue,
    pub(crate) read_noise: MeasuredValue,
}

/// One bin: mean signal in linear DN, variance of one frame in linear DN², squared slope of linear DN over counts, number of samples.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    signal: f64,
    variance: f64,
    slope: f64,
    samples: f64,
}

/// Fits the photon transfer line to pairs of frames. One pair should be as dark as possible. Samples whose count is at least `limit` are
/// left out. Fails with [`Error::Numerical`] when all pairs have the same brightness.
pub(crate) fn transfer(pairs: &[[RawFrame; 2]], linear: &Linear, limit: f64) -> Result<Transfer> {
    let points: Vec<Point> = pairs.iter().flat_map(|pair| bins(pair, linear, limit)).collect();
    let mut estimate = [1.0, 1.0];
    let mut solution = None;
    // The standard error of a variance is proportional to the variance, so the weights depend on the fit. A few iterations converge.
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
        return Err(Error::Numerical("no frames for the photon transfer curve".into()));
    };
    let [read_variance, inverse] = estimate;
    let read = read_variance.sqrt();
    Ok(Transfer {
        gain: MeasuredValue::new(1.0 / inverse, solution.error(1) / (inverse * inverse)),
        read_noise: MeasuredValue::new(read, solution.error(0) / (2.0 * read)),
    })
}

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
        // The slope of a flat inverse response is too uncertain to convert the noise.
        .filter(|chunk| chunk.iter().all(|sample| sample.2 > FLAT * FLAT))
        .map(|chunk| {
            let count = chunk.len() as f64;
            let mean = |of: &dyn Fn(&(f64, f64, f64)) -> f64| chunk.iter().map(of).sum::<f64>() / count;
            // The mean difference of the two frames is a change of the light, which is subtracted.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;

    #[test]
    fn the_noise_of_white_is_that_of_electrons_and_of_reading_relative_to_its_light() {
        let white = RawFrame {
            resolution: Resolution::new(2, 2),
            channels: 1,
            // The last pixel is below black, which counts as zero light.
            counts: vec![410, 810, 1210, 5],
            exposure: 0.1,
            id: 1,
            started: 0.0,
        };
        let linear = Linear { black: 10.0, curve: None };
        // The average is 600 DN. Four electrons per DN give a variance of 150 DN². The read noise of 11 DN adds 11² DN².
        let found = white_noise(&white, &linear, 4.0, 11.0);
        assert!((found - 271.0_f64.sqrt() / 600.0).abs() < 1e-12, "{found}");
    }

    /// Two frames of 768 samples around `signal`. Their samples differ by `±2 d`, and on average by `drift`. The pair is sorted into twelve
    /// bins of 64 samples each, with a variance of `2 d² · 64 / 63`.
    fn pair(signal: u16, d: u16, drift: u16) -> [RawFrame; 2] {
        let frame = |sign: bool| RawFrame {
            resolution: Resolution::new(32, 24),
            channels: 1,
            counts: (0..768).map(|at| if (at % 2 == 0) == sign { signal + d } else { signal - d }).collect(),
            exposure: 1.0,
            id: 0,
            started: 0.0,
        };
        let mut second = frame(false);
        second.counts.iter_mut().for_each(|count| *count += 2 * drift);
        [frame(true), second]
    }

    /// Signals of `10 (2 d² − 4)` have variances on a line of slope 1/10 with a variance of 4 without light, apart from the factor 64/63.
    #[test]
    fn gain_and_read_noise_are_the_slope_of_the_line_and_what_it_has_without_light() {
        let linear = Linear { black: 100.0, curve: None };
        let pairs = [2, 3, 4, 5].map(|d: u16| pair(100 + 10 * (2 * d * d - 4), d, 0));
        let found = transfer(&pairs, &linear, 4095.0).expect("four brightnesses");
        assert!((found.gain.value / (10.0 * 63.0 / 64.0) - 1.0).abs() < 1e-9, "{:?}", found.gain);
        // Rounding to counts is not read noise.
        let read = (4.0 * 64.0 / 63.0 - 1.0 / 12.0_f64).sqrt();
        assert!((found.read_noise.value / read - 1.0).abs() < 1e-9, "{:?}", found.read_noise);
        // The light changes by two counts between the frames. This change is not noise, and moves the signal by one count.
        let drifted = [2, 3, 4, 5].map(|d: u16| pair(99 + 10 * (2 * d * d - 4), d, 1));
        let found = transfer(&drifted, &linear, 4095.0).expect("four brightnesses");
        assert!((found.gain.value / (10.0 * 63.0 / 64.0) - 1.0).abs() < 1e-9, "{:?}", found.gain);
        // The brightest pair has samples at or above the limit and is left out.
        let mut saturated = pairs.clone();
        saturated[3] = pair(100 + 460, 20, 0);
        let found = transfer(&saturated, &linear, 540.0).expect("three brightnesses");
        assert!((found.gain.value / (10.0 * 63.0 / 64.0) - 1.0).abs() < 1e-9, "{:?}", found.gain);
    }

    /// A variance `v` of `n` samples has the standard error `v √(2/(n − 1))`. Two brightnesses determine the line and thus its errors.
    #[test]
    fn the_errors_are_those_of_a_line_through_variances_of_so_many_samples() {
        let linear = Linear { black: 100.0, curve: None };
        let pairs = [3, 5].map(|d: u16| pair(100 + 10 * (2 * d * d - 4), d, 0));
        let found = transfer(&pairs, &linear, 4095.0).expect("two brightnesses");
        let [low, high] = [3.0, 5.0].map(|d: f64| (10.0 * (2.0 * d * d - 4.0), 2.0 * d * d * 64.0 / 63.0));
        // The squared standard error of each variance, averaged over twelve bins.
        let square = |(_, variance): (f64, f64)| variance * variance * 2.0 / 63.0 / 12.0;
        let apart = high.0 - low.0;
        let slope = (square(low) + square(high)).sqrt() / apart;
        let without_light = (high.0.powi(2) * square(low) + low.0.powi(2) * square(high)).sqrt() / apart;
        let (gain, read) = (found.gain.value, found.read_noise.value);
        assert!((found.gain.error / (slope * gain * gain) - 1.0).abs() < 1e-6, "{:?}", found.gain);
        assert!(
            (found.read_noise.error / (without_light / (2.0 * read)) - 1.0).abs() < 1e-6,
            "{:?}",
            found.read_noise
        );
    }

    /// Below 600, the curve rises by two linear DN per count. From 600 on, it rises by 0.1 linear DN per count.
    #[test]
    fn noise_is_converted_by_the_slope_of_the_response_and_not_used_where_it_is_flat() {
        let curve: Vec<f64> = (0..1024)
            .map(|count| match count {
                0..600 => 2.0 * f64::from(count),
                _ => 1200.0 + 0.1 * f64::from(count - 600),
            })
            .collect();
        let linear = Linear { black: 0.0, curve: Some(curve) };
        let steep = bins(&pair(200, 3, 0), &linear, 1023.0);
        assert_eq!(steep.len(), 12);
        let expected = Point { signal: 400.0, variance: 4.0 * 18.0 * 64.0 / 63.0, slope: 4.0, samples: 64.0 };
        for point in steep {
            assert!((point.variance - expected.variance).abs() < 1e-9);
            assert_eq!(Point { variance: expected.variance, ..point }, expected);
        }
        assert!(bins(&pair(800, 3, 0), &linear, 1023.0).is_empty());
    }
}
