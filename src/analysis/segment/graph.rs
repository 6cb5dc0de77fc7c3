//! The graph of light exchange. Its nodes are pixels, and the weight of an edge is the global light between two pixels.

use crate::error::{Error, Result};

/// If the share of light in masked pixels is below this value, no second photo is needed. The known eigenvector is then accurate to the
/// root of this share, 1e-8.
const NEGLIGIBLE_LEAK: f64 = 1e-16;

/// The nodes of the graph (the `m` of `n` pixels that are not masked) and their degrees.
///
/// The edge weights `W = G_m + μ 1 1ᵀ` stay in the operator. `G` is the global part of the transport matrix, and `G_m` holds its rows and
/// columns of unmasked pixels. Masking only rows or only columns would break the symmetry.
#[derive(Clone, Debug, PartialEq)]
pub struct Graph {
    n: usize,
    pixels: Vec<usize>,
    degree: Vec<f64>,
    leak: f64,
    mu: f64,
}

impl Graph {
    /// Measures the graph from one or two photos. The first photo is `white`, `G 1`.
    ///
    /// Pixels with a degree of at most `mask_below` times the median degree are masked. They contain only noise, and a tiny degree makes a
    /// huge entry of `D^-½`. The median is weighted by degree to ignore dark backgrounds: pixels above the median have half of all light.
    ///
    /// The degree must match the masked matrix, `D = diag(G_m 1_m)`, but `G 1` includes light exchanged with masked pixels. By symmetry
    /// this light is at most the sum `t` of the masked degrees. If `t` is zero (or `√(t/Σd)` ≤ 1e-8), `white` suffices. Otherwise
    /// `masked_photo` takes the photo of the mask as a pattern (1 on unmasked pixels, 0 elsewhere), whose values *are* the degrees. Pixels
    /// whose degree is now too low are also masked, without another photo, and [`Graph::leak`] bounds their light.
    ///
    /// # Errors
    /// [`Error::Numerical`] if `white` contains a NaN or an infinity, or if no pixel sees global light; any error of `masked_photo`.
    pub fn measure(
        white: &[f64],
        mask_below: f64,
        mu: f64,
        masked_photo: impl FnOnce(&[f64]) -> Result<Vec<f64>>,
    ) -> Result<Self> {
        check_finite(white)?;
        let n = white.len();
        let threshold = mask_below * median_by_light(white);
        let mut pixels: Vec<usize> = (0..n).filter(|&i| white[i] > 0.0 && white[i] > threshold).collect();
        if pixels.is_empty() {
            return Err(Error::Numerical(
                "no pixel sees global light: without light exchanged there is nothing to segment".into(),
            ));
        }
        let mut degree: Vec<f64> = pixels.iter().map(|&i| white[i]).collect();
        let total: f64 = degree.iter().sum();
        let kept: Vec<bool> = mask_of(n, &pixels);
        let mut leak =
            white.iter().zip(&kept).filter(|(_, kept)| !**kept).fold(0.0, |leak, (d, _)| leak + d.abs());
        if leak > NEGLIGIBLE_LEAK * total {
            let pattern: Vec<f64> = kept.iter().map(|&kept| if kept { 1.0 } else { 0.0 }).collect();
            let photo = masked_photo(&pattern)?;
            check_finite(&photo)?;
            let bright = |i: usize| photo[i] > 0.0 && photo[i] > threshold;
            leak = pixels.iter().filter(|&&i| !bright(i)).fold(0.0, |leak, &i| leak + photo[i].abs());
            pixels.retain(|&i| bright(i));
            degree = pixels.iter().map(|&i| photo[i]).collect();
        }
        let m = pixels.len() as f64;
        // Each node has an edge of weight μ to each of the m nodes, including itself.
        degree.iter_mut().for_each(|d| *d += mu * m);
        Ok(Self { n, pixels, degree, leak, mu })
    }

    /// The number of all pixels, masked or not.
    pub fn n(&self) -> usize {
        self.n
    }

    /// The pixel index of each node, in ascending order (`m`).
    pub fn pixels(&self) -> &[usize] {
        &self.pixels
    }

    /// The degree of each node (`m`, positive). It includes `μ m`.
    pub fn degree(&self) -> &[f64] {
        &self.degree
    }

    /// A bound on the light that `D` contains but `W 1` lacks, in units of degree: `Σ |D − W 1| ≤ leak`.
    pub fn leak(&self) -> f64 {
        self.leak
    }

    /// The mask (`n`), true for masked pixels.
    pub fn mask(&self) -> Vec<bool> {
        mask_of(self.n, &self.pixels).into_iter().map(|kept| !kept).collect()
    }

