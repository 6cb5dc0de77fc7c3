//! Nyström approximation of a symmetric operator.

use faer::{Mat, Side};

use super::super::basis::{dot, norm};
use super::probe::{
    Estimate, LowRankOptions, combine, each_product, orthonormal, products, signs, symmetric,
};
use crate::error::{Error, Result};
use crate::operator::Operator;

/// Eigenvalues of the core below this share of the largest are left out: they are rounding errors of the
/// products, and would be divided by.
const CUTOFF: f64 = 1e-10;

/// A low-rank approximation `A ≈ U diag(λ) Uᵀ` of a symmetric `A` of `n × n`.
#[derive(Clone, Debug)]
pub struct Nystrom {
    /// `λ`, largest magnitude first; at most `rank` of them.
    pub values: Vec<f64>,
    /// `U`: as many orthonormal vectors of length `n`.
    pub vectors: Vec<Vec<f64>>,
    /// The smallest eigenvalue of the core `ΩᵀAΩ` (with orthonormal `Ω`): clearly below zero means that `A`
    /// is indefinite, and that the approximation may be poor.
    pub smallest_core: f64,
    /// An estimate of `‖A − U diag(λ) Uᵀ‖_F²` for the approximation returned.
    pub missed_square: Estimate,
    /// Products in all.
    pub products: usize,
}

/// `A ≈ (AΩ) (ΩᵀAΩ)⁺ (AΩ)ᵀ` from `l` products with random signs `Ω`, made orthonormal, truncated to rank `k`:
/// half the products of [`randomized_svd`](super::randomized_svd).
///
/// For a positive semidefinite `A`, `A − Â ⪰ 0`, so the trace of `A − Â` is its nuclear norm. For an
/// **indefinite** one the core can be nearly singular while `A` is not, and the error is without a bound:
/// transport matrices are positive semidefinite only up to their global part, so check `smallest_core` and at
/// `missed_square`. Core eigenvalues below 1e-10 of the largest are left out (Nakatsukasa and Park's
/// truncation).
///
/// Inputs: `A`; [`LowRankOptions`] for the rank `k`, the sketch `l = k + oversampling` and the probes. Takes
/// `l + probes` products.
///
/// # Errors
/// [`Error::Option`] naming `--rank` or `--probes`; [`Error::Numerical`] when the operator is not declared
/// symmetric, and for NaN; whatever the product fails with.
///
/// # References
/// Halko, Martinsson and Tropp (2011), section 5.4, doi:10.1137/090771806; Nakatsukasa and Park, *Randomized
/// low-rank approximation for symmetric indefinite matrices* (2023), doi:10.1137/22M1538648.
pub fn nystrom(operator: &mut dyn Operator, options: &LowRankOptions) -> Result<Nystrom> {
    symmetric(operator, "Nyström's approximation")?;
    let n = operator.cols();
    let width = options.width(n)?;
    let mut probes = signs(n, width + options.probes, options.seed);
    let tests = probes.split_off(width);
    let (omega, _) = orthonormal(&probes, n);
    let sketch = products(operator, omega.columns())?;
    let core: Vec<Vec<f64>> = sketch.iter().map(|y| omega.dots(0, y)).collect();
    let l = omega.len();
    let failed =
        |_| Error::Numerical("the dense eigensolver failed on the core of a Nyström approximation".into());
    // Symmetrized: rounding, or noise, makes the two halves differ.
    let core = Mat::from_fn(l, l, |i, j| 0.5 * (core[i][j] + core[j][i]))
        .self_adjoint_eigen(Side::Lower)
        .map_err(failed)?;
    let spectrum: Vec<f64> = core.S().column_vector().iter().copied().collect();
    let largest = spectrum.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let kept: Vec<usize> = (0..l).filter(|&k| spectrum[k].abs() > CUTOFF * largest).collect();

    // (Y W) Λ⁻¹ (Y W)ᵀ = Q (R Λ⁻¹ Rᵀ) Qᵀ.
    let (basis, factor) = orthonormal(&sketch, n);
    let r = Mat::from_fn(basis.len(), l, |i, j| factor[j].get(i).copied().unwrap_or(0.0));
    let rotated = Mat::from_fn(basis.len(), kept.len(), |i, j| {
        (0..l).map(|k| r[(i, k)] * core.U()[(k, kept[j])]).sum::<f64>()
    });
    let middle = Mat::from_fn(basis.len(), basis.len(), |i, j| {
        (0..kept.len()).map(|k| rotated[(i, k)] * rotated[(j, k)] / spectrum[kept[k]]).sum::<f64>()
    });
    let (mut values, mut vectors) = (Vec::new(), Vec::new());
    if basis.len() > 0 {
        let decomposition = middle.self_adjoint_eigen(Side::Lower).map_err(failed)?;
        let found: Vec<f64> = decomposition.S().column_vector().iter().copied().collect();
        let mut order: Vec<usize> = (0..found.len()).collect();
        order.sort_by(|&i, &j| found[j].abs().total_cmp(&found[i].abs()));
        for k in order.into_iter().take(options.rank) {
            values.push(found[k]);
            vectors.push(combine(&basis, &decomposition.U().col(k).iter().copied().collect::<Vec<f64>>()));
        }
    }
    let mut missed = Vec::with_capacity(tests.len());
    each_product(operator, &tests, |test, mut rest| {
        for (value, vector) in values.iter().zip(&vectors) {
            let share = value * dot(vector, test);
            rest.iter_mut().zip(vector).for_each(|(rest, entry)| *rest -= share * entry);
        }
        missed.push(norm(&rest).powi(2));
    })?;
    Ok(Nystrom {
        values,
        vectors,
        smallest_core: spectrum.iter().copied().fold(f64::INFINITY, f64::min),
        missed_square: Estimate::of(&missed, missed.len()),
        products: l + missed.len(),
    })
}
