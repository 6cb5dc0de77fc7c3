//! Orthogonalization against a basis, repeated as often as needed.

use super::basis::{Basis, norm};

/// After a pass that leaves more than this share of the norm, the rest is orthogonal to working precision.
/// Otherwise cancellation has amplified the rounding errors, and another pass follows. 1/√2 is the choice of
/// Daniel, Gragg, Kaufman and Stewart, *Reorthogonalization and stable algorithms for updating the
/// Gram–Schmidt QR factorization*, Math. Comp. 30 (1976), doi:10.1090/S0025-5718-1976-0431641-8.
const ENOUGH_LEFT: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// "Twice is enough" (Giraud, Langou, Rozložník and van den Eshof, doi:10.1007/s00211-005-0615-4) holds for a
/// `w` that is not in the span to working precision. A vector in the span shrinks to rounding errors, and is
/// recognized by its norm.
const PASSES: usize = 3;

/// The components that were removed from a vector.
pub(super) struct Removed {
    /// `h`, so that `w_before = V h + w_after`.
    pub(super) coefficients: Vec<f64>,
    /// `‖w_after‖`.
    pub(super) norm: f64,
}

/// `w ← (I − V Vᵀ) w` by classical Gram–Schmidt, for `V` with orthonormal columns.
///
/// The last `recent` columns are removed first. In a Lanczos step the last two contain, up to rounding, the
/// whole part of `A v` in the span, so this counts as the first pass, and one further pass over the whole
/// basis usually suffices.
pub(super) fn orthogonalize(basis: &Basis, w: &mut [f64], recent: usize) -> Removed {
    let mut coefficients = vec![0.0; basis.len()];
    let first = basis.len().saturating_sub(recent);
    if first < basis.len() {
        remove(basis, first, w, &mut coefficients);
    }
    let mut before = norm(w);
    for _ in 0..PASSES {
        remove(basis, 0, w, &mut coefficients);
        let after = norm(w);
        let enough = after > ENOUGH_LEFT * before;
        before = after;
        if enough {
            break;
        }
    }
    Removed { coefficients, norm: before }
}

fn remove(basis: &Basis, first: usize, w: &mut [f64], coefficients: &mut [f64]) {
    let dots = basis.dots(first, w);
    basis.accumulate(first, &dots, -1.0, w);
    for (coefficient, dot) in coefficients[first..].iter_mut().zip(&dots) {
        *coefficient += dot;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearly_parallel_vectors_come_out_orthogonal_to_working_precision() {
        // Läuchli's matrix: one pass of classical Gram–Schmidt loses orthogonality like ε/1e-8.
        let tiny = 1e-8;
        let mut basis = Basis::new(4);
        for k in 1..4 {
            let mut w = vec![1.0, 0.0, 0.0, 0.0];
            w[k] = tiny;
            let removed = orthogonalize(&basis, &mut w, 0);
            basis.push_scaled(&w, removed.norm);
        }
        for (i, column) in basis.columns().iter().enumerate() {
            for (j, dot) in basis.dots(0, column).iter().enumerate() {
                let expected = if i == j { 1.0 } else { 0.0 };
                // A second pass leaves rounding errors only: a few ε for four rows.
                assert!((dot - expected).abs() < 1e-15, "columns {i}, {j}: {dot:e}");
            }
        }
    }

    #[test]
    fn coefficients_and_rest_add_up_to_the_vector() {
        let mut basis = Basis::new(3);
        basis.push_scaled(&[3.0, 0.0, 4.0], 5.0);
        basis.push_scaled(&[0.0, 2.0, 0.0], 2.0);
        let mut w = vec![1.0, 2.0, 3.0];
        let removed = orthogonalize(&basis, &mut w, 1);
        basis.accumulate(0, &removed.coefficients, 1.0, &mut w);
        for (value, expected) in w.iter().zip([1.0, 2.0, 3.0]) {
            assert!((value - expected).abs() < 1e-15, "rounding of three numbers of size 3");
        }
    }
}
