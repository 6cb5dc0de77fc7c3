//! Planes of values, one per channel: their mean and difference.

use crate::finding::Ratio;

/// The mean over the channels, for each pixel.
pub(crate) fn mean(planes: &[Vec<f64>]) -> Vec<f64> {
    let pixels = planes.first().map_or(0, Vec::len);
    (0..pixels)
        .map(|pixel| planes.iter().map(|plane| plane[pixel]).sum::<f64>() / planes.len() as f64)
        .collect()
}

/// The mean of `a − b` over the channels, for each pixel.
pub(crate) fn difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> Vec<f64> {
    let less = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a - b).collect();
    mean(&a.iter().zip(b).map(less).collect::<Vec<_>>())
}

/// A percentage with three digits, such as `3.14 %`; `–` if there is nothing to measure.
pub(crate) fn percent(share: impl Into<Ratio>) -> String {
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
