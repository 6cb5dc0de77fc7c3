//! The projector's response: the light of each level, from photos of uniform frames. O'Toole and Kutulakos, section 8.1, calibrate
//! their projector to be linear, and do not say how.
//!
//! A uniform frame scales all light of the scene, global light included. The light of a level relative to the brightest level is therefore
//! the same number for all pixels: `r(l) = Σ (rate_l − rate_0) / Σ (rate_top − rate_0)`. Here `rate_l` is the light of a pixel per second
//! under level `l`. Saturated pixels are left out. Dark levels are exposed longer. A photo of black at the same exposure is subtracted, so
//! that an error of the black level cancels. White is photographed every few levels, and the drift of the light is divided out.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use super::least_squares::{Normal, ascending};
use super::report::{MeasuredValue, ProjectorFigures};
use super::session::{CalibrationSession, CameraModel, Mean};
use crate::error::{Error, Result};

/// The number of levels between two photos of white.
const WHITE_EVERY: usize = 16;

/// The largest number of levels that are shown: first for any camera, then for a camera whose frames take longer than [`SLOW`] seconds
/// each. A still camera needs minutes for a dozen levels. Levels between the shown levels are interpolated.
const LEVELS: [usize; 2] = [257, 33];

/// A rig is slow when the time from one frame to the next is longer than this, in seconds.
const SLOW: f64 = 0.5;

/// The largest exposure of dark levels, as a multiple of white's exposure.
const LONGER: f64 = 16.0;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Ramp {
    /// The light of each level relative to the brightest level. The light of level 0 is subtracted from both.
    pub(crate) curve: Vec<f64>,
    /// The exponent, the errors and the black level.
    pub(crate) figures: ProjectorFigures,
    /// The light of white over time, as (seconds, light relative to the first photos).
    pub(crate) whites: Vec<(f64, f64)>,
    /// The relative standard error of each entry of `whites`.
    pub(crate) white_error: f64,
}

/// Measures the response of one channel of the projector. Fails with [`Error::Rig`] when white is no brighter than black.
pub(crate) fn ramp(
    session: &mut CalibrationSession<'_>,
    model: &CameraModel,
    channel: usize,
    most_levels: usize,
) -> Result<Ramp> {
    let top = session.top();
    let levels = levels(top, most_levels);
    let white_frame = session.filled_channel(channel, top)?;
    let black_frame = session.filled_channel(channel, 0)?;
    let base = session.mean(&black_frame, model.exposure, 4 * model.takes)?;
    let mut blacks = BTreeMap::from([(model.exposure.to_bits(), base.clone())]);
    let white = session.mean(&white_frame, model.exposure, 4 * model.takes)?;
    let mut references = Vec::new();
    let mut points: Vec<(u16, f64, f64, f64)> = Vec::new();
    // The light without a pattern is in every photo and also grows with the exposure.
    let black = black_share(model, &white, &base);
    let mut share = 1.0;
    for (index, &level) in levels.iter().rev().enumerate() {
        if index % WHITE_EVERY == 0 {
            references.push(session.mean(&white_frame, model.exposure, model.takes)?);
        }
        if level == 0 {
            continue;
        }
        let exposure = longer(session, model.exposure, share + black.value);
        if let Entry::Vacant(entry) = blacks.entry(exposure.to_bits()) {
            entry.insert(session.mean(&black_frame, exposure, 4 * model.takes)?);
        }
        let lit = session.mean(&session.filled_channel(channel, level)?, exposure, model.takes)?;
        let dark = blacks.get(&exposure.to_bits()).unwrap_or(&base);
        let (light, error) = relative(model, &lit, dark, &white, &base)?;
        points.push((level, light, error, lit.time));
        share = light.max(1e-6);
    }
    references.push(session.mean(&white_frame, model.exposure, model.takes)?);
    let mut whites = Vec::new();
    let mut white_error = 0.0;
    for reference in &references {
        let (light, error) = relative(model, reference, &base, &white, &base)?;
        whites.push((reference.time, light));
        white_error = error;
    }
    finish(top, &points, whites, white_error, black)
}

/// Computes the exposure for the next level: white's exposure times a power of two. `share` is the light of this level plus the light
/// without a pattern, relative to white's light. The next level cannot saturate, because it is not brighter than this level.
fn longer(session: &CalibrationSession<'_>, exposure: f64, share: f64) -> f64 {
    let factor = (0.8 / share).clamp(1.0, LONGER).log2().floor().exp2();
    let wanted = session.allowed(exposure * factor);
    if wanted < 1.5 * exposure { exposure } else { wanted }
}

