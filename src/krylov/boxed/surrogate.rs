//! Surrogates: cheap approximations of an operator on directions that no product has explored.

use std::sync::Arc;

use super::super::basis::Basis;
use super::super::vectors::update2;

/// A family of `n × n` operators that cost no product, one of which approximates `A`. A preconditioner
/// approximates the inverse; a surrogate approximates the operator itself, and has a transpose, which a
/// method without products with `Aᵀ` lacks.
pub trait Surrogate: Send + Sync {
    /// The dimension `n`.
    fn size(&self) -> usize;
    /// The member of the family that fits `A patterns[i] = products[i]` best.
    fn fitted(&self, patterns: &[Vec<f64>], products: &[Vec<f64>]) -> Arc<dyn Surrogate>;
    /// `y ← P x`; every entry of `y` is overwritten.
    fn apply(&self, x: &[f64], y: &mut [f64]);
    /// `x ← Pᵀ y`; every entry of `x` is overwritten.
    fn apply_adjoint(&self, y: &[f64], x: &mut [f64]);
}

/// A surrogate is fitted to the first products, of this number; later products correct it where it is wrong.
const FITTED: usize = 16;

/// A surrogate in scaled coordinates, `P̂ = D^-½ P D^-½`, corrected so that it agrees with all products:
/// `P̂ + (W − P̂ V) Vᵀ`.
#[derive(Clone)]
pub(super) struct Corrected {
    surrogate: Arc<dyn Surrogate>,
    patterns: Vec<Vec<f64>>,
    products: Vec<Vec<f64>>,
    /// `W − P̂ V`; shorter than `V` until it is updated.
    excess: Basis,
}

impl Corrected {
    pub(super) fn new(surrogate: Arc<dyn Surrogate>) -> Self {
        let excess = Basis::new(surrogate.size());
        Self { surrogate, patterns: Vec::new(), products: Vec::new(), excess }
    }

    /// Adds the product `A x = y`.
    pub(super) fn learn(&mut self, x: &[f64], y: &[f64]) {
        if self.patterns.len() == FITTED {
            return;
        }
        self.patterns.push(x.to_vec());
        self.products.push(y.to_vec());
        self.surrogate = self.surrogate.fitted(&self.patterns, &self.products);
        self.excess.clear();
    }

    /// Updates the correction for all of `V` and `W`.
    pub(super) fn catch_up(&mut self, root: &[f64], v: &Basis, w: &Basis) {
        let mut column = vec![0.0; root.len()];
        for (v, w) in v.columns().iter().zip(w.columns()).skip(self.excess.len()) {
            self.plain(false, root, v, &mut column);
            column.iter_mut().zip(w).for_each(|(column, w)| *column = w - *column);
            self.excess.push_scaled(&column, 1.0);
        }
    }

    /// The mean square of `D^½ (W − P̂ V)` per direction of `V`: what the surrogate, fitted to these products, misses of the product with a
    /// vector of norm 1. The first direction is white, which says nothing of details.
    pub(super) fn missed_square(&self, root: &[f64]) -> f64 {
        let details = self.excess.columns().get(1..).unwrap_or_default();
        let square = |column: &Vec<f64>| column.iter().zip(root).map(|(e, s)| (e * s).powi(2)).sum::<f64>();
        details.iter().map(square).sum::<f64>() / details.len().max(1) as f64
    }

    /// `out ← P̂ u`, or `P̂ᵀ u`.
    fn plain(&self, transposed: bool, root: &[f64], u: &[f64], out: &mut [f64]) {
        let scaled: Vec<f64> = u.iter().zip(root).map(|(u, s)| u / s).collect();
        let mut image = vec![0.0; u.len()];
        match transposed {
            true => self.surrogate.apply_adjoint(&scaled, &mut image),
            false => self.surrogate.apply(&scaled, &mut image),
        }
        update2(out, &image, root, |_, image, s| image / s);
    }

    /// `out ← (P̂ + (W − P̂ V) Vᵀ) u`, or its transpose.
    pub(super) fn apply(&self, transposed: bool, root: &[f64], v: &Basis, u: &[f64], out: &mut [f64]) {
        self.plain(transposed, root, u, out);
        let (from, to) = if transposed { (&self.excess, v) } else { (v, &self.excess) };
        let shares = from.dots(0, u);
        to.accumulate(0, &shares, 1.0, out);
    }
}
