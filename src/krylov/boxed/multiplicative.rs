//! Multiplicative updates.

use super::super::basis::norm;
use super::super::linear::{Advance, SolveOptions, Solver, Tally};
use super::super::vectors::update2;
use super::bounds::Boxed;
use super::mrnsd::make_positive;
use crate::error::Result;
use crate::operator::Adjoint;

/// The image space reconstruction algorithm: minimizes `‖A x − b‖` over `x ≥ 0`, for a square `A ≥ 0` of
/// `n × n` with its transpose and `b ≥ 0`, by `x ← x ∘ (Aᵀb) / (AᵀA x)`. A baseline.
///
/// # Properties
/// `‖r‖` falls monotonically for non-negative `A` and `b`. It takes one product with `Aᵀ` first, then two an
/// iteration, `A x` and `Aᵀ(A x)`. Respects only `x ≥ 0`; ignores the bounds of the options.
///
/// # Storage
/// Eight `n`-vectors: `b, x`, the best `x`, `r, D, Aᵀb, A x` and a product.
///
/// # References
/// Daube-Witherspoon and Muehllehner (1986), doi:10.1109/TMI.1986.4307748; Lee and Seung's updates (2001) for
/// one factor.
#[derive(Clone)]
pub struct Multiplicative {
    boxed: Boxed,
    /// `Aᵀ b` with negative entries replaced by 0; empty until it is known.
    numerator: Vec<f64>,
    image: Vec<f64>,
    forward: bool,
}

impl Multiplicative {
    /// The state before the first step, for `b` of length `n`. Reads `x0` and `diagonal` of the options;
    /// without `diagonal` the first product is `A 1`.
    ///
    /// # Errors
    /// As [`ProjectedJacobi::new`](super::ProjectedJacobi::new).
    pub fn new(b: &[f64], options: &SolveOptions) -> Result<Self> {
        let options = SolveOptions { lower: 0.0, upper: f64::INFINITY, ..options.clone() };
        Ok(Self {
            boxed: Boxed::new("multiplicative updates", b, &options)?,
            numerator: Vec::new(),
            image: vec![0.0; b.len()],
            forward: true,
        })
    }
}

impl Solver for Multiplicative {
    fn step(&mut self, operator: &mut dyn Adjoint) -> Result<Advance> {
        let boxed = &mut self.boxed;
        boxed.system.fits(operator)?;
        if boxed.take_diagonal(operator)? {
            return Ok(Advance::Continuing);
        }
        if self.numerator.is_empty() {
            let system = &mut boxed.system;
            system.tally.adjoint(operator, &system.b, &mut system.work)?;
            self.numerator = system.work.iter().map(|value| value.max(0.0)).collect();
            return Ok(Advance::Continuing);
        }
        if self.forward {
            let system = &mut boxed.system;
            if system.pending {
                make_positive(&mut system.x);
            }
            system.tally.product(operator, &system.x, &mut system.work)?;
            system.pending = false;
            self.image.copy_from_slice(&system.work);
            boxed.residual_from_work();
            let residual = norm(&boxed.system.r);
            boxed.system.note(residual);
            self.forward = false;
            return Ok(Advance::Continuing);
        }
        let system = &mut boxed.system;
        system.tally.adjoint(operator, &self.image, &mut system.work)?;
        update2(&mut system.x, &self.numerator, &system.work, |x, above, below| {
            if below > 0.0 { x * above / below } else { x }
        });
        self.forward = true;
        Ok(Advance::Continuing)
    }

    fn tally(&self) -> Tally {
        self.boxed.system.tally()
    }

    fn solution(&self) -> Vec<f64> {
        self.boxed.system.best()
    }
}
