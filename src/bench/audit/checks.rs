//! The checks of an audit.

use crate::analysis::Crosstalk;
use crate::finding::{Finding, Grade, Ratio};
use crate::measure::Plane;

/// A pixel is in shadow if less than this fraction of its light under white is direct.
const SHADOW: f64 = 0.05;

/// Pixels with less than this fraction of the brightest pixel's light are too dark to be judged.
const DARK: f64 = 0.02;

fn of_length(numerator: f64, seen: &Plane) -> Ratio {
    Ratio::to_length(
        numerator,
        seen.values.iter().zip(&seen.variance).map(|(&value, &variance)| [value, variance]),
    )
}

/// The relative deviation without the expected noise, `√(Σ r² − Σ var) / ‖reference‖`, and its standard error. `r` are the residuals.
fn deviation(residual: &[f64], variance: &[f64], reference: &Plane) -> (Ratio, f64) {
    let squares: f64 = residual.iter().map(|value| value * value).sum();
    let noise: f64 = variance.iter().sum();
    // The sum of squares of noisy values has a standard error of √(2 Σ var²). The square root of the sum has half of this error, divided by
    // the root.
    let spread = (2.0 * variance.iter().map(|variance| variance * variance).sum::<f64>()).sqrt();
    let excess = (squares - noise).max(0.0);
    let error = spread / (2.0 * excess.max(spread).max(f64::MIN_POSITIVE).sqrt());
    let [figure, error] = [excess.sqrt(), error].map(|length| of_length(length, reference));
    (figure, if spread > 0.0 { error.value().unwrap_or(0.0) } else { 0.0 })
}

/// The root mean square of the residuals, each divided by its predicted standard error. `None` without noise.
fn z(residual: &[f64], variance: &[f64]) -> Option<f64> {
    let pairs = residual.iter().zip(variance).filter(|(_, variance)| **variance > 0.0);
    let (sum, count) =
        pairs.fold((0.0, 0), |(sum, count), (r, variance)| (sum + r * r / variance, count + 1));
    (count > 0).then(|| (sum / f64::from(count)).sqrt())
}

pub(crate) fn additivity(lit: &Plane, rest: &Plane, white: &Plane, bound: f64) -> Finding {
    let pixels = 0..white.values.len();
    let residual: Vec<f64> =
        pixels.clone().map(|i| lit.values[i] + rest.values[i] - white.values[i]).collect();
    let variance: Vec<f64> = pixels.map(|i| lit.variance[i] + rest.variance[i] + white.variance[i]).collect();
    let (figure, error) = deviation(&residual, &variance, white);
    let z = z(&residual, &variance).map_or(String::new(), |z| format!(" (z {z:.2})"));
    let texts: [&str; 2] = [
        &format!("two halves of white add up to it{z}"),
        &format!(
            "two halves of white do not add up to it{z}: look for saturation, a black level or ambient light that is not \
             subtracted, or a camera response that is not undone (`krylux rig calibrate`)"
        ),
    ];
    Finding::judged("additivity", figure, error, bound, texts)
}

/// Compares `photo` with photos of the same pattern multiplied by factors. `scaled` pairs each factor with its photo. Returns the largest
/// relative deviation, its standard error and the factor.
fn largest_deviation(photo: &Plane, scaled: &[(f64, Plane)]) -> (Ratio, f64, f64) {
    let norm: f64 = photo.values.iter().map(|value| value * value).sum();
    let mut worst = (Ratio::from(0.0), 0.0, 0.0);
    for (share, dimmed) in scaled {
        let (mut dot, mut variance) = (0.0, 0.0);
        for pixel in 0..photo.values.len() {
            dot += photo.values[pixel] * dimmed.values[pixel];
            variance += photo.values[pixel].powi(2)
                * (dimmed.variance[pixel] / (share * share) + photo.variance[pixel]);
        }
        let off = Ratio::of((dot / share - norm).abs(), norm, variance.sqrt());
        // If the deviation is undefined for one factor, no other factor can give more information.
        if off.value() >= worst.0.value() || off.value().is_none() {
            worst = (off, variance.sqrt() / norm, *share);
        }
    }
    worst
}

pub(crate) fn homogeneity(photo: &Plane, scaled: &[(f64, Plane)], bound: f64) -> Finding {
    let (figure, error, share) = largest_deviation(photo, scaled);
    let texts: [&str; 2] = [
        "a share of a pattern gives that share of its photo",
        &format!(
            "{share} of a pattern does not give {share} of its photo: the projector's response (gamma) is not undone; \
             calibrate the rig with `krylux rig calibrate` and name the calibration"
        ),
    ];
    Finding::judged("homogeneity", figure, error, bound, texts)
}

pub(crate) fn repeatability(first: &Plane, last: Plane, bound: f64) -> Finding {
    let (figure, error, _) = largest_deviation(first, &[(1.0, last)]);
    let texts: [&str; 2] = [
        "the first photo, taken again at the end, is the same",
        "the first photo, taken again at the end, is brighter or darker: the light drifts; let the lamp warm up, or have the \
         drift sentinel correct it (sentinel_every in [measurement])",
    ];
    Finding::judged("repeatability", figure, error, bound, texts)
}

