//! A view of chosen pixels as points: their distances in the space of eigenvectors. [`Embedding`](super::Embedding) gives the coordinates.

use super::Segmentation;
use crate::error::{Error, Result};
use crate::image::Resolution;

/// Chosen pixels in the space of eigenvectors.
#[derive(Clone, Debug)]
pub struct FeatureView {
    /// The column and row of each pixel.
    pub pixels: Vec<(usize, usize)>,
    /// The coordinates of each pixel (`k − 1` numbers), starting with the second eigenvector.
    pub coordinates: Vec<Vec<f64>>,
    /// The distances between the pixels, row by row, relative to the root mean square distance of all pixels from the origin. A
    /// pixel that exchanges light equally with all others would be at the origin.
    pub distances: Vec<Vec<f64>>,
}

/// Computes the coordinates and distances of pixels, given by column and row. Fails with [`Error::Option`] naming `--features`
/// for a pixel that lies outside the raster or is masked and so has no coordinates.
pub fn feature_view(
    found: &Segmentation,
    resolution: Resolution,
    pixels: &[(usize, usize)],
) -> Result<FeatureView> {
    let refuse = |(x, y): (usize, usize), fault: &str, help: String| {
        Err(Error::option("--features", format!("pixel {x},{y} {fault}")).help(help))
    };
    for &(x, y) in pixels {
        if x >= resolution.width || y >= resolution.height {
            return refuse((x, y), "is outside of the picture", format!("it has {resolution} pixels"));
        }
        if found.mask[y * resolution.width + x] {
            let help = "choose one with light that reached it from elsewhere".to_owned();
            return refuse((x, y), "is masked: it exchanges no light", help);
        }
    }
    let coordinates: Vec<Vec<f64>> =
        pixels.iter().map(|&(x, y)| found.feature(y * resolution.width + x)).collect();
    // `within` holds Σ w u² of each eigenvector's clamped entries u.
    let squares = found.embedding.weights.iter().zip(&found.embedding.within);
    let spread = squares.map(|(weight, within)| weight * weight * within).sum::<f64>()
        / found.weights.iter().sum::<f64>();
    let scale = spread.sqrt().max(f64::MIN_POSITIVE);
    let distance = |a: &Vec<f64>, b: &Vec<f64>| {
        a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt() / scale
    };
    let distances =
        coordinates.iter().map(|a| coordinates.iter().map(|b| distance(a, b)).collect()).collect();
    Ok(FeatureView { pixels: pixels.to_vec(), coordinates, distances })
}
