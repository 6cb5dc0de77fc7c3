//! The interface of the three factorizations.

use super::ritz::{RitzPair, Which, symmetric};
use super::{Expansion, Step};
use crate::error::Result;
use crate::operator::Operator;

/// A factorization that takes one product a step; eigenpairs are computed from it without any further
/// product.
///
/// It can be stopped, inspected, saved and resumed after any step. When a product fails, it is as before, to
/// the bit, and the step can be taken again.
pub trait Factorization {
    /// Basis, coefficients and counts.
    fn expansion(&self) -> &Expansion;

    /// As [`Factorization::expansion`], to allocate memory ([`Expansion::reserve`]).
    fn expansion_mut(&mut self) -> &mut Expansion;

    /// One step: one product with `operator` (`n × n`), which must be the same from step to step.
    ///
    /// # Errors
    /// [`Error::Dimension`](crate::Error::Dimension) when the operator is not `n × n`.
    /// [`Error::Numerical`](crate::Error::Numerical) when it is not declared symmetric and has to be (no
    /// product is taken then), or when the product contains NaN or an infinity. The error of the product.
    /// After any error the factorization is as it was before the step.
    fn expand(&mut self, operator: &mut dyn Operator) -> Result<Step>;

    /// Takes up to `most` of the products that come next as one block, of [`Operator::block_size`]; the
    /// following steps use them. Nothing is taken where that size is 1, where only one vector waits, or where
    /// such products are left. For a caller that will take these steps for certain; whether it is called
    /// changes no result. Products taken before their step do not count in [`Factorization::products`] yet,
    /// and are not saved.
    ///
    /// # Errors
    /// As [`Factorization::expand`]; the factorization is then as it was before.
    fn multiply_block(&mut self, operator: &mut dyn Operator, most: usize) -> Result<()> {
        self.expansion_mut().multiply_block(operator, most)
    }

    /// The `min(count, m)` most wanted Ritz pairs, the most wanted first. By default those of a symmetric
    /// operator.
    ///
    /// # Errors
    /// [`Error::Numerical`](crate::Error::Numerical) when the dense eigensolver fails on `H`.
    /// [`Error::Option`](crate::Error::Option) naming `--which` where this factorization cannot find that end
    /// of the spectrum.
    fn ritz(&self, which: Which, count: usize) -> Result<Vec<RitzPair>> {
        symmetric::ritz(self.expansion(), which, count)
    }

    /// Thick restart: shrinks the subspace to the `keep` most wanted Ritz vectors, without a product; the
    /// process continues from there (Wu and Simon, doi:10.1137/S0895479898334605). Does nothing for
    /// `keep ≥ m`.
    ///
    /// # Errors
    /// As [`Factorization::ritz`]; [`Error::Numerical`](crate::Error::Numerical) where restarts are not
    /// supported.
    fn shrink(&mut self, which: Which, keep: usize) -> Result<()> {
        symmetric::shrink(self.expansion_mut(), which, keep)
    }

    /// The dimension of the space.
    fn n(&self) -> usize {
        self.expansion().n()
    }

    /// The dimension `m` of the subspace; without restarts the number of steps done.
    fn steps(&self) -> usize {
        self.expansion().steps()
    }

    /// The number of products, one a step.
    fn products(&self) -> usize {
        self.expansion().products()
    }

    /// Whether the subspace is the whole space without the known vectors; further steps then take no product.
    fn is_exhausted(&self) -> bool {
        self.expansion().pending() == 0
    }

    /// `V`: `m` orthonormal vectors of length `n`.
    fn basis(&self) -> &[Vec<f64>] {
        self.expansion().basis()
    }

    /// `Q`: the known vectors, made orthonormal.
    fn known(&self) -> &[Vec<f64>] {
        self.expansion().known()
    }

    /// The largest `‖A v_j‖` so far, a lower bound of `‖A‖₂`.
    fn scale(&self) -> f64 {
        self.expansion().scale()
    }

    /// See [`Expansion::asymmetry`].
    fn asymmetry(&self) -> f64 {
        self.expansion().asymmetry()
    }

    /// The real Ritz vector `y = V s` of a pair from this factorization: length `n`, norm 1, and the entry of
    /// largest magnitude positive. For a complex pair, the real part without a change of sign.
    fn ritz_vector(&self, pair: &RitzPair) -> Vec<f64> {
        let mut vector = self.expansion().combine(&pair.coefficients);
        if pair.is_real() {
            point_upwards(&mut vector);
        }
        vector
    }

    /// The imaginary part of a Ritz vector (length `n`): zero for a real pair.
    fn ritz_vector_imaginary(&self, pair: &RitzPair) -> Vec<f64> {
        self.expansion().combine(&pair.imaginary_coefficients)
    }
}

/// Makes the entry of largest magnitude positive. Returns whether that changed the signs.
pub(in super::super) fn point_upwards(vector: &mut [f64]) -> bool {
    let largest = vector.iter().fold(0.0_f64, |a, &b| if b.abs() > a.abs() { b } else { a });
    if largest < 0.0 {
        for value in vector {
            *value = -*value;
        }
    }
    largest < 0.0
}
