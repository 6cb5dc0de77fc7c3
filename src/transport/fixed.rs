//! Sums over rows that do not depend on the order of their terms.

use super::chunk::Term;

/// How many powers of two there are from the smallest to the largest exponent whose values are summed to the last bit. What is left of a smaller value
/// is below the last bit of a larger one, of which there is one at least.
const POWERS: u32 = 70;

/// The unit of sums: a power of two that depends on the largest of all values alone. So the bits of a sum do not depend on who adds which of its
/// terms.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    /// The bits of the smallest exponent.
    lowest: u32,
    is_finite: bool,
}

/// The sums of the means and errors of contributions, as multiples of the unit. A term is less than 2⁹⁴ units, so that there may be 2³² terms.
pub(super) type FixedSums<const C: usize> = [[i128; C]; 2];

/// Sums over one row of the whole matrix, including the diagonal: values and errors.
///
/// They are those of all paths from the pixel of the row and of the paths that end there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RowSums<const C: usize> {
    pub(super) mean: [f64; C],
    pub(super) error: [f64; C],
}

impl<const C: usize> RowSums<C> {
    /// Adds the diagonal's direct light to the sums of values and errors.
    pub(super) fn add_direct(&mut self, direct: &[[f64; 2]; C]) {
        for (channel, [mean, error]) in direct.iter().enumerate() {
            self.mean[channel] += mean;
            self.error[channel] += error;
        }
    }
}

/// The bits of the exponent of a value: a larger value never has fewer.
pub(super) fn exponent(value: f32) -> u32 {
    value.to_bits() >> 23 & 0xff
}

/// The largest exponent of a contribution.
pub(super) fn largest_exponent<const C: usize>(term: &Term<C>) -> u32 {
    term.mean.iter().chain(&term.error).map(|&value| exponent(value)).max().unwrap_or(0)
}

impl Scale {
    /// The unit of sums of values whose largest exponent has these bits.
    pub(super) fn new(largest: u32) -> Self {
        Self { lowest: largest.saturating_sub(POWERS).max(1), is_finite: largest < 0xff }
    }

    /// Adds a contribution to the sums.
    #[inline]
    pub(super) fn add<const C: usize>(self, to: &mut FixedSums<C>, term: &Term<C>) {
        add_sums(to, &self.units_of(term));
    }

    /// A contribution as sums of itself alone.
    #[inline]
    pub(super) fn units_of<const C: usize>(self, term: &Term<C>) -> FixedSums<C> {
        [&term.mean, &term.error].map(|values| values.map(|value| self.units(value)))
    }

    /// The sums as numbers.
    pub(super) fn sums<const C: usize>(self, [mean, error]: &FixedSums<C>) -> RowSums<C> {
        RowSums { mean: mean.map(|sum| self.value(sum)), error: error.map(|sum| self.value(sum)) }
    }

    #[inline]
    fn units(self, value: f32) -> i128 {
        let bits = value.to_bits();
        // The smallest numbers have no leading bit, and the exponent of the next larger ones.
        let whole = bits & 0x7f_ffff | u32::from(exponent(value) > 0) << 23;
        let exponent = exponent(value).max(1);
        let units = match exponent.checked_sub(self.lowest) {
            Some(power) => i128::from(whole) << power.min(POWERS),
            None => i128::from(whole.checked_shr(self.lowest - exponent).unwrap_or(0)),
        };
        // All bits of the sign: without a branch, since errors have either sign as often.
        let sign = -i128::from(bits >> 31);
        (units ^ sign) - sign
    }

    fn value(self, sum: i128) -> f64 {
        if self.is_finite { sum as f64 * 2_f64.powi(self.lowest as i32 - 150) } else { f64::NAN }
    }
}

/// Adds other sums of the same row.
#[inline]
pub(super) fn add_sums<const C: usize>(to: &mut FixedSums<C>, more: &FixedSums<C>) {
    for (to, more) in to.as_flattened_mut().iter_mut().zip(more.as_flattened()) {
        *to = to.wrapping_add(*more);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::chunk::Key;

    #[test]
    fn sums_are_exact_in_any_order() {
        // The sum of small numbers that a sum of `f32` from the largest on would not have.
        let values = [1.0, 2_f32.powi(-40), -0.75, 2_f32.powi(-40), -3e-9, 1e-30];
        let scale = Scale::new(values.iter().map(|&value| exponent(value)).max().unwrap_or(0));
        let sum = |values: &mut dyn Iterator<Item = f32>| {
            let mut sums = FixedSums::<1>::default();
            values.for_each(|value| {
                scale.add(&mut sums, &Term { mean: [value], error: [-value], ..Term::none(Key::new(0, 1)) });
            });
            scale.sums(&sums)
        };
        let found = sum(&mut values.iter().copied());
        assert_eq!(found, sum(&mut values.iter().rev().copied()));
        // The last value is below the unit.
        assert_eq!(found.mean, [0.25 + 2_f64.powi(-39) - f64::from(3e-9_f32)]);
        assert_eq!(found.error, found.mean.map(|mean| -mean));
        assert!(Scale::new(exponent(f32::NAN)).sums(&FixedSums::<1>::default()).mean[0].is_nan());
    }

    #[test]
    fn each_number_alone_is_its_sum() {
        for value in [0.0, -1.5, 3e38, f32::MIN_POSITIVE / 4.0, -f32::MIN_POSITIVE, 1e-20] {
            let scale = Scale::new(exponent(value));
            assert_eq!(scale.value(scale.units(value)), f64::from(value), "{value:e}");
        }
    }
}
