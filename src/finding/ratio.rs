//! Ratios whose denominator may be nothing but its own error.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::SIGMAS;

/// A ratio, or nothing where the denominator is no more than [`SIGMAS`] of its standard errors: there is then nothing to measure. It is never
/// infinite or NaN. It displays as a percentage of three digits, such as `3.14 %`, or as `–`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Ratio(Option<f64>);

impl Ratio {
    /// `numerator / denominator`, where `error` is the standard error of the denominator; 0 where it is exact.
    pub fn of(numerator: f64, denominator: f64, error: f64) -> Self {
        let is_measured = denominator.abs() > SIGMAS * error;
        Self(Some(numerator / denominator).filter(|value| is_measured && value.is_finite()))
    }

    /// `numerator / ‖v‖` for measured values, each with its variance: the length without what noise adds to it. Of noise alone, which has a length
    /// as well, there is nothing to measure: it passes for light in one case of 45 with a single value, of 246 with 64, and of 741 with many. The sum
    /// of their squares is compared with [`SIGMAS`] of its standard errors, and it is skewed where they are few.
    pub fn to_length(numerator: f64, measured: impl IntoIterator<Item = [f64; 2]>) -> Self {
        let [mut excess, mut spread] = [0.0; 2];
        for [value, variance] in measured {
            excess += value * value - variance;
            spread += 2.0 * variance * variance;
        }
        // The length is as certain as its square, whose standard error under noise alone is √spread.
        Self::of(numerator, excess.max(0.0).sqrt(), (spread.sqrt() / SIGMAS).sqrt())
    }

    /// The ratio; `None` where there is nothing to measure.
    pub fn value(self) -> Option<f64> {
        self.0
    }

    /// The percentage without its unit.
    pub fn percent(self) -> String {
        let Some(value) = self.0 else { return "–".into() };
        let percent = 100.0 * value;
        let decimals = match percent.abs() {
            100.0.. => 0,
            10.0.. => 1,
            _ => 2,
        };
        format!("{percent:.decimals$}")
    }
}

/// A share that is known; what is infinite or NaN is none.
impl From<f64> for Ratio {
    fn from(share: f64) -> Self {
        Self(Some(share).filter(|share| share.is_finite()))
    }
}

impl fmt::Display for Ratio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.percent())?;
        if self.0.is_some() { f.write_str(" %") } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    /// Numerators and denominators of every size, zeros, infinities and NaN among them.
    #[test]
    fn a_ratio_is_a_number_beyond_the_error_of_its_denominator_or_nothing() {
        let mut random = Pcg64::seed_from_u64(3);
        let ends = [0.0, -0.0, f64::MIN_POSITIVE, 1e-310, f64::MAX, f64::INFINITY, f64::NAN];
        let mut draw = || match random.random_range(0..3) {
            0 => ends[random.random_range(0..ends.len())],
            _ => 10_f64.powf(random.random_range(-200.0..200.0)) * [1.0, -1.0][random.random_range(0..2)],
        };
        let mut nothing = 0;
        for _ in 0..10_000 {
            let [numerator, denominator] = [draw(), draw()];
            let error = draw().abs();
            for (ratio, error) in [
                (Ratio::of(numerator, denominator, error), error),
                (Ratio::of(numerator, denominator, 0.0), 0.0),
            ] {
                match ratio.value() {
                    Some(value) => {
                        assert!(value.is_finite() && denominator.abs() > 3.0 * error);
                        assert_eq!(value, numerator / denominator);
                        assert!(ratio.to_string().ends_with(" %"));
                    }
                    None => {
                        nothing += 1;
                        assert_eq!(ratio.to_string(), "–");
                        let is_number = (numerator / denominator).is_finite() && !error.is_nan();
                        assert!(!is_number || denominator.abs() <= 3.0 * error);
                    }
                }
            }
        }
        assert!((1000..19_000).contains(&nothing), "{nothing}");
    }

    #[test]
    fn noise_alone_has_no_length() {
        let mut random = Pcg64::seed_from_u64(5);
        let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
        let found = |light: f64| -> usize {
            let measured = |_| {
                let values: Vec<[f64; 2]> = (0..64).map(|_| [light + normal(), 1.0]).collect();
                Ratio::to_length(1.0, values).value().is_some()
            };
            (0..1000).map(measured).filter(|&is_measured| is_measured).count()
        };
        // A sum of 64 squares is beyond 64 + 3 √128 in 4 of 1000 cases of noise alone (χ²), in 945 where light is as strong as noise, and in
        // all but 1e-5 where it is half as strong again (noncentral χ²). The bounds are four deviations of such counts.
        let [noise, faint, light] = [0.0, 1.0, 1.5].map(found);
        assert!(noise <= 12 && (916..=974).contains(&faint) && light == 1000, "{noise} {faint} {light}");
        let exact = Ratio::to_length(2.0, [[3.0, 0.0], [4.0, 0.0]]);
        assert_eq!((exact.value(), Ratio::to_length(0.0, [[0.0; 2]; 2]).value()), (Some(0.4), None));
    }

    #[test]
    fn percentages_have_three_digits() {
        let shown = |share: f64| Ratio::from(share).percent();
        assert_eq!([1.5, 0.25, 0.0123, -0.5, f64::NAN].map(shown), ["150", "25.0", "1.23", "-50.0", "–"]);
    }
}
