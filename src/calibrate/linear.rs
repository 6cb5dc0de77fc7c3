//! Counts as light, as far as a calibration knows while it is made.

/// `linear DN = curve(count)`, or `count − black`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Linear {
    pub(crate) black: f64,
    pub(crate) curve: Option<Vec<f64>>,
}

impl Linear {
    /// Light of a count, also of a mean of counts, in DN above black.
    pub(crate) fn of(&self, count: f64) -> f64 {
        let Some(curve) = &self.curve else { return count - self.black };
        let at = (count.max(0.0) as usize).min(curve.len() - 2);
        curve[at] + (count - at as f64) * (curve[at + 1] - curve[at])
    }

    /// Linear DN for each count, near `count`.
    pub(crate) fn slope(&self, count: f64) -> f64 {
        let Some(curve) = &self.curve else { return 1.0 };
        let reach = (curve.len() / 256).max(1);
        let at = (count.max(0.0) as usize).min(curve.len() - 1);
        let (low, high) = (at.saturating_sub(reach), (at + reach).min(curve.len() - 1));
        (curve[high] - curve[low]) / (high - low) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_curve_light_is_what_is_above_black() {
        let linear = Linear { black: 10.0, curve: None };
        assert_eq!((linear.of(12.5), linear.of(3.0), linear.slope(12.5)), (2.5, -7.0, 1.0));
    }

    #[test]
    fn a_curve_is_followed_between_counts_and_beyond_its_ends() {
        let squares: Vec<f64> = (0..1024).map(|count| f64::from(count * count)).collect();
        let linear = Linear { black: 0.0, curve: Some(squares) };
        assert_eq!((linear.of(7.0), linear.of(7.25)), (49.0, 49.0 + 0.25 * 15.0));
        // The first and the last piece go on straight.
        assert_eq!((linear.of(-2.0), linear.of(1024.0)), (-2.0, 1023.0 * 1023.0 + 2045.0));
        // Over four counts on both sides: the mean slope of a square is its slope in the middle.
        assert_eq!((linear.slope(100.9), linear.slope(0.0), linear.slope(-5.0)), (200.0, 4.0, 4.0));
        assert_eq!(linear.slope(2000.0), 1023.0 + 1019.0);
        let short = Linear { black: 0.0, curve: Some(vec![0.0, 1.0, 4.0, 9.0]) };
        assert_eq!(short.slope(1.0), 2.0, "over one count at least");
    }
}
