//! Randomized estimators that use a few products with random vectors: low-rank approximations, traces and the diagonal.
//!
//! Every estimator takes a seed and a number of products that is known in advance, and returns an error estimate. The vectors depend only
//! on the seed, so a journal of products repeats the same result after a failure.
//!
//! | estimator | products | needs |
//! |---|---|---|
//! | [`randomized_svd`] | `2 (q + 1) l + probes` | `A v` and `Aᵀ u` |
//! | [`hutchinson`] | `m` | `A v` |
//! | [`hutch_plus_plus`] | `2 ⌊m/3⌋ + (m − 2 ⌊m/3⌋)` | `A v` |
//! | [`diagonal()`] | `m` | `A v` |

use faer::Mat;

use super::basis::{Basis, dot, exceeds_rounding, norm, orthogonalize};
use super::powers::finite_product;
use super::start::Start;
use crate::error::{Error, Result};
use crate::operator;
use crate::operator::{Adjoint, Operator, block, block_mut, check_square};

/// A mean of independent random estimates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The estimate, which is unbiased.
    pub value: f64,
    /// The standard error of the estimate, from the spread of the samples.
    pub standard_error: f64,
    /// The number of products taken.
    pub products: usize,
}

impl Estimate {
    /// Computes the mean of `samples`, at least two.
    fn of(samples: &[f64], products: usize) -> Self {
        let count = samples.len() as f64;
        let value = samples.iter().sum::<f64>() / count;
        let squares: f64 = samples.iter().map(|sample| (sample - value).powi(2)).sum();
        Self { value, standard_error: (squares / (count - 1.0) / count).sqrt(), products }
    }
}

/// The options of a low-rank approximation. They determine its number of products.
#[derive(Clone, Debug)]
pub struct LowRankOptions {
    /// The number of singular values, `k ≥ 1`. Default 10.
    pub rank: usize,
    /// The number of vectors beyond the rank in the sketch, `l = k + oversampling`. Default 10.
    pub oversampling: usize,
    /// `q`, the number of rounds of subspace iteration. A round multiplies by `A Aᵀ`. More rounds help if singular values decay slowly.
    /// Default 0.
    pub power: usize,
    /// The number of products for the error estimate, at least 2. Default 4.
    pub probes: usize,
    /// The seed of the random vectors.
    pub seed: u64,
}

impl Default for LowRankOptions {
    fn default() -> Self {
        Self { rank: 10, oversampling: 10, power: 0, probes: 4, seed: 0 }
    }
}

impl LowRankOptions {
    /// Checks the options, and returns the width of the sketch, `l ≤ n`.
    fn width(&self, n: usize) -> Result<usize> {
        at_least(self.rank, 1, "rank")?;
        at_least(self.probes, 2, "--probes")?;
        Ok((self.rank + self.oversampling).min(n))
    }
}

fn at_least(value: usize, least: usize, option: &str) -> Result<()> {
    if value >= least {
        return Ok(());
    }
    Err(Error::option(option, format!("{value} is too few")).help(format!("give at least {least}")))
}

fn square(operator: &dyn Operator) -> Result<usize> {
    check_square("the operator of an estimator", operator.cols(), operator)?;
    Ok(operator.cols())
}

/// `count` vectors of `n` random signs.
fn signs(n: usize, count: usize, seed: u64) -> Vec<Vec<f64>> {
    Start::Rademacher { seed }.block(n, count)
}

/// Calls `with` for each of `xs` and its product `A x`, in order. Products are checked for NaN.
fn each_product(
    operator: &mut dyn Operator,
    xs: &[Vec<f64>],
    mut with: impl FnMut(&[f64], Vec<f64>),
) -> Result<()> {
    operator::each_product(operator, xs.iter().cloned(), |x, y| {
        finite_product(&y)?;
        with(x, y);
        Ok(())
    })
}

/// `A x` for each of `xs`. Products are checked for NaN.
fn products_with(operator: &mut dyn Operator, xs: &[Vec<f64>]) -> Result<Vec<Vec<f64>>> {
    let mut ys = Vec::with_capacity(xs.len());
    each_product(operator, xs, |_, y| ys.push(y))?;
    Ok(ys)
}

/// `Aᵀ y` for each of `ys`. Products are checked for NaN.
fn adjoint_products(operator: &mut dyn Adjoint, ys: &[Vec<f64>]) -> Result<Vec<Vec<f64>>> {
    let size = operator.block_size().max(1);
    let mut xs = vec![vec![0.0; operator.cols()]; ys.len()];
    for (xs, ys) in xs.chunks_mut(size).zip(ys.chunks(size)) {
        operator.apply_adjoint_block(&block(ys), &mut block_mut(xs))?;
        xs.iter().try_for_each(|x| finite_product(x).map(|_| ()))?;
    }
    Ok(xs)
}

