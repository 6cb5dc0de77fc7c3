//! Counts as light, as far as a calibration knows while it is made.

/// `linear DN = curve(count)`, or `count − black`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Linear {
    pub(super) black: f64,
    pub(super) curve: Option<Vec<f64>>,
}

impl Linear {
    /// Light of a count, also of a mean of counts, in DN above black.
    pub(super) fn of(&self, count: f64) -> f64 {
        let Some(curve) = &self.curve else { return count - self.black };
        let at = (count.max(0.0) as usize).min(curve.len() - 2);
        curve[at] + (count - at as f64) * (curve[at + 1] - curve[at])
    }

    /// Linear DN for each count, near `count`.
    pub(super) fn slope(&self, count: f64) -> f64 {
        let Some(curve) = &self.curve else { return 1.0 };
        let reach = (curve.len() / 256).max(1);
        let at = (count.max(0.0) as usize).min(curve.len() - 1);
        let (low, high) = (at.saturating_sub(reach), (at + reach).min(curve.len() - 1));
        (curve[high] - curve[low]) / (high - low) as f64
    }
}
