//! A stochastic estimate of the diagonal, which is the direct image of a coaxial rig.

use super::probe::{at_least, each_product, signs, square};
use crate::error::Result;
use crate::operator::Operator;

/// An estimate of a diagonal.
#[derive(Clone, Debug)]
pub struct DiagonalEstimate {
    /// The unbiased estimates of `A_ii` (`n` values).
    pub values: Vec<f64>,
    /// The standard error of each, from the spread of the samples (`n`).
    pub standard_errors: Vec<f64>,
    /// The number of products taken.
    pub products: usize,
}

/// The diagonal of `A` (`n × n`) as the mean of `ω ∘ Aω` over `products ≥ 2` vectors `ω` of random signs.
///
/// Entry `i` of a sample has the variance `Σ_{j≠i} A_ij²`: exact for a diagonal `A`, and for a transport
/// matrix good where much of the light is direct. The standard error falls as `1/√products`.
///
/// # Errors
/// As [`hutchinson`](super::hutchinson).
///
/// # References
/// Bekas, Kokiopoulou and Saad, *An estimator for the diagonal of a matrix* (2007),
/// doi:10.1016/j.apnum.2007.01.003.
pub fn diagonal(operator: &mut dyn Operator, products: usize, seed: u64) -> Result<DiagonalEstimate> {
    let n = square(operator)?;
    at_least(products, 2, "--photos")?;
    let (mut mean, mut squares) = (vec![0.0; n], vec![0.0; n]);
    let mut taken = 0.0;
    each_product(operator, &signs(n, products, seed), |probe, photo| {
        taken += 1.0;
        // Welford's update, doi:10.1080/00401706.1962.10490022: no cancellation where the diagonal is large.
        for (i, (sign, value)) in probe.iter().zip(&photo).enumerate() {
            let sample = sign * value;
            let before = sample - mean[i];
            mean[i] += before / taken;
            squares[i] += before * (sample - mean[i]);
        }
    })?;
    let degrees = (products * (products - 1)) as f64;
    let standard_errors = squares.iter().map(|square| (square / degrees).sqrt()).collect();
    Ok(DiagonalEstimate { values: mean, standard_errors, products })
}
