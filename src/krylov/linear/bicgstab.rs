//! The stabilized biconjugate gradient method.

use super::super::basis::dot;
use super::super::stats::Status;
use super::super::vectors::{axpy, update2};
use super::shadow::{Phase, Shadowed, negligible};
use super::system::Tally;
use super::{Advance, SolveOptions, Solver};
use crate::error::Result;
use crate::operator::Adjoint;

/// BiCGStab: solves `A x = b` for any square `A` of `n × n`, preconditioned from the right.
///
/// # Properties
/// No transpose. An iteration takes two products, and each moves the iterate: the first along the biconjugate
/// direction, the second along the residual, by the step that minimizes it. `‖r‖` is not monotone; the best
/// iterate is returned. Ends with [`Status::Breakdown`] when a divisor vanishes.
///
/// # Storage
/// Nine `n`-vectors: `b, x`, the best `x`, `r, r̃, p, v`, a preconditioned one and a product.
///
/// # References
/// van der Vorst (1992), doi:10.1137/0913035.
#[derive(Clone)]
pub struct BiCgStab {
    shared: Shadowed,
    p: Vec<f64>,
    /// `A M⁻¹ p`.
    v: Vec<f64>,
    alpha: f64,
    omega: f64,
}

impl BiCgStab {
    /// The state before the first step, for `b` of length `n`. Reads `x0` and `preconditioner` of the
    /// options.
    ///
    /// # Errors
    /// As [`Cg::new`](super::Cg::new), except that any preconditioner will do.
    pub fn new(b: &[f64], options: &SolveOptions) -> Result<Self> {
        let zero = vec![0.0; b.len()];
        let shared = Shadowed::new("BiCGStab", b, options)?;
        Ok(Self { shared, p: zero.clone(), v: zero, alpha: 0.0, omega: 0.0 })
    }
}

impl Solver for BiCgStab {
    fn step(&mut self, operator: &mut dyn Adjoint) -> Result<Advance> {
        if self.shared.open(operator)? {
            return Ok(Advance::Continuing);
        }
        if self.shared.phase == Phase::Direction {
            let ratio = match self.shared.advance_rho() {
                Ok(ratio) => ratio,
                Err(status) => return Ok(Advance::Ended(status)),
            };
            let omega = self.omega;
            let beta = if ratio == 0.0 { 0.0 } else { ratio * (self.alpha / omega) };
            let r = &self.shared.system.r;
            update2(&mut self.p, r, &self.v, |p, r, v| r + beta * (p - omega * v));
            self.shared.phase = Phase::First;
        }
        if self.shared.phase == Phase::First {
            // Along the biconjugate direction.
            self.shared.product(operator, &self.p)?;
            self.alpha = match self.shared.alpha() {
                Ok(alpha) => alpha,
                Err(status) => return Ok(Advance::Ended(status)),
            };
            self.v.copy_from_slice(&self.shared.system.work);
            let system = &mut self.shared.system;
            axpy(self.alpha, &self.shared.hat, &mut system.x);
            axpy(-self.alpha, &self.v, &mut system.r);
            self.shared.phase = Phase::Second;
        } else {
            // Along the residual, which holds `s` here.
            self.shared.residual_product(operator)?;
            let system = &mut self.shared.system;
            let square = dot(&system.work, &system.work);
            let overlap = dot(&system.work, &system.r);
            if square == 0.0 || negligible(overlap, &system.work, &system.r) {
                return Ok(Advance::Ended(Status::Breakdown("a product is orthogonal to the residual")));
            }
            self.omega = overlap / square;
            axpy(self.omega, &self.shared.hat, &mut system.x);
            axpy(-self.omega, &system.work, &mut system.r);
            self.shared.phase = Phase::Direction;
        }
        Ok(self.shared.close())
    }

    fn tally(&self) -> Tally {
        self.shared.system.tally()
    }

    fn solution(&self) -> Vec<f64> {
        self.shared.system.best()
    }
}