/// The number of levels for a rig whose frames are `seconds` apart.
pub(crate) fn levels_for(seconds: f64) -> usize {
    LEVELS[usize::from(seconds > SLOW)]
}

/// Lists all levels, or `most` of them at equal steps. The lowest and the highest level are included.
fn levels(top: u16, most: usize) -> Vec<u16> {
    let count = (usize::from(top) + 1).min(most).max(2);
    (0..count).map(|index| (index * usize::from(top) / (count - 1)) as u16).collect()
}

/// The light `lit − dark` relative to `white − base`, with its standard error. Both photos of each difference have the same exposure.
fn relative(model: &CameraModel, lit: &Mean, dark: &Mean, white: &Mean, base: &Mean) -> Result<(f64, f64)> {
    let (mut sum, mut norm, mut variance) = (0.0, 0.0, 0.0);
    for sample in 0..lit.counts.len() {
        let saturated =
            [lit, dark, white, base].iter().any(|mean| f64::from(mean.peaks[sample]) >= model.limit);
        if saturated {
            continue;
        }
        let [lit_light, dark_light, white_light, base_light] =
            [lit, dark, white, base].map(|mean| model.linear.of(mean.counts[sample]));
        sum += lit_light - dark_light;
        norm += white_light - base_light;
        variance += model.variance(lit_light, lit.takes) + model.variance(dark_light, dark.takes);
    }
    let [rate, norm] = [sum / lit.exposure, norm / white.exposure];
    if norm <= 0.0 {
        let fault = "its white is no brighter than its black in the camera's photos";
        return Err(Error::rig("projector", fault)
            .help("check that the projector shows the frames, and that the camera sees its light"));
    }
    Ok((rate / norm, variance.sqrt() / lit.exposure / norm))
}

fn black_share(model: &CameraModel, white: &Mean, base: &Mean) -> MeasuredValue {
    let sum = |mean: &Mean| mean.counts.iter().map(|&count| model.linear.of(count)).sum::<f64>();
    let [white_sum, base_sum] = [white, base].map(sum);
    let samples = base.counts.len() as f64;
    let variance = (base_sum / model.gain + samples * model.read_noise.powi(2)) / f64::from(base.takes);
    MeasuredValue::new(base_sum / (white_sum - base_sum), variance.sqrt() / (white_sum - base_sum))
}

/// Divides out the drift, fits the exponent, makes the curve monotone, and interpolates the levels that were not shown.
fn finish(
    top: u16,
    points: &[(u16, f64, f64, f64)],
    whites: Vec<(f64, f64)>,
    white_error: f64,
    black: MeasuredValue,
) -> Result<Ramp> {
    let top = f64::from(top);
    let mut corrected: Vec<(f64, f64, f64)> = points
        .iter()
        .map(|&(level, light, error, time)| (f64::from(level) / top, light / at(&whites, time), error))
        .collect();
    corrected.reverse();
    let scale = corrected.last().map_or(1.0, |point| point.1);
    corrected.iter_mut().for_each(|point| point.1 /= scale);
    let gamma = gamma(&corrected)?;
    let residuals = corrected.iter().map(|&(x, r, _)| (r - x.powf(gamma.value)).powi(2));
    let gamma_residual = (residuals.sum::<f64>() / corrected.len() as f64).sqrt();
    let weights: Vec<f64> = corrected.iter().map(|point| point.2.powi(-2)).collect();
    let lights: Vec<f64> = corrected.iter().map(|point| point.1).collect();
    let lights = ascending(&lights, &weights).into_iter().map(|light| light.clamp(0.0, 1.0));
    let mut knots = vec![(0.0, 0.0)];
    knots.extend(corrected.iter().map(|point| point.0).zip(lights));
    if let Some(last) = knots.last_mut() {
        last.1 = 1.0;
    }
    let curve = interpolated(&knots, top, gamma.value);
    let error = corrected.iter().map(|point| point.2).fold(0.0, f64::max);
    let figures = ProjectorFigures { gamma, gamma_residual, curve_error: error, black };
    Ok(Ramp { curve, figures, whites, white_error })
}

