//! Axes of a plot: the position of values along them, and round tick labels.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scale {
    Linear,
    /// Values ≤ 0 have no position and are left out.
    Log,
}

pub(super) struct Axis {
    scale: Scale,
    low: f64,
    high: f64,
    pub ticks: Vec<Tick>,
}

pub(super) struct Tick {
    pub value: f64,
    /// The text of the tick. An unlabelled grid line between labelled ticks has an empty string.
    pub label: String,
}

impl Axis {
    /// The axis around all plottable `values`, extended to round numbers, with about `wanted` labelled ticks; `None` without such values.
    pub fn around(scale: Scale, values: impl Iterator<Item = f64>, wanted: usize) -> Option<Self> {
        // Numbers near the ends of the range of `f64` are left out, since they would overflow when they are rounded to a tick.
        let placed = values.filter(|&value| match scale {
            Scale::Linear => value.abs() < 1e300,
            Scale::Log => (1e-300..1e300).contains(&value),
        });
        let (low, high) = placed
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        if low > high {
            return None;
        }
        Some(match scale {
            Scale::Linear => Self::linear(low, high, wanted),
            Scale::Log => Self::logarithmic(low, high, wanted),
        })
    }

    fn linear(mut low: f64, mut high: f64, wanted: usize) -> Self {
        let size = low.abs().max(high.abs());
        // Values that agree to nine digits count as equal, since tick labels could not distinguish them.
        if high - low <= 1e-9 * size {
            let margin = if size == 0.0 { 1.0 } else { 0.1 * size };
            (low, high) = (low - margin, high + margin);
        }
        let step = round_step((high - low) / wanted.max(1) as f64, 1.25);
        let (first, last) = ((low / step).floor(), (high / step).ceil());
        let decimals = (-step.log10()).ceil().clamp(0.0, 12.0) as usize;
        let plain = (1e-4..1e6).contains(&step) && first.abs().max(last.abs()) * step < 1e7;
        let ticks = (0..=(last - first) as usize)
            .map(|index| {
                let value = (first + index as f64) * step;
                Tick { value, label: linear_label(value, plain.then_some(decimals)) }
            })
            .collect();
        Self { scale: Scale::Linear, low: first * step, high: last * step, ticks }
    }

    fn logarithmic(low: f64, high: f64, wanted: usize) -> Self {
        // The ends are rounded to 1, 2 or 5 times a power of ten. A whole decade would be mostly empty for values just above 1.
        let (low, high) = (1.0 / round_step(1.0 / low, 1.0), round_step(high, 1.0));
        let (low, high) = if high > low { (low, high) } else { (low / 10.0, high * 10.0) };
        let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
        let stride = ((last - first) as usize).div_ceil(wanted.max(1)).max(1) as i32;
        let few = last - first <= 2;
        // All labels of an axis are decimals, or all are powers of ten.
        let plain = first >= -2 && last <= 3;
        let mut ticks = Vec::new();
        for exponent in first..=last {
            let labelled = exponent.rem_euclid(stride) == 0;
            ticks.push((1, exponent, labelled));
            if last - first <= 6 {
                ticks.extend([2, 5].map(|digit| (digit, exponent, few)));
            }
        }
        let tick = |(digit, exponent, labelled): (i32, i32, bool)| {
            let label = match digit {
                _ if !labelled => String::new(),
                _ if plain => (f64::from(digit) * 10_f64.powi(exponent)).to_string(),
                1 => power_of_ten(exponent),
                _ => format!("{digit}·{}", power_of_ten(exponent)),
            };
            Tick { value: f64::from(digit) * 10_f64.powi(exponent), label }
        };
        let within = |tick: &Tick| tick.value >= low * (1.0 - 1e-9) && tick.value <= high * (1.0 + 1e-9);
        Self { scale: Scale::Log, low, high, ticks: ticks.into_iter().map(tick).filter(within).collect() }
    }

    pub fn exactly(low: f64, high: f64, ticks: Vec<Tick>) -> Self {
        Self { scale: Scale::Linear, low, high, ticks }
    }

    /// The position of a value along the axis, 0 to 1; `None` for a value that is not on the axis.
    pub fn position(&self, value: f64) -> Option<f64> {
        let along = match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Log if value > 0.0 => (value / self.low).ln() / (self.high / self.low).ln(),
            Scale::Log => return None,
        };
        // The small tolerance keeps values that are exactly at an end of the axis.
        (-1e-6..=1.0 + 1e-6).contains(&along).then_some(along)
    }
}

