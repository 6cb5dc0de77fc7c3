//! The conjugate gradient squared method.

use super::super::vectors::{axpy, update2};
use super::shadow::{Phase, Shadowed};
use super::system::Tally;
use super::{Advance, SolveOptions, Solver};
use crate::error::Result;
use crate::operator::Adjoint;

/// Conjugate gradients squared: solves `A x = b` for any square `A` of `n × n`, preconditioned from the
/// right.
///
/// # Properties
/// No transpose. An iteration takes two products, and the iterate moves with the second. `‖r‖` is erratic, so
/// the best iterate is returned. Ends with [`Breakdown`](crate::krylov::Status::Breakdown) when a divisor vanishes (for example for a
/// skew-symmetric `A`).
///
/// # Storage
/// Twelve `n`-vectors: `b, x`, the best `x`, `r, r̃, u, p, q, v`, two preconditioned ones, and a product.
///
/// # References
/// Sonneveld (1989), doi:10.1137/0910004.
#[derive(Clone)]
pub struct Cgs {
    shared: Shadowed,
    u: Vec<f64>,
    p: Vec<f64>,
    q: Vec<f64>,
    /// `A M⁻¹ p`.
    v: Vec<f64>,
    /// `u + q`, to be preconditioned.
    sum: Vec<f64>,
    alpha: f64,
}

impl Cgs {
    /// The state before the first step, for `b` of length `n`. Reads `x0` and `preconditioner` of the
    /// options.
    ///
    /// # Errors
    /// As [`Cg::new`](super::Cg::new), except that any preconditioner will do.
    pub fn new(b: &[f64], options: &SolveOptions) -> Result<Self> {
        let zero = vec![0.0; b.len()];
        Ok(Self {
            shared: Shadowed::new("CGS", b, options)?,
            u: zero.clone(),
            p: zero.clone(),
            q: zero.clone(),
            v: zero.clone(),
            sum: zero,
            alpha: 0.0,
        })
    }
}

impl Solver for Cgs {
    fn step(&mut self, operator: &mut dyn Adjoint) -> Result<Advance> {
        if self.shared.open(operator)? {
            return Ok(Advance::Continuing);
        }
        if self.shared.phase == Phase::Direction {
            let beta = match self.shared.advance_rho() {
                Ok(beta) => beta,
                Err(status) => return Ok(Advance::Ended(status)),
            };
            update2(&mut self.u, &self.shared.system.r, &self.q, |_, r, q| r + beta * q);
            // p ← u + β (q + β p)
            update2(&mut self.p, &self.u, &self.q, |p, u, q| u + beta * (q + beta * p));
            self.shared.phase = Phase::First;
        }
        if self.shared.phase == Phase::First {
            self.shared.product(operator, &self.p)?;
            let alpha = match self.shared.alpha() {
                Ok(alpha) => alpha,
                Err(status) => return Ok(Advance::Ended(status)),
            };
            self.alpha = alpha;
            self.v.copy_from_slice(&self.shared.system.work);
            update2(&mut self.q, &self.u, &self.v, |_, u, v| u - alpha * v);
            update2(&mut self.sum, &self.u, &self.q, |_, u, q| u + q);
            self.shared.phase = Phase::Second;
            return Ok(Advance::Continuing);
        }
        self.shared.product(operator, &self.sum)?;
        let system = &mut self.shared.system;
        axpy(self.alpha, &self.shared.hat, &mut system.x);
        axpy(-self.alpha, &system.work, &mut system.r);
        self.shared.phase = Phase::Direction;
        Ok(self.shared.close())
    }

    fn tally(&self) -> Tally {
        self.shared.system.tally()
    }

    fn solution(&self) -> Vec<f64> {
        self.shared.system.best()
    }
}
