//! The calibration of the camera, from frames of white and black at many exposures.

use std::sync::Arc;

use super::least_squares::Normal;
use super::linear::Linear;
use super::measured_value::MeasuredValue;
use super::report::CameraFigures;
use super::response::response;
use super::saturation::{limit, plateau};
use super::session::CalibrationSession;
use super::transfer::transfer;
use crate::error::{Error, Result};
use crate::image::percentile;
use crate::rig::{Frame, RawFrame};

/// The number of exposures in the series. They descend from that of white by factors of √2.
const SERIES: i32 = 15;

/// Pairs of frames of black at the shortest exposure.
const DARK_PAIRS: usize = 4;

/// The limit of saturation lies this many standard deviations of noise below the plateau.
const MARGIN: f64 = 4.0;

/// A calibrated camera.
#[derive(Clone, Debug)]
pub(crate) struct Camera {
    pub(crate) linear: Linear,
    /// Counts from here on may be saturated.
    pub(crate) limit: f64,
    pub(crate) figures: CameraFigures,
    /// The relative noise of one white photo at an average pixel.
    pub(crate) white_noise: f64,
}

/// Calibrates the camera. At `exposure` seconds, `white` fills the range.
///
/// # Errors
/// [`Error::Rig`] when frames cannot be taken; [`Error::Numerical`] when they do not determine the camera's
/// values.
pub(crate) fn camera(
    session: &mut CalibrationSession<'_>,
    white: &Arc<Frame>,
    exposure: f64,
) -> Result<Camera> {
    let full = session.full();
    let shortest = session.camera().exposures[0];
    let black = session.filled(0);
    let dark: Vec<[RawFrame; 2]> = (0..DARK_PAIRS)
        .map(|_| Ok([session.capture(&black, shortest)?, session.capture(&black, shortest)?]))
        .collect::<Result<_>>()?;
    let floor = percentile(dark[0][0].counts.iter().map(|&count| count.into()), 0.5);
    let plateau = plateau(session, white, exposure, floor)?;
    let (up, down) = series(session, white, exposure)?;
    let darks = dark_series(session, &black, exposure)?;
    let sorting = session.capture(white, exposure)?;
    // Until the noise is known, that of a camera with one electron per DN is assumed, which is more than real
    // cameras have.
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
    Ok(Camera {
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
        linear,
        limit,
        white_noise,
    })
}

/// Captures white at exposures from the shortest of the series up, and down again, so that a drift of the
/// light cancels.
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
        return Err(Error::Rig {
            device: "camera".into(),
            fault: "its exposures leave no room for a series: white fills the range near the shortest".into(),
            help: "close the aperture, lower the gain, or dim the projector".into(),
        });
    }
    Ok((up, down))
}

/// Captures black at white's exposure, and at shorter ones.
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

/// Fits a line to the mean counts of black frames over the exposure: black level in DN, and DN per second.
fn dark_line(
    dark: &[[RawFrame; 2]],
    darks: &[RawFrame],
    gain: f64,
    read_noise: f64,
) -> Result<[MeasuredValue; 2]> {
    let mut normal = Normal::new(2);
    for frame in dark.iter().flatten().chain(darks) {
        let samples = frame.counts.len() as f64;
        let mean = frame.counts.iter().map(|&count| f64::from(count)).sum::<f64>() / samples;
        // The shot noise is bounded from above by counting the black level as light, too.
        let variance = (read_noise.powi(2) + mean / gain) / samples;
        normal.add_full(&[1.0, frame.exposure], mean, 1.0 / variance.max(1e-9));
    }
    let line = normal.solve()?;
    Ok([0, 1].map(|at| MeasuredValue::new(line.values[at], line.error(at))))
}

/// The mean light of black frames with a curved response, in linear DN per second.
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

/// The noise of a white photo at an average pixel, relative to its light.
fn white_noise(white: &RawFrame, linear: &Linear, gain: f64, read_noise: f64) -> f64 {
    let light = white.counts.iter().map(|&count| linear.of(count.into()).max(0.0)).sum::<f64>()
        / white.counts.len() as f64;
    (light / gain + read_noise.powi(2)).sqrt() / light.max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_noise_of_white_is_that_of_electrons_and_of_reading_relative_to_its_light() {
        let white = RawFrame {
            resolution: crate::image::Resolution::new(2, 2),
            channels: 1,
            // One pixel is below black, which counts as no light.
            counts: vec![410, 810, 1210, 5],
            exposure: 0.1,
            id: 1,
            started: 0.0,
        };
        let linear = Linear { black: 10.0, curve: None };
        // 600 DN on average; 4 electrons each: a variance of 150 DN², and 11² by reading.
        let found = white_noise(&white, &linear, 4.0, 11.0);
        assert!((found - 271.0_f64.sqrt() / 600.0).abs() < 1e-12, "{found}");
    }
}
