//! Random probes, products with them, and means with standard errors.

use super::super::basis::{Basis, norm};
use super::super::orthogonalize::orthogonalize;
use super::super::start::Start;
use crate::error::{Error, Result};
use crate::operator::{self, Adjoint, Operator, block, block_mut};

/// A mean of independent random estimates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The estimate, which is unbiased.
    pub value: f64,
    /// Its standard error, from the spread of the single estimates.
    pub standard_error: f64,
    /// The number of products taken.
    pub products: usize,
}

impl Estimate {
    /// The mean of `samples`, at least two.
    pub(super) fn of(samples: &[f64], products: usize) -> Self {
        let count = samples.len() as f64;
        let value = samples.iter().sum::<f64>() / count;
        let squares: f64 = samples.iter().map(|sample| (sample - value).powi(2)).sum();
        Self { value, standard_error: (squares / (count - 1.0) / count).sqrt(), products }
    }
}

/// The options of a low-rank approximation, which fix its cost.
#[derive(Clone, Debug)]
pub struct LowRankOptions {
    /// Singular values wanted, `k ≥ 1`. Default 10.
    pub rank: usize,
    /// Vectors beyond the rank in the sketch, `l = k + oversampling`. Default 10.
    pub oversampling: usize,
    /// Rounds `A Aᵀ` of subspace iteration, `q`, for singular values that decay slowly.
    /// Default 0.
    pub power: usize,
    /// Products spent on the error estimate, at least 2. Default 4.
    pub probes: usize,
    /// Seed of the random vectors.
    pub seed: u64,
}

impl Default for LowRankOptions {
    fn default() -> Self {
        Self { rank: 10, oversampling: 10, power: 0, probes: 4, seed: 0 }
    }
}

impl LowRankOptions {
    /// Checks the options, and the sketch's width `l ≤ n`.
    pub(super) fn width(&self, n: usize) -> Result<usize> {
        at_least(self.rank, 1, "rank")?;
        at_least(self.probes, 2, "--probes")?;
        Ok((self.rank + self.oversampling).min(n))
    }
}

pub(super) fn at_least(value: usize, least: usize, option: &str) -> Result<()> {
    if value >= least {
        return Ok(());
    }
    Err(Error::Option {
        option: option.into(),
        fault: format!("{value} is too few"),
        help: format!("give at least {least}"),
    })
}

pub(super) fn square(operator: &dyn Operator) -> Result<usize> {
    let (rows, n) = (operator.rows(), operator.cols());
    if rows == n {
        return Ok(n);
    }
    Err(Error::Dimension {
        what: "the operator of an estimator",
        expected: format!("{n}x{n}"),
        found: format!("{rows}x{n}"),
    })
}

/// `count` vectors of `n` random signs.
pub(super) fn signs(n: usize, count: usize, seed: u64) -> Vec<Vec<f64>> {
    Start::Rademacher { seed }.block(n, count)
}

/// Hands `with` each of `xs` and its product `A x`, checked for NaN, in order.
pub(super) fn each_product(
    operator: &mut dyn Operator,
    xs: &[Vec<f64>],
    mut with: impl FnMut(&[f64], Vec<f64>),
) -> Result<()> {
    operator::each_product(operator, xs.iter().cloned(), |x, y| {
        with(x, finite(y)?);
        Ok(())
    })
}

/// `A x` for each of `xs`, checked for NaN.
pub(super) fn products(operator: &mut dyn Operator, xs: &[Vec<f64>]) -> Result<Vec<Vec<f64>>> {
    let mut ys = Vec::with_capacity(xs.len());
    each_product(operator, xs, |_, y| ys.push(y))?;
    Ok(ys)
}

/// `Aᵀ y` for each of `ys`, checked for NaN.
pub(super) fn adjoint_products(operator: &mut dyn Adjoint, ys: &[Vec<f64>]) -> Result<Vec<Vec<f64>>> {
    let (cols, size) = (operator.cols(), operator.block_size().max(1));
    let mut xs = Vec::with_capacity(ys.len());
    for ys in ys.chunks(size) {
        let mut products = vec![vec![0.0; cols]; ys.len()];
        operator.apply_adjoint_block(&block(ys), &mut block_mut(&mut products))?;
        for x in products {
            xs.push(finite(x)?);
        }
    }
    Ok(xs)
}

fn finite(y: Vec<f64>) -> Result<Vec<f64>> {
    if norm(&y).is_finite() {
        return Ok(y);
    }
    Err(Error::Numerical("a product with the operator holds a NaN or an infinity".into()))
}

/// `Q R = Y`: an orthonormal basis of the span, dependent vectors left out, and for each vector its
/// coefficients on the basis so far.
pub(super) fn orthonormal(vectors: &[Vec<f64>], rows: usize) -> (Basis, Vec<Vec<f64>>) {
    let mut basis = Basis::new(rows);
    let mut coefficients = Vec::with_capacity(vectors.len());
    for vector in vectors {
        let length = norm(vector);
        let mut w = vector.clone();
        let mut removed = orthogonalize(&basis, &mut w);
        // The rest is rounding errors of a sum of `rows` terms.
        if removed.norm > length * f64::EPSILON * (10.0 + (rows as f64).sqrt()) {
            basis.push_scaled(&w, removed.norm);
            removed.coefficients.push(removed.norm);
        }
        coefficients.push(removed.coefficients);
    }
    (basis, coefficients)
}

/// `V s` over all columns.
pub(super) fn combine(basis: &Basis, s: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; basis.rows()];
    basis.accumulate(0, s, 1.0, &mut sum);
    sum
}

#[cfg(test)]
mod tests {
    use super::Estimate;

    /// Deviations of −3, 0 and 3: a variance of 9 with two degrees of freedom, and a third of it for the mean.
    #[test]
    fn an_estimate_is_the_mean_with_its_standard_error() {
        let found = Estimate::of(&[1.0, 4.0, 7.0], 5);
        assert_eq!(found, Estimate { value: 4.0, standard_error: 3.0_f64.sqrt(), products: 5 });
    }
}
