//! How noise is said.

use anyhow::Result;

use super::console::Console;
use crate::transport::Noise;

/// The line about a matrix's noise.
pub(super) fn say_noise(noise: Option<&Noise>, console: &Console) -> Result<()> {
    let Some(noise) = noise else { return Ok(()) };
    console.say(format_args!(
        "noise     {} % of the white photo, {} % of the matrix, {} % without direct light",
        percent(noise.white_relative),
        percent(noise.operator),
        percent(noise.global)
    ))
}

/// A share as a percentage of three digits.
pub(super) fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    let decimals = if percent >= 100.0 {
        0
    } else if percent >= 10.0 {
        1
    } else {
        2
    };
    format!("{percent:.decimals$}")
}

#[cfg(test)]
mod tests {
    #[test]
    fn percentages_have_three_digits() {
        assert_eq!([1.5, 0.25, 0.0123].map(super::percent), ["150", "25.0", "1.23"]);
    }
}
