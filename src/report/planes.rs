//! Planes of values, one for each channel: as gray, and compared.

/// Pixel by pixel, the mean over the channels.
pub(super) fn mean(planes: &[Vec<f64>]) -> Vec<f64> {
    let pixels = planes.first().map_or(0, Vec::len);
    (0..pixels)
        .map(|pixel| planes.iter().map(|plane| plane[pixel]).sum::<f64>() / planes.len() as f64)
        .collect()
}

/// Pixel by pixel, the mean over the channels of `a − b`.
pub(super) fn difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> Vec<f64> {
    let less = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a - b).collect();
    mean(&a.iter().zip(b).map(less).collect::<Vec<_>>())
}

/// `3.14 %`, with three digits.
pub(super) fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    let decimals = match percent {
        100.0.. => 0,
        10.0.. => 1,
        0.1.. => 2,
        _ => 4,
    };
    format!("{percent:.decimals$} %")
}
