//! Krylov factorizations `A V = V⁺ H`, the source of eigenpairs.

mod expansion;
mod processes;
mod ritz;
mod save;
mod step;

use std::sync::Arc;

use ritz::{ritz_of_symmetric, shrink_symmetric};

use crate::error::Result;
use crate::operator::Operator;

pub use expansion::Expansion;
pub use processes::{Arnoldi, BlockLanczos, Lanczos};
pub use ritz::{PairStatus, RitzPair, Which, temple_kato};
pub use step::Step;

/// A factorization that takes one product per step. Its eigenpairs need no further product.
///
/// It can be stopped, inspected, saved and resumed after any step. If a product fails, the factorization is bitwise unchanged, and the step
/// can be taken again.
pub trait Factorization {
    /// Returns basis, coefficients and counts.
    fn expansion(&self) -> &Expansion;

    /// Returns [`Factorization::expansion`] mutably, to allocate memory ([`Expansion::reserve`]).
    fn expansion_mut(&mut self) -> &mut Expansion;

    /// Takes one step: one product with `operator` (`n × n`). The operator must be the same in every step.
    ///
    /// # Errors
    /// [`Error::Dimension`](crate::Error::Dimension) if the operator is not `n × n`. [`Error::Numerical`](crate::Error::Numerical) if the
    /// process needs a symmetric operator and this one is not declared symmetric (no product is taken then), or if the product contains NaN
    /// or an infinity. The error of the product. After any error the factorization is as it was before the step.
    fn expand(&mut self, operator: &mut dyn Operator) -> Result<Step>;

    /// Takes up to `most` of the next products as one block, of [`Operator::block_size`]; the following steps use them. It takes nothing if
    /// that size is 1, if only one vector waits, or if such products are left. The caller must be certain to take these steps; the call
    /// does not change the results. Products taken before their step do not count in [`Factorization::products`] yet, and are not saved.
    ///
    /// # Errors
    /// The errors of [`Factorization::expand`]; the factorization is then unchanged.
    fn multiply_block(&mut self, operator: &mut dyn Operator, most: usize) -> Result<()> {
        self.expansion_mut().multiply_block(operator, most)
    }

    /// Computes the `min(count, m)` most wanted Ritz pairs, the most wanted first. The default computes the pairs of a symmetric operator.
    ///
    /// # Errors
    /// [`Error::Numerical`](crate::Error::Numerical) if the dense eigensolver fails on `H`. [`Error::Option`](crate::Error::Option) naming
    /// `--which` if this factorization cannot find that end of the spectrum.
    fn ritz(&self, which: Which, count: usize) -> Result<Vec<RitzPair>> {
        ritz_of_symmetric(self.expansion(), which, count)
    }

    /// Thick restart: shrinks the subspace to the `keep` most wanted Ritz vectors without a product, and the process continues from there
    /// (Wu and Simon, doi:10.1137/S0895479898334605). Does nothing for `keep ≥ m`.
    ///
    /// # Errors
    /// The errors of [`Factorization::ritz`]; [`Error::Numerical`](crate::Error::Numerical) if restarts are not supported.
    fn shrink(&mut self, which: Which, keep: usize) -> Result<()> {
        shrink_symmetric(self.expansion_mut(), which, keep)
    }

    /// The dimension of the space.
    fn n(&self) -> usize {
        self.expansion().n()
    }

    /// The dimension `m` of the subspace; without restarts, the number of steps done.
    fn steps(&self) -> usize {
        self.expansion().steps()
    }

    /// The number of products, one per step.
    fn products(&self) -> usize {
        self.expansion().products()
    }

    /// Returns true if the subspace is the whole space without the known vectors. Further steps then take no product.
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

