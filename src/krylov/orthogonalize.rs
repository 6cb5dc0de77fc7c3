//! Orthogonalization against a basis, repeated as often as needed.
//!
//! Blocked classical Gram–Schmidt with a selective second pass. A pass takes all inner products and then removes
//! all components; the inner products of the next pass are taken in the sweep that removes those of this one, so
//! that `p` passes read the basis `p + 1` times and not `2p` times.
//!
//! # Bound
//! For `m` columns of `n` rows let `γ = (r + 2m + 12) ε/2`, with `r = 128 + n/512`: inner products are sums of blocks of
//! 512 rows in four lanes, of the blocks, and of a few ends (a relative error of `(r + 10) ε/2`), and a removal rounds `m + 1` times. One
//! pass leaves `‖Vᵀw‖ ≤ √k γ ‖w_before‖` for `k` columns that are orthonormal to working precision. Another pass is
//! skipped in two cases only:
//!
//! * more than `1/√2` of the norm is left (Daniel, Gragg, Kaufman and Stewart): `‖Vᵀw‖ ≤ √(2k) γ ‖w‖`;
//! * the inner products with what is left, which are known by then, are at most `8ε ‖w‖`: `‖Vᵀw‖ ≤ (8ε + √k γ) ‖w‖`.
//!
//! Either way, `m` columns made so have `‖I − VᵀV‖_F ≤ √(2 Σ_k ‖V_kᵀv_{k+1}‖²) ≤ m (√2 γ + 8ε)`, since the sum of `2k` over the
//! columns is at most `m²`. A test holds hard cases to this.

use super::basis::{Basis, norm};

/// After a pass that leaves more than this share of the norm, the rest is orthogonal to working precision.
/// Otherwise cancellation has amplified the rounding errors, and another pass may be needed. 1/√2 is the choice of
/// Daniel, Gragg, Kaufman and Stewart, *Reorthogonalization and stable algorithms for updating the
/// Gram–Schmidt QR factorization*, Math. Comp. 30 (1976), doi:10.1090/S0025-5718-1976-0431641-8.
pub(super) const ENOUGH_LEFT: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Inner products of this share of the norm are rounding errors: another pass would gain nothing.
const NEGLIGIBLE: f64 = 8.0 * f64::EPSILON;

/// "Twice is enough" (Giraud, Langou, Rozložník and van den Eshof, doi:10.1007/s00211-005-0615-4) holds for a
/// `w` that is not in the span to working precision. A vector in the span shrinks to rounding errors, and is
/// recognized by its norm.
pub(super) const PASSES: usize = 3;

/// The components that were removed from a vector.
pub(super) struct Removed {
    /// `h`, so that `w_before = V h + w_after`.
    pub(super) coefficients: Vec<f64>,
    /// `‖w_after‖`.
    pub(super) norm: f64,
}

/// `w ← (I − V Vᵀ) w` by classical Gram–Schmidt, for `V` with orthonormal columns.
pub(super) fn orthogonalize(basis: &Basis, w: &mut [f64]) -> Removed {
    let (mut next, mut length) = basis.dots_and_norm(0, w);
    let mut coefficients = vec![0.0; basis.len()];
    if basis.len() == 0 {
        return Removed { coefficients, norm: length };
    }
    for _ in 0..PASSES {
        let before = length;
        coefficients.iter_mut().zip(&next).for_each(|(sum, part)| *sum += part);
        (next, length) = basis.remove_and_dot(&next, w);
        if length > ENOUGH_LEFT * before || norm(&next) <= NEGLIGIBLE * length {
            break;
        }
    }
    Removed { coefficients, norm: length }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The entry of a matrix in a row and a column.
    type Entry<'a> = dyn Fn(usize, usize) -> f64 + 'a;

    /// The bound of the module's comment for `m` columns of `n` rows.
    fn bound(m: usize, n: usize) -> f64 {
        let gamma = (128.0 + n as f64 / 512.0 + 2.0 * m as f64 + 12.0) * f64::EPSILON / 2.0;
        m as f64 * (std::f64::consts::SQRT_2 * gamma + 8.0 * f64::EPSILON)
    }

    /// `‖I − VᵀV‖_F`
    fn loss(basis: &Basis) -> f64 {
        let gram = basis.columns().iter().map(|column| basis.dots(0, column));
        let square = |(i, row): (usize, Vec<f64>)| -> f64 {
            row.iter().enumerate().map(|(j, dot)| (dot - f64::from(u8::from(i == j))).powi(2)).sum()
        };
        gram.enumerate().map(square).sum::<f64>().sqrt()
    }

    #[test]
    fn nearly_dependent_directions_stay_within_the_bound() {
        let n = 3000;
        let wave = |k: usize| move |i: usize| ((i * (k + 1)) as f64 * 0.01).sin();
        let cases: [(&str, &Entry<'_>); 4] = [
            // Läuchli's matrix: one pass of classical Gram–Schmidt loses orthogonality like ε/1e-8.
            ("Läuchli", &|i, k| if i == 0 { 1.0 } else { f64::from(u8::from(i == k + 1)) * 1e-8 }),
            // Powers of x: a basis as ill conditioned as any.
            ("Vandermonde", &|i, k| (i as f64 / n as f64).powi(k as i32)),
            ("large dynamic range", &|i, k| wave(k)(i) * 10.0_f64.powi(((i * 7) % 25) as i32 - 12)),
            ("nearly equal", &|i, k| 1.0 + 1e-10 * wave(k)(i)),
        ];
        for (name, entry) in cases {
            let mut basis = Basis::new(n);
            for k in 0..64 {
                let mut w: Vec<f64> = (0..n).map(|i| entry(i, k)).collect();
                let before = norm(&w);
                let removed = orthogonalize(&basis, &mut w);
                // Else it is in the span, to rounding.
                if removed.norm > before * f64::EPSILON * (10.0 + (n as f64).sqrt()) {
                    basis.push_scaled(&w, removed.norm);
                }
            }
            let loss = loss(&basis);
            assert!(basis.len() > 12, "{name}: {} columns", basis.len());
            assert!(loss <= bound(basis.len(), n), "{name}: {loss:e} with {} columns", basis.len());
        }
    }

    #[test]
    fn coefficients_and_rest_add_up_to_the_vector() {
        let mut basis = Basis::new(3);
        basis.push_scaled(&[3.0, 0.0, 4.0], 5.0);
        basis.push_scaled(&[0.0, 2.0, 0.0], 2.0);
        let mut w = vec![1.0, 2.0, 3.0];
        let removed = orthogonalize(&basis, &mut w);
        basis.accumulate(0, &removed.coefficients, 1.0, &mut w);
        for (value, expected) in w.iter().zip([1.0, 2.0, 3.0]) {
            assert!((value - expected).abs() < 1e-15, "rounding of three numbers of size 3");
        }
    }
}
