//! A lower bound on the residual of every pattern inside the box.

use crate::error::Result;
use crate::krylov::{dot, norm};
use crate::operator::{Adjoint, Direction, Operator, Product, Vectors, delegate};

/// An operator whose products with the transpose bound the residual from below. Each vector `r` with `w = Aᵀ r` separates `b` from the
/// photos of all patterns `z` in the box, because
///
/// ```text
/// ‖r‖ ‖b − A z‖ ≥ rᵀ(b − A z) ≥ rᵀ b − Σᵢ max(lower · wᵢ, upper · wᵢ)
/// ```
///
/// For the residual `r` of a pattern inside the box with the Frank–Wolfe gap `g`, the bound on `‖b − A z‖²` is `(‖r‖² − g)² / ‖r‖²`. It is
/// above the usual `‖r‖² − 2g`, and equals `‖r‖²` at the optimum. No further product is taken.
pub(super) struct Bounded<'a> {
    operator: &'a mut dyn Adjoint,
    b: &'a [f64],
    limits: [f64; 2],
    least: f64,
    is_noisy: bool,
}

impl<'a> Bounded<'a> {
    pub(super) fn new(operator: &'a mut dyn Adjoint, b: &'a [f64], limits: [f64; 2]) -> Self {
        Self { operator, b, limits, least: 0.0, is_noisy: false }
    }

    /// The largest bound on `‖b − A z‖ / ‖b‖` (on `‖b − A z‖` if `b` is zero). It is 0 if nothing is known, for example because products
    /// have noise.
    pub(super) fn least(&self) -> f64 {
        if self.is_noisy { 0.0 } else { self.least }
    }

    fn look(&mut self, r: &[f64], w: &[f64]) {
        let [lower, upper] = self.limits;
        let most: f64 = w.iter().map(|w| (lower * w).max(upper * w)).sum();
        let scale = if self.b.iter().all(|b| *b == 0.0) { 1.0 } else { norm(self.b) };
        // For r = 0 this is no number, which is never larger.
        self.least = self.least.max((dot(r, self.b) - most) / (norm(r) * scale));
    }
}

impl Operator for Bounded<'_> {
    delegate!(operator: rows, cols, symmetry, apply, block_size, observer, standard_errors, common_error);
    delegate!(operator: frames, confirming, vectors);

    fn apply_within(&mut self, vectors: &mut dyn Vectors, column: usize, direction: Direction) -> Result<()> {
        self.operator.apply_within(vectors, column, direction)?;
        if direction == Direction::Adjoint {
            let Product { from, to } = vectors.product()?;
            self.is_noisy |= self.operator.standard_error() > 0.0;
            self.look(&from, &to);
        }
        Ok(())
    }
}

impl Adjoint for Bounded<'_> {
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.operator.apply_adjoint_block(ys, xs)?;
        self.is_noisy |= self.operator.standard_errors().iter().any(|error| *error > 0.0);
        ys.iter().zip(xs).for_each(|(r, w)| self.look(r, w));
        Ok(())
    }
}