/// The smallest of 1, 2 or 5 times a power of ten that is at least `size / slack`.
fn round_step(size: f64, slack: f64) -> f64 {
    let magnitude = 10_f64.powf(size.log10().floor());
    // The tolerance keeps 2.0000000000000004 from being rounded up to 5.
    let leading = size / magnitude / slack * (1.0 - 1e-9);
    let rounded = [1.0, 2.0, 5.0].into_iter().find(|&digit| leading <= digit).unwrap_or(10.0);
    rounded * magnitude
}

/// The number with so many decimals, or else with a power of ten.
fn linear_label(value: f64, decimals: Option<usize>) -> String {
    let text = match decimals {
        _ if value == 0.0 => "0".into(),
        Some(decimals) => format!("{value:.decimals$}"),
        None => format!("{:e}", round_to_digits(value, 6)),
    };
    // The Unicode minus sign is as wide as a digit.
    text.replace('-', "\u{2212}")
}

/// Rounds `value` to `digits` digits after the leading digit. This removes the rounding error of a multiplication by the step.
fn round_to_digits(value: f64, digits: usize) -> f64 {
    format!("{value:.digits$e}").parse().unwrap_or(value)
}

fn power_of_ten(exponent: i32) -> String {
    const SUPERSCRIPTS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digits = exponent.unsigned_abs().to_string();
    let raised = digits.chars().filter_map(|digit| Some(SUPERSCRIPTS[digit.to_digit(10)? as usize]));
    format!("10{}{}", if exponent < 0 { "⁻" } else { "" }, raised.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|tick| tick.label.as_str()).filter(|label| !label.is_empty()).collect()
    }

    fn axis(scale: Scale, values: &[f64]) -> Axis {
        Axis::around(scale, values.iter().copied(), 5).unwrap_or_else(|| unreachable!("no values"))
    }

    #[test]
    fn linear_ticks_are_round_and_enclose_the_values() {
        assert_eq!(labels(&axis(Scale::Linear, &[0.0, 1.0])), ["0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(&axis(Scale::Linear, &[-7.0, 31.0])), ["−10", "0", "10", "20", "30", "40"]);
        assert_eq!(
            labels(&axis(Scale::Linear, &[3.0, 3.0])),
            ["2.7", "2.8", "2.9", "3.0", "3.1", "3.2", "3.3"]
        );
        assert_eq!(labels(&axis(Scale::Linear, &[0.0, 4e-9])), ["0", "1e−9", "2e−9", "3e−9", "4e−9"]);
    }

    #[test]
    fn logarithmic_ticks_are_powers_of_ten() {
        assert_eq!(labels(&axis(Scale::Log, &[2e-3, 0.7])), ["10⁻²", "10⁻¹", "10⁰"]);
        assert_eq!(labels(&axis(Scale::Log, &[0.06, 0.3])), ["0.05", "0.1", "0.2", "0.5"]);
        assert_eq!(
            labels(&axis(Scale::Linear, &[9e6, 1.2e7])),
            ["9e6", "9.5e6", "1e7", "1.05e7", "1.1e7", "1.15e7", "1.2e7"]
        );
        assert_eq!(labels(&axis(Scale::Log, &[0.3, 1.2])), ["0.2", "0.5", "1", "2"]);
        assert_eq!(
            labels(&axis(Scale::Log, &[1e-6, 1e-6])),
            ["10⁻⁷", "2·10⁻⁷", "5·10⁻⁷", "10⁻⁶", "2·10⁻⁶", "5·10⁻⁶", "10⁻⁵"]
        );
        assert_eq!(labels(&axis(Scale::Log, &[1.0, 1e12])), ["10⁰", "10³", "10⁶", "10⁹", "10¹²"]);
        assert!(Axis::around(Scale::Log, [0.0, -1.0, f64::NAN].into_iter(), 5).is_none());
    }

    #[test]
    fn positions_run_from_zero_to_one() {
        let log = axis(Scale::Log, &[1e-4, 1.0]);
        approx::assert_relative_eq!(log.position(1e-2).unwrap_or(f64::NAN), 0.5);
        assert_eq!(log.position(0.0), None);
    }
}
