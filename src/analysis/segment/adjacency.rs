//! The normalized adjacency matrix of the graph of light exchange.

use super::graph::{Graph, Raster};
use crate::error::Result;
use crate::operator::{Operator, block, delegate};

/// `N = D^-½ W D^-½` of `m × m`, with `W = G_m + μ 1 1ᵀ` and `D = diag(W 1)`, on the nodes of a [`Graph`].
///
/// Its largest eigenvectors `v` give the smallest ones of the normalized cut without an inverse: `(D − W) u = (1 − λ) D u` with `u = D^-½
/// v`. The pair `λ = 1`, `v = D^½ 1` is known (Shi and Malik, doi:10.1109/34.868688). A product is a photo of `D^-½ x`.
pub struct NormalizedAdjacency<'a> {
    global: &'a mut dyn Operator,
    graph: &'a Graph,
    inverse_root: Vec<f64>,
    nodes: Vec<f64>,
    raster: Raster,
}

impl<'a> NormalizedAdjacency<'a> {
    /// The matrix of a global operator (`n × n`, symmetric) and its graph.
    pub fn new(global: &'a mut dyn Operator, graph: &'a Graph) -> Self {
        let inverse_root = graph.degree().iter().map(|d| 1.0 / d.sqrt()).collect();
        let m = graph.pixels().len();
        Self { global, graph, inverse_root, nodes: vec![0.0; m], raster: Raster::new(graph.n()) }
    }

    /// The known eigenvector of eigenvalue 1: `D^½ 1` of length `m`, not normalized.
    pub fn known_vector(graph: &Graph) -> Vec<f64> {
        graph.degree().iter().map(|d| d.sqrt()).collect()
    }

    /// A bound on `‖N q − q‖` for the normalized known vector `q`, without a photo. With `e = D 1 − W 1 ≥ 0`, `e ≤ D 1` and `Σ e
    /// ≤ leak`: `‖N q − q‖² = Σ e_i²/d_i / Σ d ≤ leak / Σ d`.
    pub fn known_residual(graph: &Graph) -> f64 {
        (graph.leak() / graph.degree().iter().sum::<f64>()).sqrt()
    }
}

impl Operator for NormalizedAdjacency<'_> {
    delegate!(global: symmetry, block_size, observer, frames, confirming);

    fn rows(&self) -> usize {
        self.nodes.len()
    }

    fn cols(&self) -> usize {
        self.nodes.len()
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        for ((node, value), scale) in self.nodes.iter_mut().zip(x).zip(&self.inverse_root) {
            *node = value * scale;
        }
        self.graph.weights_product(self.global, &self.nodes, &mut self.raster, y)?;
        for (value, scale) in y.iter_mut().zip(&self.inverse_root) {
            *value *= scale;
        }
        Ok(())
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        let scaled =
            |x: &&[f64]| x.iter().zip(&self.inverse_root).map(|(value, scale)| value * scale).collect();
        let nodes: Vec<Vec<f64>> = xs.iter().map(scaled).collect();
        self.graph.weights_block(self.global, &block(&nodes), ys)?;
        for y in ys {
            y.iter_mut().zip(&self.inverse_root).for_each(|(value, scale)| *value *= scale);
        }
        Ok(())
    }

    /// The standard errors of the photos, scaled as if their noise were the same in all pixels.
    fn standard_errors(&self) -> Vec<f64> {
        let squares: f64 = self.inverse_root.iter().map(|scale| scale * scale).sum();
        let scale = (squares / self.nodes.len() as f64).sqrt();
        self.global.standard_errors().into_iter().map(|error| scale * error).collect()
    }
}
