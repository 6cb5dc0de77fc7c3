//! A product's part in the span of the basis, removed with one reading of the basis a step.
//!
//! Full reorthogonalization takes the inner products of the product with all basis vectors, and removes what they
//! say: two readings. Here the removal waits for the next step, whose inner products need a reading anyway (delayed
//! reorthogonalization: Bielich, Langou, Thomas, Świrydowicz, Yamazaki and Boman, *Low-synch Gram–Schmidt with delayed
//! reorthogonalization for Krylov solvers*, Parallel Computing 112 (2022), doi:10.1016/j.parco.2022.102940).
//!
//! The last basis vector `û = v + V s` is then multiplied while it still has small parts `s` along the others. By
//! linearity `A v = A û − A V s`, and `A V s = V⁺H s` is known from the coefficients of the products before. The same
//! number, known beforehand, is what `A û` has along the basis beside the three terms of Lanczos; it is removed in the
//! sweep that takes the inner products, since it would grow like `(‖A‖/β)^k` over `k` steps otherwise.
//!
//! | readings of the basis a step | before | now |
//! |---|---|---|
//! | Lanczos, block Lanczos | 2 | 1 |
//! | Arnoldi | 4 | 2 |
//!
//! # Bound
//! Only parts of norm at most [`LATE`] wait; larger ones (from noise, or of a product that is nearly in the span) are removed at
//! once, by passes as in [`orthogonalize`](super::super::orthogonalize). So `v` has norm `1 + O(ε)`, and with the rounding error `γ`
//! stated there, `‖V_jᵀv‖ ≤ √j γ + LATE ‖I − V_jᵀV_j‖`: no error is passed on. `m` vectors have
//! `‖I − VᵀV‖_F ≤ √2 m γ`, as if each had been reorthogonalized at once. The tests hold hard cases to this.

use super::super::basis::norm;
use super::super::orthogonalize::{ENOUGH_LEFT, PASSES};
use super::super::sweeps::Settling;
use super::Expansion;

/// The largest parts along the basis, as a share of the norm, whose removal may wait for the next step. Rounding
/// leaves about `ε ‖A‖/β`: 1e-14 to 1e-13 for most spectra.
const LATE: f64 = 1e-12;

/// A product without its part in the span of the basis.
pub(super) struct Rest {
    /// The coefficients of the product on the basis.
    pub(super) coefficients: Vec<f64>,
    /// The norm of the rest.
    pub(super) norm: f64,
    /// The parts along the basis that are still in the rest; empty if there are none.
    pub(super) late: Vec<f64>,
}

impl Expansion {
    /// Orthogonalizes the product in `work` against the basis. `along` holds the product's inner products with the last columns,
    /// which contain, up to rounding, its whole part in the span; it is empty where that is not known.
    pub(super) fn orthogonalize_product(&mut self, along: &[f64]) -> Rest {
        let (total, first) = (self.basis.len(), self.basis.len() - along.len());
        let late = std::mem::take(&mut self.late);
        // The vector multiplied is the one with late parts only where no other waits.
        let shown = if self.pending() == 1 { self.product_of(&late) } else { vec![0.0; total] };
        let of_last = along.last().copied().unwrap_or(0.0);
        let late_at = |i: usize| late.get(i).copied().unwrap_or(0.0);
        let mut ahead = vec![0.0; total - 1];
        if !late.is_empty() && !along.is_empty() {
            for (i, ahead) in ahead.iter_mut().enumerate().take(first) {
                *ahead = shown[i] - of_last * late_at(i);
            }
        }
        let settling = Settling { late: &late, along, ahead: &ahead };
        let (mut rest, mut length) = self.basis.settle_and_dot(&settling, &mut self.work);
        // What is removed so far, on the settled basis, less what the late parts have added to the product.
        let mut coefficients: Vec<f64> = (0..total)
            .map(|i| {
                let near = if i < first { ahead.get(i).copied().unwrap_or(0.0) } else { along[i - first] };
                near + of_last * late_at(i) - shown[i]
            })
            .collect();
        rest.iter_mut().zip(&ahead).for_each(|(rest, ahead)| *rest -= ahead);
        let mut enough = false;
        for _ in 0..=PASSES {
            if enough && self.filter.is_some() {
                break;
            }
            coefficients.iter_mut().zip(&rest).for_each(|(sum, part)| *sum += part);
            if self.filter.is_none() && norm(&rest) <= LATE * length {
                return Rest { coefficients, norm: length, late: self.without_known(rest) };
            }
            let before = length;
            (rest, length) = self.basis.remove_and_dot(&rest, &mut self.work);
            enough = length > ENOUGH_LEFT * before;
        }
        Rest { coefficients, norm: length, late: Vec::new() }
    }

    /// `V⁺ᵀ A V s`, from the products so far, for parts `s` along the columns before the last.
    fn product_of(&self, late: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; self.basis.len()];
        for (column, s) in self.columns.iter().zip(late.iter().skip(self.known)) {
            product.iter_mut().zip(column).for_each(|(sum, entry)| *sum += entry * s);
        }
        product
    }

    /// Removes the parts along the known vectors at once: their products are not known.
    fn without_known(&mut self, mut rest: Vec<f64>) -> Vec<f64> {
        if self.known > 0 {
            self.basis.accumulate_first(&rest[..self.known], -1.0, &mut self.work);
            rest[..self.known].fill(0.0);
        }
        rest
    }

    /// Removes the late parts of the last basis vector now.
    pub(super) fn settle(&mut self) {
        self.basis.settle_last(&std::mem::take(&mut self.late));
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Factorization, Lanczos};
    use super::*;
    use crate::error::Result;
    use crate::krylov::Start;
    use crate::operator::{Closure, Symmetry};

    #[test]
    fn what_rounding_leaves_waits_and_what_noise_leaves_does_not() -> Result<()> {
        let n = 600;
        for noise in [0.0, 1e-4] {
            let diagonal = move |x: &[f64], y: &mut [f64]| {
                for (i, (y, x)) in y.iter_mut().zip(x).enumerate() {
                    *y = (1.0 + (i as f64).sqrt() + noise * (x * 1e6).sin()) * x;
                }
                Ok(())
            };
            let mut operator = Closure::new(n, n, Symmetry::Symmetric, diagonal);
            let mut lanczos = Lanczos::new(&Start::default().vector(n), &[])?;
            let mut largest = 0.0_f64;
            for step in 1..=60 {
                lanczos.expand(&mut operator)?;
                // The first two steps remove everything beforehand.
                if step > 2 {
                    largest = largest.max(norm(&lanczos.expansion().late));
                }
            }
            if noise == 0.0 {
                // ‖A‖/β is about 5 here: a few ε of ‖A‖ are left, more than a removal at once would leave.
                assert!((8.0 * f64::EPSILON..1e-13).contains(&largest), "{largest:e}");
            } else {
                // A second look finds rounding errors of a removal only.
                assert!(largest < 4.0 * f64::EPSILON, "{largest:e}");
            }
        }
        Ok(())
    }
}