    /// Copies one value per node to the raster. Masked pixels get the value `masked`.
    pub fn scatter<T: Copy>(&self, nodes: &[T], masked: T) -> Vec<T> {
        let mut raster = vec![masked; self.n];
        for (&pixel, &value) in self.pixels.iter().zip(nodes) {
            raster[pixel] = value;
        }
        raster
    }

    /// The weight `μ` between any two nodes.
    pub(super) fn mu(&self) -> f64 {
        self.mu
    }

    /// Writes `W x = (G_m + μ 1 1ᵀ) x` on nodes to `y`, from the photo of the pattern `x`.
    pub(super) fn weights_product(&self, x: impl Iterator<Item = f64>, photo: &[f64], y: &mut [f64]) {
        // The term μ 1 1ᵀ x is computed, because it is not in the photo.
        let everywhere = if self.mu == 0.0 { 0.0 } else { self.mu * x.sum::<f64>() };
        for (value, &pixel) in y.iter_mut().zip(&self.pixels) {
            *value = photo[pixel] + everywhere;
        }
    }
}

/// The median weighted by light: the pixels with at least this degree have half of all light.
fn median_by_light(degree: &[f64]) -> f64 {
    let mut positive: Vec<f64> = degree.iter().copied().filter(|&d| d > 0.0).collect();
    positive.sort_by(|a, b| b.total_cmp(a));
    let half = positive.iter().sum::<f64>() / 2.0;
    let mut sum = 0.0;
    for &d in &positive {
        sum += d;
        if sum >= half {
            return d;
        }
    }
    0.0
}

fn mask_of(n: usize, pixels: &[usize]) -> Vec<bool> {
    let mut kept = vec![false; n];
    for &pixel in pixels {
        kept[pixel] = true;
    }
    kept
}

fn check_finite(photo: &[f64]) -> Result<()> {
    match photo.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(pixel) => {
            Err(Error::Numerical(format!("the photo of the degrees is {} at pixel {pixel}", photo[pixel])))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn no_photo(_: &[f64]) -> Result<Vec<f64>> {
        Err(Error::Numerical("no photo was to be taken".into()))
    }

    #[test]
    fn pixels_without_any_light_cost_no_second_photo() {
        let graph = Graph::measure(&[0.0, 2.0, 0.0, 3.0], 0.01, 0.0, no_photo).expect("one photo is enough");
        assert_eq!(graph.pixels(), [1, 3]);
        assert_eq!(graph.degree(), [2.0, 3.0]);
        assert_eq!(graph.mask(), [true, false, true, false]);
        assert_eq!(graph.scatter(&[7_u8, 8], 255), [255, 7, 255, 8]);
    }

    #[test]
    fn dim_pixels_are_masked_and_the_degree_measured_again_under_the_mask() {
        let mut pattern_shown = Vec::new();
        let graph = Graph::measure(&[5.0, 0.01, 4.0, 5.0], 0.1, 0.0, |pattern| {
            pattern_shown = pattern.to_vec();
            Ok(vec![4.995, 0.01, 3.995, 5.0])
        })
        .expect("a graph");
        assert_eq!(pattern_shown, [1.0, 0.0, 1.0, 1.0]);
        assert_eq!(graph.degree(), [4.995, 3.995, 5.0]);
        assert_eq!(graph.leak(), 0.0);
    }

    #[test]
    fn a_pixel_lit_by_masked_ones_only_is_masked_too() {
        let graph = Graph::measure(&[5.0, 0.4, 0.6, 5.0], 0.1, 0.0, |_| Ok(vec![5.0, 0.4, 0.1, 4.9]))
            .expect("a graph");
        assert_eq!(graph.pixels(), [0, 3]);
        assert_eq!(graph.leak(), 0.1);
    }

    #[test]
    fn a_dark_background_does_not_move_the_threshold() {
        let mut white = vec![1e-6; 1000];
        white[..10].fill(1.0);
        let graph = Graph::measure(&white, 0.01, 0.0, |pattern| Ok(pattern.to_vec())).expect("a graph");
        assert_eq!(graph.pixels().len(), 10);
    }

    #[test]
    fn an_edge_of_mu_to_every_node_adds_mu_m_to_the_degree() {
        let graph = Graph::measure(&[1.0, 2.0, 0.0], 0.0, 0.25, no_photo).expect("a graph");
        assert_eq!(graph.degree(), [1.5, 2.5]);
    }

    #[test]
    fn darkness_and_nan_are_errors() {
        assert!(Graph::measure(&[0.0; 4], 0.01, 0.0, no_photo).is_err());
        let message =
            Graph::measure(&[1.0, f64::NAN], 0.01, 0.0, no_photo).expect_err("NaN is refused").to_string();
        assert!(message.contains("NaN at pixel 1"), "{message}");
    }
}