/// Interpolates the light of each level from `knots`, linearly in `light^(1/γ)` (γ is the exponent), which is nearly linear in the level.
fn interpolated(knots: &[(f64, f64)], top: f64, gamma: f64) -> Vec<f64> {
    let levels = (0..=top as usize).map(|level| level as f64 / top);
    if knots.len() as f64 > top {
        return levels.map(|level| at(knots, level)).collect();
    }
    let roots: Vec<(f64, f64)> = knots.iter().map(|&(x, light)| (x, light.powf(1.0 / gamma))).collect();
    levels.map(|level| at(&roots, level).powf(gamma)).collect()
}

/// Finds the exponent by Gauss–Newton iteration. If the residuals are larger than the noise, the standard error is scaled up.
fn gamma(points: &[(f64, f64, f64)]) -> Result<MeasuredValue> {
    let mut gamma = 2.0;
    for _ in 0..50 {
        let (mut slope_squares, mut products) = (0.0, 0.0);
        for &(x, r, error) in points {
            let slope = x.powf(gamma) * x.ln() / error;
            slope_squares += slope * slope;
            products += slope * (r - x.powf(gamma)) / error;
        }
        if slope_squares == 0.0 {
            // With two levels, every exponent fits.
            return Ok(MeasuredValue::new(1.0, 0.0));
        }
        let step = products / slope_squares;
        gamma = (gamma + step.clamp(-0.5, 0.5)).clamp(0.05, 20.0);
        if step.abs() < 1e-9 {
            let chi: f64 = points.iter().map(|&(x, r, error)| ((r - x.powf(gamma)) / error).powi(2)).sum();
            let scale = (chi / (points.len() as f64 - 1.0).max(1.0)).max(1.0);
            return Ok(MeasuredValue::new(gamma, (scale / slope_squares).sqrt()));
        }
    }
    Err(Error::Numerical("no exponent fits the projector's levels".into()))
}

/// Interpolates linearly between ascending points. The result is constant beyond the first and the last point. At a point, the result is
/// exactly the point's value, so rounding cannot make a curve descend between equal points.
fn at(points: &[(f64, f64)], x: f64) -> f64 {
    let after = points.partition_point(|point| point.0 < x);
    match (after.checked_sub(1).map(|before| points[before]), points.get(after)) {
        (Some(before), Some(&after)) if after.0 > x => {
            before.1 + (x - before.0) / (after.0 - before.0) * (after.1 - before.1)
        }
        (_, Some(&point)) | (Some(point), None) => point.1,
        (None, None) => 1.0,
    }
}

