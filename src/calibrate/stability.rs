//! The drift of the lamp: a line fitted to the photos of white over time.

use super::least_squares::Normal;
use super::measured_value::MeasuredValue;
use crate::error::Result;

/// The relative change per hour of `whites` (seconds, light), each with this relative standard error. Where
/// the residuals of the line are larger than that, the error of the result is scaled up accordingly.
///
/// # Errors
/// [`crate::Error::Numerical`] when all photos were taken at the same time.
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
    #[test]
    fn the_drift_of_a_fading_lamp_is_measured_per_hour() {
        let whites: Vec<(f64, f64)> = (0..10)
            .map(|at| 60.0 * f64::from(at))
            .map(|time| (time, 5.0 * (1.0 - 0.03 * time / 3600.0)))
            .collect();
        let drift = super::drift_per_hour(&whites, 1e-4).expect("ten times");
        assert!((drift.value + 0.03).abs() < 1e-9 && drift.error > 0.0, "{drift}");
    }

    /// The residuals `e, −3e, 3e, −e` at four times are at right angles to every line.
    #[test]
    fn the_error_is_that_of_a_line_and_grows_with_residuals_that_are_larger_than_stated() {
        let drift = |e: f64| {
            let whites = [(0.0, 1.0), (1.0, -3.0), (2.0, 3.0), (3.0, -1.0)]
                .map(|(hours, sign)| (500.0 + 3600.0 * hours, 10.0 + 0.25 * hours + sign * e));
            super::drift_per_hour(&whites, 0.1).expect("four times")
        };
        // Hours less their mean have squares that add up to 5; the mean at the beginning is 10.
        let expected = 0.1 / 5.0_f64.sqrt() / 10.0;
        for (e, scale) in [(0.0, 1.0), (0.01, 1.0), (0.2, (20.0 * 4.0 / 2.0_f64).sqrt())] {
            let drift = drift(e);
            assert!((drift.value - 0.025).abs() < 1e-12, "{drift}");
            assert!((drift.error / (expected * scale) - 1.0).abs() < 1e-9, "{} with {e}", drift.error);
        }
        let at_once = [(5.0, 1.0), (5.0, 1.1)];
        assert!(super::drift_per_hour(&at_once, 0.1).is_err(), "no time passes");
    }
}
