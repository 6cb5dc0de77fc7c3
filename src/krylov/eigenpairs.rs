//! Eigenvalues and eigenvectors from a Lanczos factorization, at no further product.

use faer::{Mat, Side};

use super::lanczos::Lanczos;
use crate::error::{Error, Result};

/// Which end of the spectrum is wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Which {
    /// The largest, +∞ first.
    #[default]
    LargestAlgebraic,
    /// The smallest, −∞ first.
    SmallestAlgebraic,
    /// The largest in absolute value.
    LargestMagnitude,
}

/// A Ritz pair `(θ, y = V s)`: the Rayleigh–Ritz approximation of an eigenpair from the subspace.
#[derive(Clone, Debug, PartialEq)]
pub struct RitzPair {
    /// `θ`, approximating an eigenvalue. There is one within `residual` of it.
    pub value: f64,
    /// `‖A y − θ y‖₂` for `‖y‖ = 1`. For a symmetric operator this is `|β_m s_m|`, known without a product.
    pub residual: f64,
    /// `s`, of length `m` and norm 1.
    pub coefficients: Vec<f64>,
}

impl RitzPair {
    /// Whether `‖A y − θ y‖ ≤ tolerance · scale`, with `scale` of the size of `‖A‖`. By Weyl's bound an eigenvalue is
    /// then that near; the vector is as near as the gap to the other eigenvalues allows (Davis–Kahan).
    pub fn is_resolved(&self, tolerance: f64, scale: f64) -> bool {
        self.residual <= tolerance * scale
    }
}

impl Lanczos {
    /// The `count` Ritz pairs that are wanted most, most wanted first; `min(count, m)` of them.
    ///
    /// # Errors
    /// [`Error::Numerical`] when the dense eigensolver fails on `T`.
    pub fn ritz(&self, which: Which, count: usize) -> Result<Vec<RitzPair>> {
        let m = self.steps();
        if m == 0 || count == 0 {
            return Ok(Vec::new());
        }
        let tridiagonal = Mat::from_fn(m, m, |i, j| match i.abs_diff(j) {
            0 => self.alphas()[i],
            1 => self.betas()[i.min(j)],
            _ => 0.0,
        });
        let decomposition = tridiagonal.self_adjoint_eigen(Side::Lower).map_err(|_| {
            Error::Numerical(format!("the dense eigensolver failed on a {m}x{m} tridiagonal matrix"))
        })?;
        let values: Vec<f64> = decomposition.S().column_vector().iter().copied().collect();
        let vectors = decomposition.U();
        let mut order: Vec<usize> = (0..m).collect();
        // A stable sort: equal values keep the eigensolver's order.
        order.sort_by(|&i, &j| match which {
            Which::LargestAlgebraic => values[j].total_cmp(&values[i]),
            Which::SmallestAlgebraic => values[i].total_cmp(&values[j]),
            Which::LargestMagnitude => values[j].abs().total_cmp(&values[i].abs()),
        });
        Ok(order
            .into_iter()
            .take(count)
            .map(|k| {
                let coefficients: Vec<f64> = vectors.col(k).iter().copied().collect();
                let last = coefficients.last().copied().unwrap_or_default();
                let residual = (self.residual_norm() * last).hypot(self.unmodelled(&coefficients));
                RitzPair { value: values[k], residual, coefficients }
            })
            .collect())
    }

    /// The Ritz vector `y = V s` of a pair from this factorization: length `n`, norm 1, and the entry of largest
    /// magnitude positive.
    pub fn ritz_vector(&self, pair: &RitzPair) -> Vec<f64> {
        let mut vector = vec![0.0; self.n()];
        let count = pair.coefficients.len().min(self.steps());
        self.accumulate_basis(&pair.coefficients[..count], &mut vector);
        let largest = vector.iter().fold(0.0_f64, |a, &b| if b.abs() > a.abs() { b } else { a });
        if largest < 0.0 {
            for value in &mut vector {
                *value = -*value;
            }
        }
        vector
    }
}
