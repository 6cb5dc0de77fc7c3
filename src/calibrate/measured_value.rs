//! A measured number with its standard error.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A measured number with its standard error, in the same unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasuredValue {
    /// The value.
    pub value: f64,
    /// The standard error, as predicted by the noise of the frames.
    pub error: f64,
}

impl MeasuredValue {
    /// `value ± error`.
    pub fn new(value: f64, error: f64) -> Self {
        Self { value, error }
    }

    /// The value and its error times a factor.
    pub fn scaled(self, factor: f64) -> Self {
        Self { value: self.value * factor, error: self.error * factor.abs() }
    }
}

impl fmt::Display for MeasuredValue {
    /// Writes the value with two digits of the error: `2.2013 ± 0.0012`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = if self.error > 0.0 { self.error } else { self.value.abs() * 1e-4 };
        let decimals = if size > 0.0 { (1.0 - size.log10().floor()).clamp(0.0, 9.0) as usize } else { 0 };
        write!(f, "{:.decimals$} ± {:.decimals$}", self.value, self.error)
    }
}

#[cfg(test)]
mod tests {
    use super::MeasuredValue;

    #[test]
    fn a_value_is_written_with_two_digits_of_its_error() {
        assert_eq!(MeasuredValue::new(2.201_34, 0.001_21).to_string(), "2.2013 ± 0.0012");
        assert_eq!(MeasuredValue::new(64.03, 1.5).to_string(), "64.0 ± 1.5");
        assert_eq!(MeasuredValue::new(0.0, 0.0).to_string(), "0 ± 0");
        // Without an error, to a ten-thousandth of the value.
        assert_eq!(MeasuredValue::new(-2.5, 0.0).to_string(), "-2.50000 ± 0.00000");
        assert_eq!(MeasuredValue::new(2.0, 0.5).scaled(-3.0), MeasuredValue::new(-6.0, 1.5));
    }
}