/// Factors `Y = Q R`, where `Y` holds the vectors. Returns `Q`, to which dependent vectors add nothing, and each vector's coefficients on
/// the basis vectors so far.
fn orthonormal(vectors: &[Vec<f64>], rows: usize) -> (Basis, Vec<Vec<f64>>) {
    let mut basis = Basis::new(rows);
    let mut coefficients = Vec::with_capacity(vectors.len());
    for vector in vectors {
        let length = norm(vector);
        let mut w = vector.clone();
        let mut removed = orthogonalize(&basis, &mut w);
        if exceeds_rounding(removed.norm, length, rows) {
            basis.push_scaled(&w, removed.norm);
            removed.coefficients.push(removed.norm);
        }
        coefficients.push(removed.coefficients);
    }
    (basis, coefficients)
}

fn combine(basis: &Basis, s: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; basis.rows()];
    basis.accumulate(0, s, 1.0, &mut sum);
    sum
}

/// Estimates `tr A` for `A` of `n × n` as the mean of `ωᵀAω` over `products ≥ 2` vectors `ω` of random signs.
///
/// The estimate is unbiased. The variance of one sample is `2 Σ_{i≠j} ((A_ij + A_ji)/2)²`, so the estimate is
/// exact for a diagonal `A`. The standard error falls as `1/√products`.
///
/// References: Hutchinson, *A stochastic estimator of the trace of the influence matrix* (1989), doi:10.1080/03610918908812806.
///
/// # Errors
/// [`Error::Option`] naming `--photos`; [`Error::Dimension`] if `A` is not square; [`Error::Numerical`] for NaN; the error of a product.
pub fn hutchinson(operator: &mut dyn Operator, products: usize, seed: u64) -> Result<Estimate> {
    let n = square(operator)?;
    at_least(products, 2, "--photos")?;
    let mut samples = Vec::with_capacity(products);
    each_product(operator, &signs(n, products, seed), |probe, photo| samples.push(dot(probe, &photo)))?;
    Ok(Estimate::of(&samples, products))
}

