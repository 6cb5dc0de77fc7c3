//! Combines repeated frames at several exposures into one photo: averaging, ambient light (O'Toole and Kutulakos, section 8.2), and merging
//! (section 7.2).

use std::ops::Range;
use std::sync::Arc;

use super::frame_source::{CaptureRequest, FrameSource};
use super::response::CameraCurve;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::rig::Frame;

/// The mean of several takes (repeated frames) at one exposure. Values are samples of the camera, interleaved as in
/// [`crate::rig::RawFrame`].
#[derive(Clone, Debug)]
pub(crate) struct AveragedExposure {
    /// The exposure of one take, in seconds.
    pub(crate) exposure: f64,
    /// The start of the first take, in seconds on the rig's clock.
    pub(crate) started: f64,
    pub(crate) takes: u32,
    /// The mean, in linear DN.
    pub(crate) mean: Vec<f64>,
    /// The variance that rounding to counts adds to one take, in linear DN².
    pub(crate) rounding: Vec<f64>,
    /// The variance of one take, from the differences between the takes, in linear DN². It is 0 for a single take.
    pub(crate) scatter: Vec<f64>,
    /// Whether each sample was saturated in at least one take. The mean of such a sample has no meaning.
    pub(crate) saturated: Vec<bool>,
}

/// Captures `frame` at `exposure` seconds once for each number in `takes`, and averages the takes.
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
            return Err(Error::dimension("counts of a camera's frame", samples, raw.counts.len()));
        }
        if take == takes.start {
            (sum.started, sum.exposure) = (raw.started, raw.exposure);
        }
        // During this loop, the scatter is the sum of squared differences from the mean of the takes so far (Welford 1962).
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
    /// The variance of the mean of a sample whose expected value is `expected`, in linear DN².
    pub(crate) fn variance(&self, curve: &CameraCurve, sample: usize, expected: f64) -> f64 {
        curve.variance(expected, self.rounding[sample]) / f64::from(self.takes)
    }
}

// The ambient stage: the black photo is subtracted from every photo (O'Toole and Kutulakos, section 8.2).
//
// The black photo shows the light of the room, the projector's black level and the camera's dark current. It is taken at each exposure,
// because all three grow with the exposure. The differences are not clipped: without light, half of them are negative.

#[derive(Clone, Debug, Default)]
pub(crate) struct BlackPhotos {
    /// The photos, the shortest exposure first. There are none when ambient light is not subtracted.
    pub(crate) exposed: Vec<AveragedExposure>,
    /// The variance of the rate, in (linear DN per second)², for each exposure and sample.
    pub(crate) variance: Vec<Vec<f64>>,
}

// The HDR stage: photos at several exposures are merged into one (O'Toole and Kutulakos, section 7.2), here weighted by inverse variance.
//
// Exposure `e` of `t_e` seconds gives the rate `R_e = (L_e − B_e) / t_e`, with the light `L_e` of the photo and `B_e` of the black photo.
// The merged rate is
//
// ```text
// R = Σ w_e R_e,   w_e ∝ t_e² / var L_e,   Σ w_e = 1
// ```
//
// The formula takes the variance of the *expected* count `B_e + R t_e`, which follows from the merged rate, instead of the variance of the
// measured sample. A sample that is low by chance would have a lower variance and so a greater weight, and the result would be low by about
// one DN. Weights from the merged rate have no bias to first order: `w_e var R_e` is the same for all exposures. The merged rate is thus
// equally correlated with all exposures, and the changes of the weights add up to 0.
//
// Saturated samples never enter the sum. Samples of a pixel that is *expected* to saturate do not enter either, because only samples that
// are low by chance lie below saturation. The shorter exposures give the expected value.

/// The expected count must lie this many standard deviations below saturation.
const HEADROOM: f64 = 4.0;

/// The number of iterations, each of which computes the weights from the merged rate and the merged rate from the weights. The second
/// iteration changes the weights by less than a thousandth.
const PASSES: usize = 2;

