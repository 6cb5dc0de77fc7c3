//! Ritz pairs of general operators, which may be complex.

use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, c64};

use super::super::super::basis::norm;
use super::super::Expansion;
use super::pairs::{RitzPair, Which};
use super::symmetric::rounding;
use crate::error::{Error, Result};

/// The wanted eigenpairs of `H`. A complex pair counts as two, the one with positive imaginary part first;
/// `count` may cut it in two.
pub(in super::super) fn ritz(state: &Expansion, which: Which, count: usize) -> Result<Vec<RitzPair>> {
    let m = state.steps();
    if m == 0 || count == 0 {
        return Ok(Vec::new());
    }
    let projected = Mat::from_fn(m, m, |i, j| state.entry(i, j));
    let decomposition = projected.eigen().map_err(|_| {
        Error::Numerical(format!("the dense eigensolver failed on a {m}x{m} Hessenberg matrix"))
    })?;
    let values: Vec<(f64, f64)> =
        decomposition.S().column_vector().iter().map(|value| (value.re, value.im)).collect();
    let right = decomposition.U();
    let left = right.to_owned().partial_piv_lu().inverse();
    let rounding = rounding(state);
    Ok(which
        .order(&values)
        .into_iter()
        .take(count)
        .map(|k| {
            let (value, imaginary) = values[k];
            let column: Vec<c64> = right.col(k).iter().copied().collect();
            let length = length(&column);
            let condition = length * self::length(&(0..m).map(|j| left[(k, j)]).collect::<Vec<c64>>());
            // The phase at which the entry of largest magnitude is real and positive.
            let largest =
                column.iter().fold(c64::new(0.0, 0.0), |a, &b| if size(b) > size(a) { b } else { a });
            let unit = c64::new(largest.re / size(largest), -largest.im / size(largest));
            let turned = column.iter().map(|&entry| {
                let turned = entry * unit;
                (turned.re / length, turned.im / length)
            });
            let (coefficients, mut imaginary_coefficients): (Vec<f64>, Vec<f64>) = turned.unzip();
            if imaginary == 0.0 {
                imaginary_coefficients.clear();
            }
            let residual = outside(state, &coefficients).hypot(if imaginary == 0.0 {
                0.0
            } else {
                outside(state, &imaginary_coefficients)
            });
            RitzPair {
                value,
                imaginary,
                residual,
                gap: 0.0,
                condition: if condition.is_finite() { condition.max(1.0) } else { f64::INFINITY },
                rounding,
                noise: state.noise(&coefficients, &imaginary_coefficients),
                asymmetric: 0.0,
                unresolved: 0.0,
                coefficients,
                imaginary_coefficients,
            }
        })
        .collect())
}

/// `‖A V s − V H s‖`.
fn outside(state: &Expansion, s: &[f64]) -> f64 {
    let [known, waiting] = state.beyond(s);
    norm(&known).hypot(norm(&waiting))
}

fn length(column: &[c64]) -> f64 {
    column.iter().map(|entry| entry.re * entry.re + entry.im * entry.im).sum::<f64>().sqrt()
}

fn size(entry: c64) -> f64 {
    entry.re.hypot(entry.im)
}
