//! Bracketed exposures merged into one photo, by inverse variance (section 7.2).
//!
//! Exposure `e` of `t_e` seconds gives the rate `R_e = (L_e − B_e) / t_e`, with `B_e` the black photo's. The merged rate is
//!
//! ```text
//! R = Σ w_e R_e,   w_e ∝ t_e² / var L_e,   Σ w_e = 1
//! ```
//!
//! The variance is that of the *expected* count `B_e + R t_e`, of the merged rate itself and not of the sample: a sample that
//! came out low would have the lower variance, so the greater weight, and the result would be low by about a DN. To
//! first order weights by the merged rate have no bias: with `w_e var R_e` the same for all exposures, the merged rate is
//! correlated alike with all, and the changes of the weights add up to 0.
//!
//! Saturated samples never enter. Nor do those that are likely to be: of a pixel that is *expected* to saturate, the samples
//! below saturation are the low ones. What the shorter exposures say decides.

use super::averaging::Exposed;
use super::response::CameraCurve;
use crate::error::{Error, Result};
use crate::image::Resolution;

/// How many standard deviations the expected count must stay below saturation.
const HEADROOM: f64 = 4.0;

/// Passes from weights to merged rate to weights; the second already moves weights by less than a thousandth.
const PASSES: usize = 2;

/// A frame seen by the camera: linear DN per second without the black photo's, interleaved.
#[derive(Clone, Debug)]
pub(super) struct Sighting {
    /// When it was taken.
    pub(super) started: f64,
    /// Rates.
    pub(super) values: Vec<f64>,
    /// Their variances, but for the black photo's share, which all sightings have in common.
    pub(super) variance: Vec<f64>,
    /// How much of each exposure's black rate was subtracted: one plane for each exposure; `None` where all is of one
    /// exposure, with a share of `scale`.
    pub(super) shares: Option<Vec<Vec<f64>>>,
    /// By what drift correction scaled all of it; shares are to be multiplied by it.
    pub(super) scale: f64,
}

impl Sighting {
    /// As if the lamp had been `factor` times as bright.
    pub(super) fn scale(&mut self, factor: f64) {
        self.values.iter_mut().for_each(|value| *value *= factor);
        self.variance.iter_mut().for_each(|variance| *variance *= factor * factor);
        self.scale *= factor;
    }
}

/// Merges exposures, the shortest first; `blacks`, if there are any, in the same order. Pixels that are not `used` may
/// saturate; they are 0, of infinite variance.
pub(super) fn merge(
    exposed: &[Exposed],
    blacks: &[Exposed],
    curve: &CameraCurve,
    used: &[bool],
    camera: Resolution,
) -> Result<Sighting> {
    let samples = exposed[0].mean.len();
    let channels = samples / used.len().max(1);
    let mut merged = Sighting {
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

/// The error that names saturated pixels.
pub(super) fn saturated(pixel: usize, count: usize, shortest: f64, camera: Resolution) -> Error {
    Error::Saturated {
        device: "camera".into(),
        fault: format!(
            "{count} pixel{} saturated in every exposure, the first at column {}, row {}; the shortest exposure is {shortest} s",
            if count == 1 { " is" } else { "s are" },
            pixel % camera.width,
            pixel / camera.width
        ),
        help: "add a shorter one to [measurement] exposures, close the lens, or darken the projector or the room".into(),
    }
}

/// Value and variance of one sample, and the weights of its exposures; `None` when no exposure can be used.
fn merge_sample(
    exposed: &[Exposed],
    blacks: &[Exposed],
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
        // CaptureRequest noise alone would weigh by time: where the passes below begin.
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
