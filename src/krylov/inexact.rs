//! How noisy a product may be.

/// The relaxation of inexact Krylov methods: the nearer the answer, the noisier a product may be.
///
/// A Krylov relation from products with errors `e_k` (of norm-1 vectors) is that of `A` but for `E = [e_1 … e_m]`, and the
/// true residual of `V s` differs from the computed one by `E s`, at most `Σ ‖e_k‖ |s_k|`. As the entries `s_k` fall like the
/// residual norm `ρ_{k−1}` before step `k`, `‖e_k‖` may grow like its inverse:
///
/// ```text
/// ‖e_k‖ ≤ (gap / 2m) · target / ρ_{k−1}    makes    ‖E s‖ ≤ target
/// ```
///
/// with `gap` the distance of the wanted eigenvalue to the rest of the spectrum (for `A x = b` the smallest
/// singular value takes the place of `gap / 2`). On a rig or a simulator: `t` times the light makes the noise `√t` times smaller, so that late
/// photos may be exposed, or traced, much shorter than the first.
///
/// The same errors without relaxation would have to be `target / √m` in every product.
///
/// # References
/// van den Eshof and Sleijpen, *Inexact Krylov subspace methods for linear systems* (2004),
/// doi:10.1137/S0895479802403459; Simoncini and Szyld, *Theory of inexact Krylov subspace methods and applications to
/// scientific computing* (2003), doi:10.1137/S1064827502406415; Simoncini, *Variable accuracy of matrix-vector products
/// in projection methods for eigencomputation* (2005), doi:10.1137/040605333.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relaxation {
    /// The residual norm wanted in the end, absolute.
    pub target: f64,
    /// Steps `m` expected at most.
    pub steps: usize,
    /// The gap, absolute. An estimate will do.
    pub gap: f64,
    /// The largest error ever allowed (the theory fails when an error is of the size of `A`). A tenth of `‖A‖` is
    /// reasonable.
    pub most: f64,
}

impl Relaxation {
    /// The largest error norm allowed in the next product with a vector of norm 1, when the residual norm is
    /// `residual` now (infinite before the first step: then `target / 2m`, with the residual taken as `gap`).
    pub fn allowed_error(&self, residual: f64) -> f64 {
        let share = self.target / (2.0 * self.steps.max(1) as f64);
        if residual >= self.gap { share.min(self.most) } else { (share * self.gap / residual).min(self.most) }
    }
}

/// How noisy the next product may be, relative to itself, for a true residual of `target` (relative to `‖b‖`) in the end:
/// `target / (budget · residual)`, at most 1. `residual` is `‖b − A x‖ / ‖b‖` of the current iterate, and `budget` the number of
/// products in all.
///
/// As the residual falls, later products may be noisier: fewer samples, or a shorter exposure. Each product adds its noise times its
/// coefficient to the gap between the residual that the recurrence knows and the true one, and the coefficients fall as the residuals
/// do. The operator's condition is assumed to be moderate, which preconditioning is to ensure.
///
/// # References
/// Bouras and Frayssé (2005), doi:10.1137/S0895479801384743; van den Eshof and Sleijpen (2004),
/// doi:10.1137/S0895479802403459; Simoncini and Szyld (2003), doi:10.1137/S1064827502406415.
pub fn relaxed_noise(residual: f64, budget: usize, target: f64) -> f64 {
    let bound = budget.max(1) as f64 * residual.min(1.0);
    if bound > target { target / bound } else { 1.0 }
}
