//! The Laplacian of the graph of light exchange, negated so that its smallest eigenvalues become the largest.

use super::graph::{Graph, Raster};
use crate::error::Result;
use crate::operator::{Operator, delegate};

/// The negative Laplacian `W − D` (`m × m`), with `W = G_m + μ 1 1ᵀ` and `D = diag(W 1)`, on the nodes of a [`Graph`].
///
/// Its largest eigenvalues are the negated smallest eigenvalues of the average cut, `(D − W) x = λ x`. They lie at the edge of
/// the spectrum, where Lanczos finds them without a shift (adding `σ I` would change no Krylov subspace). The pair `λ = 0`, `x
/// = 1` is known in advance. A product is one photo of the pattern `x`.
pub struct NegativeLaplacian<'a> {
    global: &'a mut dyn Operator,
    graph: &'a Graph,
    raster: Raster,
}

impl<'a> NegativeLaplacian<'a> {
    /// The matrix of a global operator (`n × n`, symmetric) and its graph.
    pub fn new(global: &'a mut dyn Operator, graph: &'a Graph) -> Self {
        Self { global, graph, raster: Raster::new(graph.n()) }
    }

    /// The known eigenvector of eigenvalue 0: all ones, of length `m`.
    pub fn known_vector(graph: &Graph) -> Vec<f64> {
        vec![1.0; graph.pixels().len()]
    }

    /// A bound on `‖(W − D) q‖` for the normalized known vector, without a photo: `leak / √m`.
    pub fn known_residual(graph: &Graph) -> f64 {
        graph.leak() / (graph.pixels().len() as f64).sqrt()
    }
}

impl Operator for NegativeLaplacian<'_> {
    delegate!(global: symmetry, block_size, observer, standard_errors, frames, confirming);

    fn rows(&self) -> usize {
        self.graph.pixels().len()
    }

    fn cols(&self) -> usize {
        self.graph.pixels().len()
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.graph.weights_product(self.global, x, &mut self.raster, y)?;
        subtract_degrees(self.graph, x, y);
        Ok(())
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.graph.weights_block(self.global, xs, ys)?;
        xs.iter().zip(ys).for_each(|(x, y)| subtract_degrees(self.graph, x, y));
        Ok(())
    }
}

fn subtract_degrees(graph: &Graph, x: &[f64], y: &mut [f64]) {
    for ((value, x), degree) in y.iter_mut().zip(x).zip(graph.degree()) {
        *value -= degree * x;
    }
}
