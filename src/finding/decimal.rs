//! Numbers as text.

/// A number with so many decimals, as in `0.1235`. Where that would show fewer than two of its digits, or more than nine before the point, it has so
/// many significant digits (three or more) and a power of ten, as in `1.235e-7`: only zero is shown as zero.
pub fn decimal(value: f64, decimals: usize) -> String {
    let least = 10_f64.powi(1 - decimals as i32);
    if value == 0.0 || !value.is_finite() || (least..1e9).contains(&value.abs()) {
        return format!("{value:.decimals$}");
    }
    let digits = decimals.max(3) - 1;
    format!("{value:.digits$e}")
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::decimal;

    proptest! {
        #[test]
        fn numbers_of_every_size_are_shown_within_their_digits(
            mantissa in 1.0_f64..10.0, power in -30..=30, sign in prop::sample::select(vec![-1.0, 1.0]), decimals in 3_usize..9,
        ) {
            let value = sign * mantissa * 10_f64.powi(power);
            let text = decimal(value, decimals);
            let shown: f64 = text.parse().expect("a number");
            prop_assert!(text.bytes().any(|digit| (b'1'..=b'9').contains(&digit)), "{value:e} is shown as {text}");
            // Half of the last digit, and what the arithmetic of this test rounds.
            let last = match text.contains('e') {
                true => 10_f64.powi(1 - decimals as i32) * value.abs(),
                false => 10_f64.powi(-(decimals as i32)),
            };
            prop_assert!((shown - value).abs() <= 0.5 * last + 1e-15 * value.abs(), "{value:e} is shown as {text}");
            prop_assert!((shown / value - 1.0).abs() < 0.05, "{value:e} is shown as {text}");
        }
    }

    #[test]
    fn usual_numbers_have_their_decimals_and_others_a_power_of_ten() {
        let shown =
            [0.25, 0.0, -0.0123, 9.87654e-4, -3.2e-12, 12_345.678_9, f64::NAN].map(|value| decimal(value, 4));
        assert_eq!(shown, ["0.2500", "0.0000", "-0.0123", "9.877e-4", "-3.200e-12", "12345.6789", "NaN"]);
    }
}
