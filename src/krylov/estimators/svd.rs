//! Randomized singular value decomposition.

use faer::Mat;

use super::super::basis::norm;
use super::probe::{
    Estimate, LowRankOptions, adjoint_products, combine, each_product, orthonormal, products, signs,
};
use crate::error::{Error, Result};
use crate::operator::Adjoint;

/// A truncated singular value decomposition, `A ≈ U diag(σ) Wᵀ` for `A` of `rows × cols`.
#[derive(Clone, Debug)]
pub struct RandomizedSvd {
    /// `σ`, descending; at most `rank` of them.
    pub values: Vec<f64>,
    /// `U`: as many orthonormal vectors of length `rows`.
    pub left: Vec<Vec<f64>>,
    /// `W`: as many orthonormal vectors of length `cols`.
    pub right: Vec<Vec<f64>>,
    /// An estimate of `‖A − Q QᵀA‖_F²`, the squared Frobenius norm of the part of `A` outside the whole
    /// sketch (`l` vectors).
    pub missed_square: Estimate,
    /// Products with `A` and with `Aᵀ` in all.
    pub products: usize,
}

/// The leading singular values and vectors of `A` (`rows × cols`) by a random sketch: `Q` an orthonormal
/// basis of `(A Aᵀ)^q A Ω` for `l` vectors of random signs, then the small decomposition of `QᵀA`.
///
/// The expected error is that of the best rank-`k` approximation times a factor near 1 where the singular
/// values decay; where they do not, a round of subspace iteration (`power`) costs `2 l` products. Each round
/// is orthonormalized.
///
/// Inputs: `A`; [`LowRankOptions`] for the rank `k`, the sketch `l = k + oversampling`, `q` and the probes.
/// Takes `2 (q + 1) l + probes` products (less where the sketch is rank-deficient).
///
/// # Errors
/// [`Error::Option`] naming `--rank` or `--probes`; [`Error::Numerical`] for NaN; whatever the product fails
/// with.
///
/// # References
/// Halko, Martinsson and Tropp, *Finding structure with randomness* (2011), doi:10.1137/090771806.
pub fn randomized_svd(operator: &mut dyn Adjoint, options: &LowRankOptions) -> Result<RandomizedSvd> {
    let (rows, cols) = (operator.rows(), operator.cols());
    let width = options.width(rows.min(cols))?;
    let mut probes = signs(cols, width + options.probes, options.seed);
    let tests = probes.split_off(width);
    let mut sketch = products(operator, &probes)?;
    let mut taken = sketch.len();
    let (mut basis, _) = orthonormal(&sketch, rows);
    for _ in 0..options.power {
        let back = adjoint_products(operator, basis.columns())?;
        let (co, _) = orthonormal(&back, cols);
        sketch = products(operator, co.columns())?;
        taken += back.len() + sketch.len();
        basis = orthonormal(&sketch, rows).0;
    }
    // B = QᵀA, its rows as vectors; B = Rᵀ Pᵀ with AᵀQ = P R.
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
