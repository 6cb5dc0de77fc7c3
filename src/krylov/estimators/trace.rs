//! Stochastic estimates of the trace.

use super::super::basis::dot;
use super::probe::{self, Estimate, at_least, each_product, orthonormal, signs, square};
use crate::error::Result;
use crate::operator::Operator;

/// `tr A` as the mean of `ωᵀAω` over `products ≥ 2` vectors `ω` of random signs; `A` of `n × n`.
///
/// The estimate is unbiased. The variance of one sample is `2 Σ_{i≠j} ((A_ij + A_ji)/2)²`, so that it is
/// exact for a diagonal `A`. The standard error falls as `1/√products`.
///
/// # Errors
/// [`Error::Option`](crate::Error::Option) naming `--photos`; [`Error::Dimension`](crate::Error::Dimension)
/// when `A` is not square; [`Error::Numerical`](crate::Error::Numerical) for NaN; whatever the product fails
/// with.
///
/// # References
/// Hutchinson, *A stochastic estimator of the trace of the influence matrix* (1989),
/// doi:10.1080/03610918908812806.
pub fn hutchinson(operator: &mut dyn Operator, products: usize, seed: u64) -> Result<Estimate> {
    let n = square(operator)?;
    at_least(products, 2, "--photos")?;
    let mut samples = Vec::with_capacity(products);
    each_product(operator, &signs(n, products, seed), |probe, photo| samples.push(dot(probe, &photo)))?;
    Ok(Estimate::of(&samples, products))
}

/// `tr A` by Hutch++, from `products ≥ 6` products; `A` of `n × n`.
///
/// With `Q` an orthonormal basis of `A S` for a third of the products,
/// `tr A = tr QᵀAQ + tr (I − QQᵀ) A (I − QQᵀ)`: the first part is exact at another third, the second is
/// Hutchinson's with the rest. For a positive semidefinite `A` the relative error falls as `1/products`,
/// against `1/√products`; it is without bias for any `A`. The standard error is that of the second part.
///
/// # Errors
/// As [`hutchinson`].
///
/// # References
/// Meyer, Musco, Musco and Woodruff, *Hutch++: optimal stochastic trace estimation* (2021),
/// doi:10.1137/1.9781611976496.16.
pub fn hutch_plus_plus(operator: &mut dyn Operator, products: usize, seed: u64) -> Result<Estimate> {
    let n = square(operator)?;
    at_least(products, 6, "--photos")?;
    let third = (products / 3).min(n);
    let mut probes = signs(n, products, seed);
    let mut rest = probes.split_off(third);
    let (basis, _) = orthonormal(&probe::products(operator, &probes)?, n);
    let mut exact = 0.0;
    each_product(operator, basis.columns(), |column, photo| exact += dot(column, &photo))?;
    // A sketch of lower rank leaves products over: they go to the rest.
    let budget = products - third - basis.len();
    rest.truncate(budget);
    for probe in &mut rest {
        let shares = basis.dots(0, probe);
        basis.accumulate(0, &shares, -1.0, probe);
    }
    let mut samples = Vec::with_capacity(budget);
    each_product(operator, &rest, |probe, photo| samples.push(dot(probe, &photo)))?;
    let mut estimate = Estimate::of(&samples, products);
    estimate.value += exact;
    Ok(estimate)
}
