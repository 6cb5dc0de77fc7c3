//! Numbers as text.

use crate::finding::Ratio;
pub use crate::finding::decimal;

/// A fraction as a percentage with three digits, without the unit; `–` if there is nothing to measure.
pub fn percent(share: impl Into<Ratio>) -> String {
    share.into().percent()
}

/// A fraction as a percentage with three digits and the unit, such as `3.14 %`; `–` if there is nothing to measure.
pub(crate) fn percentage(share: impl Into<Ratio>) -> String {
    let Some(share) = share.into().value() else { return "–".into() };
    let percent = 100.0 * share;
    let decimals = match percent {
        100.0.. => 0,
        10.0.. => 1,
        0.1.. => 2,
        _ => 4,
    };
    format!("{percent:.decimals$} %")
}

/// A number as [`decimal`] shows it, with a plus sign before a value that is not negative.
pub fn signed(value: f64, decimals: usize) -> String {
    let plus = if value.is_sign_negative() { "" } else { "+" };
    plus.to_owned() + &decimal(value, decimals)
}

/// A value with its standard error: `0.0971 ±0.0012`. The error has two digits, and the value has as many decimals as the error. Without an
/// error, the value has eight decimals, as [`decimal`] shows them.
pub fn with_error(value: f64, error: f64) -> String {
    if error > 0.0 && error.is_finite() {
        let decimals = decimals(error);
        format!("{value:.decimals$} ±{error:.decimals$}")
    } else {
        decimal(value, 8)
    }
}

/// The value without the digits that its standard error makes uncertain. If the error is unknown, the value is unchanged.
pub fn rounded(value: f64, error: f64) -> f64 {
    if error > 0.0 && error.is_finite() {
        let decimals = decimals(error);
        // The parse cannot fail, since the printed text is always a number.
        format!("{value:.decimals$}").parse().unwrap_or(value)
    } else {
        value
    }
}

/// The number of decimals that shows two digits of an error.
fn decimals(error: f64) -> usize {
    // The clamp is at 324 decimals, where the smallest positive number has its first digit.
    (1.0 - error.log10().floor()).clamp(0.0, 324.0) as usize
}

/// Groups digits by thousands: `1048576` becomes `1,048,576`.
pub fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A number of bytes in the largest unit in which the value is at least 1: `2.5 GiB`.
pub fn bytes(bytes: u64) -> String {
    let bytes = bytes as f64;
    let units = ["bytes", "KiB", "MiB", "GiB"];
    let power = ((bytes.max(1.0).log2() / 10.0) as usize).min(units.len() - 1);
    match power {
        0 => format!("{bytes} bytes"),
        _ => format!("{:.1} {}", bytes / 1024_f64.powi(power as i32), units[power]),
    }
}

/// The text with a capital letter at its start.
pub fn capital(text: &str) -> String {
    let mut rest = text.chars();
    rest.next().into_iter().flat_map(char::to_uppercase).chain(rest).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn percentages_have_three_digits() {
        assert_eq!([1.5, 0.25, 0.0123].map(super::percent), ["150", "25.0", "1.23"]);
    }

    #[test]
    fn values_have_no_digits_beyond_their_errors() {
        assert_eq!(super::with_error(0.097_127_39, 0.001_234), "0.0971 ±0.0012");
        assert_eq!(super::with_error(1234.5, 56.0), "1234 ±56");
        assert_eq!(super::with_error(0.25, 0.0), "0.25000000");
        assert_eq!([super::rounded(0.097_127, 0.0012), super::rounded(0.5, f64::NAN)], [0.0971, 0.5]);
    }

    #[test]
    fn numbers_are_grouped_by_thousands() {
        assert_eq!([0, 999, 1000, 1048576].map(super::grouped), ["0", "999", "1,000", "1,048,576"]);
    }

    #[test]
    fn bytes_have_the_largest_unit_that_they_fill() {
        assert_eq!([512, 2048, 5 << 29].map(super::bytes), ["512 bytes", "2.0 KiB", "2.5 GiB"]);
    }
}