    /// The real Ritz vector `y = V s` of a pair from this factorization: length `n`, norm 1, and the entry of largest magnitude positive.
    /// For a complex pair it is the real part, with its sign unchanged.
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

/// Makes the entry of largest magnitude positive. Returns true if the signs changed.
pub(super) fn point_upwards(vector: &mut [f64]) -> bool {
    let largest = vector.iter().fold(0.0_f64, |a, &b| if b.abs() > a.abs() { b } else { a });
    if largest < 0.0 {
        for value in vector {
            *value = -*value;
        }
    }
    largest < 0.0
}

/// A function of the remainder of a product and of the share of noise in it; see [`Filter::new`].
type Of = dyn Fn(&[f64], f64) -> Option<Vec<f64>> + Send + Sync;

/// Removes noise from the next direction of a Krylov process.
///
/// The next direction is the part that a product adds to the span. If it is mostly noise, the process continues into noise and finds
/// nothing. A filter knows how noise looks, and returns a direction with most of it removed. Eigenvalues are not distorted: they come from
/// the products themselves, projected on the directions of the process.
#[derive(Clone)]
pub struct Filter(Arc<Of>);

impl Filter {
    /// Makes a filter from a function. The function receives the remainder of a product, of length `n`, and the expected share of noise in
    /// its norm, from 0 to 1. It returns the direction of length `n` for the next step; `None` keeps the remainder.
    pub fn new(of: impl Fn(&[f64], f64) -> Option<Vec<f64>> + Send + Sync + 'static) -> Self {
        Self(Arc::new(of))
    }

    /// Returns the direction for the next step.
    pub fn apply(&self, rest: &[f64], share: f64) -> Option<Vec<f64>> {
        (self.0)(rest, share)
    }
}

impl std::fmt::Debug for Filter {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("Filter")
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    use super::*;
    use crate::krylov::{BlockLanczos, Factorization, Which, dot, norm};
    use crate::operator::Symmetry;

    /// `Σ λ_k u_k u_kᵀ` with three slow waves; each product has noise of norm about 0.5.
    struct Noisy {
        random: Pcg64,
    }

    const N: usize = 400;

    /// A wave with `periods` half periods, of norm 1.
    fn wave(periods: usize) -> Vec<f64> {
        let at = |i: usize| (std::f64::consts::PI * periods as f64 * (i as f64 + 0.5) / N as f64).cos();
        let wave: Vec<f64> = (0..N).map(at).collect();
        let length = norm(&wave);
        wave.into_iter().map(|value| value / length).collect()
    }

    impl Operator for Noisy {
        fn rows(&self) -> usize {
            N
        }

        fn cols(&self) -> usize {
            N
        }

        fn symmetry(&self) -> Symmetry {
            Symmetry::Symmetric
        }

        fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
            y.fill(0.0);
            for (periods, value) in [(1, 1.0), (2, 0.9), (3, 0.5)] {
                let wave = wave(periods);
                let along = value * dot(&wave, x);
                y.iter_mut().zip(&wave).for_each(|(y, wave)| *y += along * wave);
            }
            let noise = crate::krylov::start::gaussian(N, &mut self.random);
            let scale = 0.5 / (N as f64).sqrt();
            y.iter_mut().zip(&noise).for_each(|(y, noise)| *y += scale * noise);
            Ok(())
        }

        fn standard_errors(&self) -> Vec<f64> {
            vec![0.5]
        }
    }

    /// The part of the slow waves in the span of two Ritz vectors after twelve products.
    fn found(filter: Option<Filter>) -> Result<f64> {
        let start: Vec<f64> = (0..N).map(|i| 1.0 + i as f64 / N as f64 + wave(1)[i] + wave(2)[i]).collect();
        let mut process = BlockLanczos::new(&[start], &[])?;
        if let Some(filter) = filter {
            process = process.filtered(filter);
        }
        let mut operator = Noisy { random: Pcg64::seed_from_u64(4) };
        for _ in 0..12 {
            process.expand(&mut operator)?;
        }
        let pairs = process.ritz(Which::LargestAlgebraic, 2)?;
        let vectors: Vec<Vec<f64>> = pairs.iter().map(|pair| process.ritz_vector(pair)).collect();
        let part = |wave: &[f64]| vectors.iter().map(|v| dot(v, wave).powi(2)).sum::<f64>();
        Ok(part(&wave(1)).min(part(&wave(2))))
    }

    #[test]
    fn a_low_pass_finds_slow_eigenvectors_in_noise() -> Result<()> {
        let low_pass = Filter::new(|rest, share| {
            let mean = |i: usize| {
                let near = &rest[i.saturating_sub(20)..(i + 21).min(N)];
                near.iter().sum::<f64>() / near.len() as f64
            };
            (share > 0.3).then(|| (0..N).map(mean).collect())
        });
        let (with, without) = (found(Some(low_pass))?, found(None)?);
        assert!(with > 0.95 && without < 0.85, "{with} {without}");
        Ok(())
    }
}