/// Computes the relative change per hour of `whites` (seconds, light). `error` is the relative standard error of each entry. If the
/// residuals of the fitted line are larger than `error`, the standard error of the result is scaled up. Fails with [`Error::Numerical`]
/// when all photos were taken at the same time.
pub(crate) fn drift_per_hour(whites: &[(f64, f64)], error: f64) -> Result<MeasuredValue> {
    let start = whites.first().map_or(0.0, |white| white.0);
    let hours = |time: f64| (time - start) / 3600.0;
    let mut normal = Normal::new(2);
    let error = error.max(1e-9);
    for &(time, light) in whites {
        normal.add_full(&[1.0, hours(time)], light, error.powi(-2));
    }
    let line = normal.solve()?;
    let [mean, slope] = [line.values[0], line.values[1]];
    let residual = |&(time, light): &(f64, f64)| (light - mean - slope * hours(time)) / error;
    let chi: f64 = whites.iter().map(|white| residual(white).powi(2)).sum();
    let scale = (chi / (whites.len() as f64 - 2.0).max(1.0)).max(1.0).sqrt();
    Ok(MeasuredValue::new(slope / mean, line.error(1) * scale / mean))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::session::Linear;

    const LINEAR: Linear = Linear { black: 10.0, curve: None };
    const MODEL: CameraModel =
        CameraModel { linear: LINEAR, gain: 4.0, read_noise: 0.5, limit: 1000.0, exposure: 0.1, takes: 1 };

    fn mean(counts: [f64; 3], exposure: f64, takes: u32) -> Mean {
        let peaks = counts.map(|count| count as u16).to_vec();
        Mean { counts: counts.to_vec(), peaks, exposure, time: 0.0, takes }
    }

    #[test]
    fn light_is_compared_per_second_where_nothing_is_saturated() {
        let (white, base) = (mean([810.0, 1000.0, 410.0], 0.1, 8), mean([30.0, 30.0, 10.0], 0.1, 8));
        let (lit, dark) = (mean([410.0, 900.0, 210.0], 0.4, 2), mean([90.0, 90.0, 10.0], 0.4, 8));
        // The second sample is saturated. The other samples together give 520 in 0.4 s against 1180 in 0.1 s.
        let (light, error) = relative(&MODEL, &lit, &dark, &white, &base).expect("white is brighter");
        assert!((light - 520.0 / 0.4 / 11_800.0).abs() < 1e-15, "{light}");
        let noise = (400.0 / 4.0 + 0.25 + 200.0 / 4.0 + 0.25) / 2.0 + (80.0 / 4.0 + 0.25 + 0.25) / 8.0;
        assert!((error - f64::sqrt(noise) / 0.4 / 11_800.0).abs() < 1e-15, "{error}");
        assert!(relative(&MODEL, &lit, &dark, &base, &base).is_err(), "white as dark as black");
    }

    #[test]
    fn the_share_of_black_has_the_noise_of_its_light() {
        let (white, base) = (mean([810.0, 610.0, 410.0], 0.1, 8), mean([30.0, 20.0, 10.0], 0.1, 4));
        let share = black_share(&MODEL, &white, &base);
        assert_eq!(share.value, 30.0 / 1770.0);
        let noise = (30.0 / 4.0 + 3.0 * 0.25) / 4.0;
        assert!((share.error - f64::sqrt(noise) / 1770.0).abs() < 1e-15, "{share}");
    }

    #[test]
    fn the_exponent_that_fits_is_found_with_its_error() {
        let points = |power: f64, off: f64| -> Vec<(f64, f64, f64)> {
            let of = |index: i32| {
                let x = f64::from(index) / 8.0;
                (x, x.powf(power) + if index % 2 == 0 { off } else { -off }, 1e-3)
            };
            (1..=8).map(of).collect()
        };
        for power in [0.5, 1.0, 2.2, 6.0] {
            let found = gamma(&points(power, 0.0)).expect("it fits");
            let squares: f64 = points(power, 0.0).iter().map(|(x, r, e)| (r * x.ln() / e).powi(2)).sum();
            assert!((found.value - power).abs() < 1e-9, "{power}: {found}");
            assert!((found.error * squares.sqrt() - 1.0).abs() < 1e-6, "{power}: {found}");
        }
        // Residuals of ten standard errors make the error about ten times as large. Eight points leave seven degrees of freedom.
        let [exact, off] = [0.0, 1e-2].map(|off| gamma(&points(2.2, off)).expect("it fits").error);
        assert!((off / exact / (800.0_f64 / 7.0).sqrt() - 1.0).abs() < 0.1, "{off} {exact}");
        assert_eq!(gamma(&[(1.0, 1.0, 1e-3)]).expect("every exponent fits"), MeasuredValue::new(1.0, 0.0));
    }

    #[test]
    fn between_points_values_are_on_the_line_and_beyond_them_constant() {
        let points = [(1.0, 2.0), (3.0, 6.0), (3.0, 8.0), (4.0, 0.0)];
        let found = [0.0, 1.0, 1.5, 3.0, 3.25, 4.0, 9.0].map(|x| at(&points, x));
        assert_eq!(found, [2.0, 2.0, 3.0, 6.0, 6.0, 0.0, 0.0]);
        assert_eq!(at(&[], 1.0), 1.0);
        // In floating point, 0.2 + (0.9 − 0.2) differs from 0.9. Two points have the value 0.9.
        assert_ne!(0.2 + (0.9 - 0.2), 0.9);
        let equal = [(0.0, 0.2), (1.0, 0.9), (2.0, 0.9)];
        assert_eq!([1.0, 1.5, 2.0].map(|x| at(&equal, x)), [0.9; 3]);
    }

    /// Four levels are shown while the lamp fades by a tenth, the brightest level first.
    #[test]
    fn the_drift_of_white_is_divided_out_and_the_brightest_level_is_one() {
        let whites = vec![(0.0, 1.0), (4.0, 0.9)];
        let light = |level: u16, time: f64| (f64::from(level) / 4.0).powi(2) * (1.0 - 0.025 * time) * 1.02;
        let points: Vec<(u16, f64, f64, f64)> =
            (0..4).map(|step| (4 - step, light(4 - step, f64::from(step)), 1e-3, f64::from(step))).collect();
        let black = MeasuredValue::new(0.01, 1e-4);
        let ramp = finish(4, &points, whites.clone(), 2e-4, black).expect("it has an exponent");
        for (found, expected) in ramp.curve.iter().zip([0.0, 0.0625, 0.25, 0.5625, 1.0]) {
            assert!((found - expected).abs() < 1e-12, "{:?}", ramp.curve);
        }
        assert!((ramp.figures.gamma.value - 2.0).abs() < 1e-9 && ramp.figures.gamma_residual < 1e-9);
        assert_eq!((ramp.figures.curve_error, ramp.figures.black), (1e-3, black));
        assert_eq!((ramp.whites, ramp.white_error), (whites, 2e-4));
        // No exponent describes the light of these levels.
        let bent = [(4, 1.0, 1e-3, 0.0), (2, 0.5, 2e-3, 0.0)];
        let ramp = finish(4, &bent, vec![(0.0, 1.0)], 0.0, black).expect("it has an exponent");
        assert!(
            ramp.figures.curve_error == 2e-3 && ramp.curve[4] == 1.0 && (ramp.curve[2] - 0.5).abs() < 1e-12,
            "{ramp:?}"
        );
    }

    #[test]
    fn a_still_camera_is_shown_33_levels_and_those_between_follow_the_exponent() {
        assert_eq!([0.05, 3.0].map(levels_for), LEVELS);
        assert_eq!(levels(255, 257).len(), 256);
        let shown = levels(255, 33);
        assert_eq!((shown.len(), shown[0], shown[32]), (33, 0, 255));
        let light = |x: f64| x.powf(2.2);
        let knots: Vec<(f64, f64)> =
            shown.iter().map(|&level| f64::from(level) / 255.0).map(|x| (x, light(x))).collect();
        let curve = interpolated(&knots, 255.0, 2.2);
        let off = curve.iter().enumerate().map(|(level, found)| (found - light(level as f64 / 255.0)).abs());
        assert!(off.fold(0.0, f64::max) < 1e-12);
        // No exponent describes this response. Interpolated levels still lie between their neighbours.
        let bent = interpolated(&[(0.0, 0.0), (0.5, 0.4), (1.0, 1.0)], 4.0, 2.2);
        assert!(
            bent.windows(2).all(|pair| pair[0] < pair[1]) && bent[2] == 0.4_f64.powf(1.0 / 2.2).powf(2.2)
        );
    }

    #[test]
    fn the_drift_of_a_fading_lamp_is_measured_per_hour() {
        let whites: Vec<(f64, f64)> = (0..10)
            .map(|at| 60.0 * f64::from(at))
            .map(|time| (time, 5.0 * (1.0 - 0.03 * time / 3600.0)))
            .collect();
        let drift = drift_per_hour(&whites, 1e-4).expect("ten times");
        assert!((drift.value + 0.03).abs() < 1e-9 && drift.error > 0.0, "{drift}");
    }

    /// The residuals `e, −3e, 3e, −e` at four times are orthogonal to every line.
    #[test]
    fn the_error_is_that_of_a_line_and_grows_with_residuals_that_are_larger_than_stated() {
        let drift = |e: f64| {
            let whites = [(0.0, 1.0), (1.0, -3.0), (2.0, 3.0), (3.0, -1.0)]
                .map(|(hours, sign)| (500.0 + 3600.0 * hours, 10.0 + 0.25 * hours + sign * e));
            drift_per_hour(&whites, 0.1).expect("four times")
        };
        // The squared deviations of the hours from their mean add up to 5. At the first photo, the line has the value 10.
        let expected = 0.1 / 5.0_f64.sqrt() / 10.0;
        for (e, scale) in [(0.0, 1.0), (0.01, 1.0), (0.2, (20.0 * 4.0 / 2.0_f64).sqrt())] {
            let drift = drift(e);
            assert!((drift.value - 0.025).abs() < 1e-12, "{drift}");
            assert!((drift.error / (expected * scale) - 1.0).abs() < 1e-9, "{} with {e}", drift.error);
        }
        let at_once = [(5.0, 1.0), (5.0, 1.1)];
        assert!(drift_per_hour(&at_once, 0.1).is_err(), "no time passes");
    }
}
