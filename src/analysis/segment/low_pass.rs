//! A low-pass filter for the directions of a segmentation's Krylov process. It is used where noise dominates the photos.
//!
//! Regions are extended, while the noise of a photo differs from pixel to pixel. A Gaussian blur of standard deviation `σ` keeps
//! `1 / 4πσ²` of the variance of noise, and nearly everything that varies slowly.

use super::graph::Graph;
use crate::image::{Blur, Resolution};
use crate::krylov::Filter;

/// A share of noise up to this value is not filtered, because the blur would lose more than it gains.
const TOLERATED: f64 = 0.3;

/// The blur is chosen so that it leaves at most this variance of noise, relative to the variance of the light, if [`WIDTHS`] allows it.
const LEFT: f64 = 0.1;

/// The narrowest and the widest blur in pixels.
const WIDTHS: [f64; 2] = [0.6, 4.0];

/// Makes the filter for vectors on the nodes of a graph. Eigenvectors of regions are the `known` vector times a constant on each region.
pub(super) fn low_pass(graph: &Graph, known: &[f64], resolution: Resolution) -> Filter {
    let (pixels, known) = (graph.pixels().to_vec(), known.to_vec());
    Filter::new(move |rest, share| {
        if share < TOLERATED {
            return None;
        }
        let light = (1.0 - share * share).max(1e-3);
        let width = (share * share / (4.0 * std::f64::consts::PI * LEFT * light)).sqrt();
        let blur = Blur::new(resolution, width.clamp(WIDTHS[0], WIDTHS[1]))?;
        let (mut sum, mut weight) = (vec![0.0; resolution.pixels()], vec![0.0; resolution.pixels()]);
        for ((&pixel, rest), known) in pixels.iter().zip(rest).zip(&known) {
            // The filter blurs the image `rest / known` with the weight `known²`, because dark pixels are the noisiest.
            sum[pixel] = rest * known;
            weight[pixel] = known * known;
        }
        let (sum, weight) = (blur.apply(&sum), blur.apply(&weight));
        let node =
            |(&pixel, known): (&usize, &f64)| known * sum[pixel] / weight[pixel].max(f64::MIN_POSITIVE);
        Some(pixels.iter().zip(&known).map(node).collect())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Result;

    #[test]
    fn noise_is_reduced_and_a_slow_wave_is_kept() -> Result<()> {
        let resolution = Resolution::new(24, 24);
        let white: Vec<f64> = (0..576).map(|pixel| 1.0 + (pixel % 24) as f64 / 24.0).collect();
        let graph = Graph::measure(&white, 0.0, 0.0, |_| Ok(vec![0.0; 576]))?;
        let known: Vec<f64> = graph.degree().iter().map(|degree| degree.sqrt()).collect();
        let filter = low_pass(&graph, &known, resolution);
        let wave = |pixel: usize| (std::f64::consts::PI * ((pixel % 24) as f64 + 0.5) / 24.0).cos();
        let slow: Vec<f64> = (0..576).map(|pixel| known[pixel] * wave(pixel)).collect();
        // A checkerboard varies as fast as possible, unlike a region.
        let fast: Vec<f64> = (0..576)
            .map(|pixel| known[pixel] * if (pixel % 24 + pixel / 24) % 2 == 0 { 1.0 } else { -1.0 })
            .collect();
        let norm = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        let after = |v: &[f64]| filter.apply(v, 0.8).map_or(f64::NAN, |filtered| norm(&filtered) / norm(v));
        assert!(after(&slow) > 0.97, "{}", after(&slow));
        assert!(after(&fast) < 0.05, "{}", after(&fast));
        assert!(filter.apply(&slow, 0.1).is_none(), "hardly any noise");
        Ok(())
    }
}