/// The merged photo of a frame on the camera's pixels: linear DN per second after the black photo is subtracted, as interleaved samples.
#[derive(Clone, Debug)]
pub(crate) struct RateFrame {
    /// The start of the first exposure, in seconds on the rig's clock.
    pub(crate) started: f64,
    pub(crate) values: Vec<f64>,
    /// The variances of the rates, without the variance of the black photo, which all photos share.
    pub(crate) variance: Vec<f64>,
    /// The weights `w_e` with which the black rates `B_e / t_e` were subtracted, one plane per exposure. They are `None` for a single
    /// exposure, whose weight is 1.
    pub(crate) shares: Option<Vec<Vec<f64>>>,
    /// The factor of the drift correction. `shares` must be multiplied by this factor.
    pub(crate) scale: f64,
}

impl RateFrame {
    /// Multiplies the photo by `factor`, as if the lamp had been brighter by this factor.
    pub(crate) fn scale(&mut self, factor: f64) {
        self.values.iter_mut().for_each(|value| *value *= factor);
        self.variance.iter_mut().for_each(|variance| *variance *= factor * factor);
        self.scale *= factor;
    }
}

/// Merges exposures, the shortest first. `blacks` are the black photos in the same order, or empty. Pixels that are not `used` may be
/// saturated. Their value is then 0 with infinite variance.
pub(crate) fn merge(
    exposed: &[AveragedExposure],
    blacks: &[AveragedExposure],
    curve: &CameraCurve,
    used: &[bool],
    camera: Resolution,
) -> Result<RateFrame> {
    let samples = exposed[0].mean.len();
    let channels = samples / used.len().max(1);
    let mut merged = RateFrame {
        started: exposed[0].started,
        values: vec![0.0; samples],
        variance: vec![f64::INFINITY; samples],
        shares: (exposed.len() > 1).then(|| vec![vec![0.0; samples]; exposed.len()]),
        scale: 1.0,
    };
    let mut weights = vec![0.0; exposed.len()];
    let mut lost = Vec::new();
    for sample in 0..samples {
        if !used[sample / channels] {
            continue;
        }
        let Some((value, variance)) = merge_sample(exposed, blacks, curve, sample, &mut weights) else {
            if lost.last() != Some(&(sample / channels)) {
                lost.push(sample / channels);
            }
            continue;
        };
        (merged.values[sample], merged.variance[sample]) = (value, variance);
        for (share, &weight) in merged.shares.iter_mut().flatten().zip(&weights) {
            share[sample] = weight;
        }
    }
    match lost.first() {
        Some(&pixel) => Err(saturated(pixel, lost.len(), exposed[0].exposure, camera)),
        None => Ok(merged),
    }
}

/// The error for pixels that are saturated in every exposure. `pixel` is the first of them, and `shortest` is the shortest exposure in
/// seconds.
pub(crate) fn saturated(pixel: usize, count: usize, shortest: f64, camera: Resolution) -> Error {
    let are = if count == 1 { " is" } else { "s are" };
    let (column, row) = (pixel % camera.width, pixel / camera.width);
    let fault = format!(
        "{count} pixel{are} saturated in every exposure, the first at column {column}, row {row}; the shortest exposure is {shortest} s"
    );
    let help =
        "add a shorter one to [measurement] exposures, close the lens, or darken the projector or the room";
    Error::saturated("camera", fault).help(help)
}

