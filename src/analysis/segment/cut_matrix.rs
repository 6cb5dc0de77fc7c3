//! The matrix of a cut on the graph of light exchange. Its largest eigenvalues belong to the smallest eigenvalues of the cut.

use super::graph::Graph;
use super::options::Cut;
use crate::error::Result;
use crate::operator::vectors::made_elsewhere;
use crate::operator::{Direction, Operator, Selection, Vectors, between, delegate};

/// The matrix (`m × m`) of a cut on the nodes of a [`Graph`], with `W = G_m + μ 1 1ᵀ` and `D = diag(W 1)`.
///
/// * [`Cut::Normalized`]: the normalized adjacency `N = D^-½ W D^-½`. Its eigenvectors `v` of largest eigenvalue `λ` give the eigenvectors
///   `u = D^-½ v` of the normalized cut with the smallest eigenvalues, without an inverse: `(D − W) u = (1 − λ) D u`. The pair `λ = 1`, `v
///   = D^½ 1` is known (Shi and Malik, doi:10.1109/34.868688). A product is a photo of `D^-½ x`.
/// * [`Cut::Average`]: the negative Laplacian `W − D`. Its largest eigenvalues are the negated smallest eigenvalues of the average cut, `(D
///   − W) x = λ x`. They lie at the edge of the spectrum, where Lanczos finds them without a shift (adding `σ I` would change no Krylov
///   subspace). The pair `λ = 0`, `x = 1` is known. A product is a photo of `x`.
pub struct CutMatrix<'a> {
    global: &'a mut dyn Operator,
    graph: &'a Graph,
    cut: Cut,
    /// The factor that multiplies each node before and after a product: `D^-½`, or 1 for the average cut.
    scaling: Vec<f64>,
}

impl<'a> CutMatrix<'a> {
    /// Makes the matrix from a global operator (`n × n`, symmetric) and its graph.
    pub fn new(global: &'a mut dyn Operator, graph: &'a Graph, cut: Cut) -> Self {
        let scaling = match cut {
            Cut::Normalized => graph.degree().iter().map(|d| 1.0 / d.sqrt()).collect(),
            Cut::Average => vec![1.0; graph.pixels().len()],
        };
        Self { global, graph, cut, scaling }
    }

    /// Whether the matrix is `D^-½ G_m D^-½`, without further terms.
    fn is_scaled_light(&self) -> bool {
        self.cut == Cut::Normalized && self.graph.mu() == 0.0
    }
}

impl Cut {
    /// The sign that converts the largest eigenvalues, which Lanczos finds, to the eigenvalues reported for the cut.
    pub(super) fn sign(self) -> f64 {
        match self {
            Self::Normalized => 1.0,
            Self::Average => -1.0,
        }
    }

    /// The known eigenvector (`m`), not normalized: `D^½ 1` with the eigenvalue 1 for the normalized cut, or 1 with the eigenvalue 0 for
    /// the average cut.
    pub fn known_vector(self, graph: &Graph) -> Vec<f64> {
        match self {
            Self::Normalized => graph.degree().iter().map(|d| d.sqrt()).collect(),
            Self::Average => vec![1.0; graph.pixels().len()],
        }
    }

    /// A bound on the residual of the normalized known vector `q`, without a photo. Let `e = D 1 − W 1 ≥ 0`, with `e ≤ D 1` and
    /// `Σ e ≤ leak`. Then `‖N q − q‖² = Σ e_i²/d_i / Σ d ≤ leak / Σ d`, and `‖(W − D) q‖ ≤ leak / √m`.
    pub fn known_residual(self, graph: &Graph) -> f64 {
        match self {
            Self::Normalized => (graph.leak() / graph.degree().iter().sum::<f64>()).sqrt(),
            Self::Average => graph.leak() / (graph.pixels().len() as f64).sqrt(),
        }
    }
}

impl Operator for CutMatrix<'_> {
    delegate!(global: symmetry, block_size, observer, frames, confirming);

    fn rows(&self) -> usize {
        self.scaling.len()
    }

    fn cols(&self) -> usize {
        self.scaling.len()
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        let Self { global, graph, cut, scaling } = self;
        let scaling = &*scaling;
        let before =
            |x: &[f64]| graph.scatter(&x.iter().zip(scaling).map(|(x, s)| x * s).collect::<Vec<_>>(), 0.0);
        let after = |x: &[f64], photo: &[f64], y: &mut [f64]| {
            graph.weights_product(x.iter().zip(scaling).map(|(x, s)| x * s), photo, y);
            y.iter_mut().zip(scaling).for_each(|(value, s)| *value *= s);
            if *cut == Cut::Average {
                y.iter_mut().zip(x).zip(graph.degree()).for_each(|((value, x), d)| *value -= d * x);
            }
        };
        between(*global, (xs, ys), before, after)
    }

    /// The vectors of the global operator, selected and scaled. The host computes the terms of `μ` and of the average cut.
    fn vectors(&self, columns: usize, selection: Option<Selection<'_>>) -> Result<Option<Box<dyn Vectors>>> {
        if !self.is_scaled_light() || selection.is_some() {
            return Ok(None);
        }
        let nodes = Selection { entries: self.graph.pixels(), factors: &self.scaling };
        self.global.vectors(columns, Some(nodes))
    }

    fn apply_within(&mut self, vectors: &mut dyn Vectors, column: usize, direction: Direction) -> Result<()> {
        if !self.is_scaled_light() || vectors.rows() != self.rows() {
            return Err(made_elsewhere());
        }
        self.global.apply_within(vectors, column, direction)
    }

    /// The standard errors of the photos, scaled like the products. The scaling assumes that all pixels have the same noise.
    fn standard_errors(&self) -> Vec<f64> {
        let squares: f64 = self.scaling.iter().map(|scale| scale * scale).sum();
        let scale = (squares / self.scaling.len() as f64).sqrt();
        self.global.standard_errors().into_iter().map(|error| scale * error).collect()
    }
}
