//! Rayleigh–Ritz for symmetric operators.

use faer::{Mat, Side};

use super::super::super::basis::norm;
use super::super::Expansion;
use super::pairs::{RitzPair, Which};
use crate::error::{Error, Result};

/// The wanted Ritz pairs, of the symmetric part `T` of `H = Vᵀ A V` ([`Expansion::symmetric`]); the other part, which noise and
/// a rig's departures from symmetry leave, is part of the residuals. Both triangles hold a measurement of the
/// same number, and their mean has less noise than either.
pub(in super::super) fn ritz(state: &Expansion, which: Which, count: usize) -> Result<Vec<RitzPair>> {
    let mut pairs = all(state, which)?;
    let residuals: Vec<(f64, f64)> = pairs.iter().map(|pair| (pair.value, pair.residual)).collect();
    pairs.truncate(count);
    for (index, pair) in pairs.iter_mut().enumerate() {
        let others = residuals.iter().enumerate().filter(|(other, _)| *other != index);
        pair.gap = others.fold(f64::INFINITY, |gap, (_, (value, residual))| {
            gap.min((value - pair.value).abs() - residual)
        });
    }
    Ok(pairs)
}

/// Thick restart from the `keep` wanted pairs.
pub(in super::super) fn shrink(state: &mut Expansion, which: Which, keep: usize) -> Result<()> {
    if keep >= state.steps() {
        return Ok(());
    }
    let pairs = all(state, which)?;
    let kept: Vec<(f64, &[f64])> =
        pairs.iter().take(keep).map(|pair| (pair.value, pair.coefficients.as_slice())).collect();
    state.restart(&kept);
    Ok(())
}

fn all(state: &Expansion, which: Which) -> Result<Vec<RitzPair>> {
    let m = state.steps();
    if which == Which::LargestImaginary {
        return Err(Error::Option {
            option: "--which".into(),
            fault: "the eigenvalues of a symmetric operator have no imaginary part".into(),
            help: "use the Arnoldi method, or ask for another end of the spectrum".into(),
        });
    }
    if m == 0 {
        return Ok(Vec::new());
    }
    let projected = Mat::from_fn(m, m, |i, j| state.symmetric(i, j));
    let decomposition = projected.self_adjoint_eigen(Side::Lower).map_err(|_| {
        Error::Numerical(format!("the dense eigensolver failed on a {m}x{m} symmetric matrix"))
    })?;
    let values: Vec<(f64, f64)> =
        decomposition.S().column_vector().iter().map(|value| (*value, 0.0)).collect();
    let (rounding, asymmetric) = (rounding(state), state.asymmetric_part());
    Ok(which
        .order(&values)
        .into_iter()
        .map(|k| {
            let coefficients: Vec<f64> = decomposition.U().col(k).iter().copied().collect();
            let outside = state.outside(&coefficients, &asymmetric);
            let residual = norm(&outside.known).hypot(norm(&outside.waiting)).hypot(outside.asymmetric);
            RitzPair {
                value: values[k].0,
                imaginary: 0.0,
                residual,
                gap: f64::INFINITY,
                condition: 1.0,
                rounding,
                noise: state.noise(&coefficients, &[]),
                unresolved: state.unresolved(&outside, &coefficients),
                asymmetric: state.beyond_errors(outside.asymmetric, &coefficients),
                coefficients,
                imaginary_coefficients: Vec::new(),
            }
        })
        .collect())
}

/// Rounding of products of `n` terms, of orthogonalization, and of the dense eigensolver on `m × m`.
pub(super) fn rounding(state: &Expansion) -> f64 {
    let terms = 10.0 + (state.n() as f64).sqrt() + state.steps() as f64;
    f64::EPSILON * state.scale() * terms
}