/// The value and the variance of one sample, or `None` when no exposure can be used. The weights of the exposures are written to `weights`.
fn merge_sample(
    exposed: &[AveragedExposure],
    blacks: &[AveragedExposure],
    curve: &CameraCurve,
    sample: usize,
    weights: &mut [f64],
) -> Option<(f64, f64)> {
    let black = |e: usize| blacks.get(e).map_or(0.0, |black| black.mean[sample]);
    let rate = |e: usize| (exposed[e].mean[sample] - black(e)) / exposed[e].exposure;
    let variance_of_rate = |e: usize, expected: f64| {
        let seconds = exposed[e].exposure;
        exposed[e].variance(curve, sample, black(e) + expected * seconds) / (seconds * seconds)
    };
    weights.fill(0.0);
    let (mut value, mut variance, mut precision) = (0.0, f64::INFINITY, 0.0);
    for e in 0..exposed.len() {
        if exposed[e].saturated[sample] || blacks.get(e).is_some_and(|black| black.saturated[sample]) {
            continue;
        }
        if precision > 0.0 {
            let seconds = exposed[e].exposure;
            let own = variance_of_rate(e, value) * f64::from(exposed[e].takes);
            let likely = black(e) + seconds * (value + HEADROOM * (variance + own).sqrt());
            if likely >= curve.brightest() {
                continue;
            }
        }
        // The iteration starts from shot noise alone, for which the weights are proportional to time.
        weights[e] = exposed[e].exposure;
        precision += weights[e];
        value += (rate(e) - value) * weights[e] / precision;
        variance = (0..=e)
            .filter(|&e| weights[e] > 0.0)
            .map(|e| (weights[e] / precision).powi(2) * variance_of_rate(e, value))
            .sum();
    }
    if precision == 0.0 {
        return None;
    }
    for _ in 0..PASSES {
        let (mut sum, mut total) = (0.0, 0.0);
        for (e, weight) in weights.iter_mut().enumerate().filter(|(_, weight)| **weight > 0.0) {
            *weight = 1.0 / variance_of_rate(e, value).max(f64::MIN_POSITIVE);
            sum += *weight * rate(e);
            total += *weight;
        }
        value = sum / total;
        weights.iter_mut().for_each(|weight| *weight /= total);
    }
    let variance = (0..exposed.len())
        .filter(|&e| weights[e] > 0.0)
        .map(|e| weights[e].powi(2) * variance_of_rate(e, value))
        .sum();
    Some((value, variance))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::CameraResponse;

    fn curve() -> CameraCurve {
        let response =
            CameraResponse { black: 0.0, saturation: 4095.0, gain: 1.0, read_noise: 2.0, curve: None };
        CameraCurve::new(&response, 12, true).expect("a linear response fits any camera")
    }

    fn exposed(exposure: f64, mean: f64) -> AveragedExposure {
        AveragedExposure {
            exposure,
            started: 0.0,
            takes: 1,
            mean: vec![mean],
            rounding: vec![0.0],
            scatter: vec![0.0],
            saturated: vec![false],
        }
    }

    fn merged(exposed: &[AveragedExposure]) -> (f64, Vec<f64>) {
        let merged = merge(exposed, &[], &curve(), &[true], Resolution::new(1, 1));
        let merged = merged.expect("nothing is saturated");
        (merged.values[0], merged.shares.iter().flatten().map(|share| share[0]).collect())
    }

    /// With weights from measured variances, the lower of two samples would count more, and every photo would be too dark.
    #[test]
    fn exposures_of_the_same_time_count_alike_whichever_is_brighter_by_chance() {
        for samples in [[10.0, 30.0], [30.0, 10.0], [0.0, 5.0]] {
            let (rate, shares) = merged(&samples.map(|sample| exposed(1.0, sample)));
            assert_eq!((rate, shares), ((samples[0] + samples[1]) / 2.0, vec![0.5, 0.5]), "{samples:?}");
        }
    }

    #[test]
    fn exposures_are_weighted_by_the_variance_that_the_merged_rate_predicts() {
        for samples in [[20.0, 60.0], [2.0, 60.0]] {
            let seconds = [1.0, 4.0];
            let (rate, shares) = merged(&[0, 1].map(|e| exposed(seconds[e], samples[e])));
            // The inverse variances of the rates, from shot noise and read noise of the expected counts.
            let weights = seconds.map(|t| t * t / (rate * t + 4.0));
            let share = weights[0] / (weights[0] + weights[1]);
            // Two iterations are accurate to a thousandth.
            assert!((shares[0] - share).abs() < 1e-3, "{samples:?}: {shares:?}, not {share}");
            let own = [0, 1].map(|e| seconds[e] * seconds[e] / (samples[e] + 4.0));
            assert!((own[0] / (own[0] + own[1]) - share).abs() > 0.01, "the test could not tell");
        }
    }
}
