//! Percentiles of values.

/// The value at the quantile `rank`, from 0 to 1: that of the nearest index among the sorted values; 0 if there are none. No value may be NaN.
pub(crate) fn percentile(values: impl IntoIterator<Item = f64>, rank: f64) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    if values.is_empty() {
        return 0.0;
    }
    let index = ((values.len() - 1) as f64 * rank).round() as usize;
    *values.select_nth_unstable_by(index, f64::total_cmp).1
}