/// Estimates `‖A − Aᵀ‖/‖A‖` from photos of `(1 + x)/2` for random signs `x`. For two patterns `x` and `y`, the expected values are `E (yᵀ A
/// x − xᵀ A y)² = ‖A − Aᵀ‖²` and `E (yᵀ A x)² = ‖A‖²`.
pub(crate) fn symmetry(
    patterns: &[Vec<f64>],
    photos: &[Plane],
    white: &Plane,
    mask: &[bool],
    bound: f64,
) -> Finding {
    let sign = |pattern: &[f64], pixel: usize| if mask[pixel] { 2.0 * pattern[pixel] - 1.0 } else { 0.0 };
    let product = |with: &[f64], photo: &Plane| -> f64 {
        (0..mask.len())
            .map(|pixel| sign(with, pixel) * (2.0 * photo.values[pixel] - white.values[pixel]))
            .sum()
    };
    let (mut squares, mut noise, mut energy, mut pairs) = (0.0, 0.0, 0.0, 0.0);
    for i in 0..photos.len() {
        for j in i + 1..photos.len() {
            let [there, back] = [product(&patterns[j], &photos[i]), product(&patterns[i], &photos[j])];
            squares += (there - back).powi(2);
            energy += 0.5 * (there * there + back * back);
            noise += (0..mask.len())
                .map(|pixel| {
                    let [x, y] = [sign(&patterns[i], pixel), sign(&patterns[j], pixel)];
                    4.0 * (y * y * photos[i].variance[pixel] + x * x * photos[j].variance[pixel])
                        + (x - y).powi(2) * white.variance[pixel]
                })
                .sum::<f64>();
            pairs += 1.0;
        }
    }
    let figure = Ratio::of((squares - noise).max(0.0).sqrt(), energy.sqrt(), 0.0);
    // The mean square of `pairs` Gaussian values has a relative error of √(2/pairs). The square root has half of this relative error.
    let error = (squares / energy).sqrt() * (0.5_f64 / pairs).sqrt();
    let texts: [&str; 2] = [
        &format!("light takes every way in both directions alike ({pairs} pairs of patterns)"),
        "light does not take every way in both directions alike: the pixel map is off (calibrate the rig with \
         `krylux rig calibrate`), or camera and projector do not look from one point, or one's lens darkens its corners",
    ];
    Finding::judged("symmetry", figure, error, bound, texts)
}

/// Finds pixels that see light, but hardly any light straight from their own projector pixel.
pub(crate) fn shadows(direct: &Plane, white: &Plane, mask: &[bool], bound: f64) -> (Finding, Vec<bool>) {
    let brightest = white.values.iter().copied().fold(0.0, f64::max);
    let lit = |pixel: usize| {
        mask[pixel] && white.values[pixel] > (DARK * brightest).max(5.0 * white.variance[pixel].sqrt())
    };
    let shadow: Vec<bool> = (0..mask.len())
        .map(|pixel| {
            let certain = 3.0 * direct.variance[pixel].sqrt();
            lit(pixel) && direct.values[pixel] + certain < SHADOW * white.values[pixel]
        })
        .collect();
    let lit = (0..mask.len()).filter(|&pixel| lit(pixel)).count() as f64;
    let share = Ratio::of(shadow.iter().filter(|&&shadow| shadow).count() as f64, lit, 0.0);
    let texts: [&str; 2] = [
        "what the camera sees, the projector lights: no shadows",
        "the camera sees what the projector does not light: they do not look from one point; move the beam splitter until the \
         shadows in shadow.png are gone",
    ];
    let check = Finding::judged("direct light", share, 0.0, bound, texts);
    (check, shadow)
}

pub(crate) fn ambient(ambient: &Plane, white: &Plane) -> Finding {
    let sum = |seen: &Plane| seen.values.iter().sum::<f64>();
    let total = sum(white);
    let error = |seen: &Plane| seen.variance.iter().sum::<f64>().sqrt();
    let meaning = "of white's light is there without a pattern: ambient light and the projector's black";
    let share = Ratio::of(sum(ambient), total, error(white));
    Finding::told("black", share, error(ambient) / total, meaning)
}

pub(crate) fn noise_floor(white: &Plane) -> Finding {
    let noise: f64 = white.variance.iter().sum();
    let meaning = "noise of the white photo: no answer is better than that without more photos";
    Finding::told("noise floor", of_length(noise.sqrt(), white), 0.0, meaning)
}

pub(crate) fn drift(largest: f64) -> Finding {
    let meaning =
        "the most that the lamp's light has changed since the first white; photos are corrected for it";
    Finding::told("drift", largest.into(), 0.0, meaning)
}

/// The largest crosstalk: the signal of another projector colour in a camera channel, relative to the signal of the channel's own colour.
pub(crate) fn crosstalk(crosstalk: &Crosstalk) -> Finding {
    let others = crosstalk.matrix().iter().enumerate().flat_map(|(channel, row)| {
        row.iter().enumerate().filter(move |(color, _)| *color != channel).map(|(_, entry)| *entry)
    });
    let most = others.fold(0.0, f64::max);
    let meaning = "of the light of its colour is the most that a camera channel sees of another of the projector's colours; \
                   compensate takes that into account by --crosstalk measure";
    Finding::told("crosstalk", most.into(), 0.0, meaning)
}

pub(crate) fn saturation(share: f64) -> Finding {
    let meaning =
        "of the camera's samples of white are saturated in some exposure: the shorter ones count there";
    Finding::told("saturation", share.into(), 0.0, meaning)
}

pub(crate) fn saturated(fault: &str) -> Finding {
    let found = format!("the white photo is saturated, and nothing else can be told ({fault})");
    let help = "give shorter exposures, close the aperture, or dim the projector";
    Finding::graded("saturation", Grade::Fails, found, "", help).measured(1.0, 0.0, 0.0)
}
