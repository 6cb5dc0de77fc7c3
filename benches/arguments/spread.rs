//! Medians with their ranges.

/// Median and range, with three digits.
pub fn spread(values: impl IntoIterator<Item = f64>) -> String {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    let middle = values[values.len() / 2];
    let digits = (2.0 - middle.max(1e-9).log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{middle:.digits$} ({:.digits$} to {:.digits$})", values[0], values[values.len() - 1])
}