/// Estimates `tr A` for `A` of `n × n` by Hutch++, from `products ≥ 6` products.
///
/// A third of the products gives `A S`, where `S` holds vectors of random signs. For an orthonormal basis `Q` of `A S`,
/// `tr A = tr QᵀAQ + tr (I − QQᵀ) A (I − QQᵀ)`. Another third of the products gives the first term exactly. The remaining products give
/// Hutchinson's estimate of the second term, whose standard error is the standard error of the result. For a positive semidefinite `A` the
/// relative error falls as `1/products`, against `1/√products` for Hutchinson's estimate alone. The estimate is unbiased for any `A`. Fails
/// with the errors of [`hutchinson`].
///
/// References: Meyer, Musco, Musco and Woodruff, *Hutch++: optimal stochastic trace estimation* (2021), doi:10.1137/1.9781611976496.16.
pub fn hutch_plus_plus(operator: &mut dyn Operator, products: usize, seed: u64) -> Result<Estimate> {
    let n = square(operator)?;
    at_least(products, 6, "--photos")?;
    let third = (products / 3).min(n);
    let mut probes = signs(n, products, seed);
    let mut rest = probes.split_off(third);
    let (basis, _) = orthonormal(&products_with(operator, &probes)?, n);
    let mut exact = 0.0;
    each_product(operator, basis.columns(), |column, photo| exact += dot(column, &photo))?;
    // A sketch of lower rank needs fewer products for the first term. The second term uses the remaining products.
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

/// An estimate of a diagonal.
#[derive(Clone, Debug)]
pub struct DiagonalEstimate {
    /// The unbiased estimates of `A_ii` (`n` values).
    pub values: Vec<f64>,
    /// The standard error of each value, from the spread of the samples (`n` values).
    pub standard_errors: Vec<f64>,
    /// The number of products taken.
    pub products: usize,
}

/// Estimates the diagonal of `A` (`n × n`) as the mean of `ω ∘ Aω` over `products ≥ 2` vectors `ω` of random signs.
///
/// Entry `i` of a sample has the variance `Σ_{j≠i} A_ij²`. The estimate is therefore exact for a diagonal `A`, and good for a transport
/// matrix with mostly direct light. The standard error falls as `1/√products`. Fails with the errors of [`hutchinson`].
///
/// References: Bekas, Kokiopoulou and Saad, *An estimator for the diagonal of a matrix* (2007), doi:10.1016/j.apnum.2007.01.003.
pub fn diagonal(operator: &mut dyn Operator, products: usize, seed: u64) -> Result<DiagonalEstimate> {
    let n = square(operator)?;
    at_least(products, 2, "--photos")?;
    let (mut mean, mut squares) = (vec![0.0; n], vec![0.0; n]);
    let mut taken = 0.0;
    each_product(operator, &signs(n, products, seed), |probe, photo| {
        taken += 1.0;
        // Welford's update, doi:10.1080/00401706.1962.10490022, avoids cancellation where the diagonal is large.
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

/// A truncated singular value decomposition, `A ≈ U diag(σ) Wᵀ` for `A` of `rows × cols`.
#[derive(Clone, Debug)]
pub struct RandomizedSvd {
    /// `σ`, descending; at most `rank` values.
    pub values: Vec<f64>,
    /// `U`: one orthonormal vector of length `rows` for each value.
    pub left: Vec<Vec<f64>>,
    /// `W`: one orthonormal vector of length `cols` for each value.
    pub right: Vec<Vec<f64>>,
    /// An estimate of `‖A − Q QᵀA‖_F²`, the squared Frobenius norm of the part of `A` outside the whole sketch (`l` vectors).
    pub missed_square: Estimate,
    /// The number of products with `A` and `Aᵀ` together.
    pub products: usize,
}

/// Computes the leading singular values and vectors of `A` (`rows × cols`) from a random sketch. `Q` is an orthonormal basis of
/// `(A Aᵀ)^q A Ω`, where the columns of `Ω` are `l` vectors of random signs. A small decomposition of `QᵀA` follows.
///
/// If the singular values decay, the expected error is the error of the best rank-`k` approximation times a factor near 1. Otherwise, a
/// round of subspace iteration (`power`) helps and costs `2 l` products. The vectors are orthonormalized in each round.
///
/// [`LowRankOptions`] gives the rank `k`, the width `l = k + oversampling` of the sketch, `q` and the number of probes. The function takes
/// `2 (q + 1) l + probes` products (fewer if the sketch is rank-deficient).
///
/// References: Halko, Martinsson and Tropp, *Finding structure with randomness* (2011), doi:10.1137/090771806.
///
/// # Errors
/// [`Error::Option`] naming `--rank` or `--probes`; [`Error::Numerical`] for NaN; the error of a product.
pub fn randomized_svd(operator: &mut dyn Adjoint, options: &LowRankOptions) -> Result<RandomizedSvd> {
    let (rows, cols) = (operator.rows(), operator.cols());
    let width = options.width(rows.min(cols))?;
    let mut probes = signs(cols, width + options.probes, options.seed);
    let tests = probes.split_off(width);
    let mut sketch = products_with(operator, &probes)?;
    let mut taken = sketch.len();
    let (mut basis, _) = orthonormal(&sketch, rows);
    for _ in 0..options.power {
        let back = adjoint_products(operator, basis.columns())?;
        let (co, _) = orthonormal(&back, cols);
        sketch = products_with(operator, co.columns())?;
        taken += back.len() + sketch.len();
        basis = orthonormal(&sketch, rows).0;
    }
    // These vectors are the rows of B = QᵀA. If AᵀQ = P R, then B = Rᵀ Pᵀ.
    let rows_of_b = adjoint_products(operator, basis.columns())?;
    taken += rows_of_b.len();
    let (co, factor) = orthonormal(&rows_of_b, cols);
    let small = Mat::from_fn(basis.len(), co.len(), |i, j| factor[i].get(j).copied().unwrap_or(0.0));
    let rank = options.rank.min(co.len());
    let (mut values, mut left, mut right) = (Vec::new(), Vec::new(), Vec::new());
    if rank > 0 {
        let svd = small.thin_svd().map_err(|_| {
            Error::Numerical("the dense singular value decomposition of a sketch failed".into())
        })?;
        for k in 0..rank {
            values.push(svd.S().column_vector()[k]);
            left.push(combine(&basis, &svd.U().col(k).iter().copied().collect::<Vec<f64>>()));
            right.push(combine(&co, &svd.V().col(k).iter().copied().collect::<Vec<f64>>()));
        }
    }
    let mut missed = Vec::with_capacity(tests.len());
    each_product(operator, &tests, |_, mut rest| {
        let shares = basis.dots(0, &rest);
        basis.accumulate(0, &shares, -1.0, &mut rest);
        missed.push(norm(&rest).powi(2));
    })?;
    let missed_square = Estimate::of(&missed, missed.len());
    taken += missed.len();
    Ok(RandomizedSvd { values, left, right, missed_square, products: taken })
}

#[cfg(test)]
mod tests {
    use super::Estimate;

    /// Deviations of −3, 0 and 3 have a variance of 9 with two degrees of freedom. The variance of the mean is a third of this variance.
    #[test]
    fn an_estimate_is_the_mean_with_its_standard_error() {
        let found = Estimate::of(&[1.0, 4.0, 7.0], 5);
        assert_eq!(found, Estimate { value: 4.0, standard_error: 3.0_f64.sqrt(), products: 5 });
    }
}
