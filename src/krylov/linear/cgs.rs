//! The conjugate gradient squared method.

use std::sync::Arc;

use super::super::basis::{dot, norm};
use super::super::precondition::Preconditioner;
use super::super::stats::Status;
use super::super::vectors::{axpy, update2};
use super::system::{System, Tally, square};
use super::{Advance, SolveOptions, Solver, precondition, refuse_left};
use crate::error::Result;
use crate::operator::Adjoint;

/// Conjugate gradients squared: `A x = b` for any square `A` of `n × n`, preconditioned from the right.
///
/// # Properties
/// No transpose. Two products an iteration, and the iterate moves with the second. `‖r‖` jumps about, so the best
/// iterate is kept. Ends with a sentence when a divisor vanishes (a skew-symmetric `A`, for one). Stores twelve
/// `n`-vectors: `b, x`, the best `x`, `r, r̃, u, p, q, v`, two for preconditioned ones, and a product.
///
/// # References
/// Sonneveld (1989), doi:10.1137/0910004.
#[derive(Clone)]
pub struct Cgs {
    system: System,
    preconditioner: Option<Arc<dyn Preconditioner>>,
    shadow: Vec<f64>,
    u: Vec<f64>,
    p: Vec<f64>,
    q: Vec<f64>,
    /// `A M⁻¹ p`.
    v: Vec<f64>,
    /// What was or is to be preconditioned, and the result.
    sum: Vec<f64>,
    hat: Vec<f64>,
    rho: f64,
    alpha: f64,
    phase: Phase,
}

#[derive(Clone, Copy, PartialEq)]
enum Phase {
    Start,
    /// `p` has to be made.
    Direction,
    /// `A M⁻¹ p` is due.
    First,
    /// `A M⁻¹ (u + q)` is due.
    Second,
}

impl Cgs {
    /// For `b` of length `n`. Looks at `x0` and `preconditioner` of the options.
    ///
    /// # Errors
    /// As [`Cg::new`](super::Cg::new), except that any preconditioner will do.
    pub fn new(b: &[f64], options: &SolveOptions) -> Result<Self> {
        refuse_left("CGS", options)?;
        let zero = vec![0.0; b.len()];
        Ok(Self {
            system: System::new(b.len(), b, options)?,
            preconditioner: options.preconditioner.clone(),
            shadow: zero.clone(),
            u: zero.clone(),
            p: zero.clone(),
            q: zero.clone(),
            v: zero.clone(),
            sum: zero.clone(),
            hat: zero,
            rho: 0.0,
            alpha: 0.0,
            phase: Phase::Start,
        })
    }
}

impl Solver for Cgs {
    fn step(&mut self, operator: &mut dyn Adjoint) -> Result<Advance> {
        let system = &mut self.system;
        system.fits(operator)?;
        square(system.b.len(), system.x.len())?;
        if system.pending {
            system.first_residual(operator)?;
            return Ok(Advance::Continuing);
        }
        if self.phase == Phase::Start {
            self.shadow.copy_from_slice(&system.r);
            self.phase = Phase::Direction;
        }
        if self.phase == Phase::Direction {
            let rho = dot(&self.shadow, &system.r);
            if negligible(rho, &self.shadow, &system.r) {
                return Ok(Advance::Ended(Status::Breakdown("the residual is orthogonal to its shadow")));
            }
            let beta = if self.rho == 0.0 { 0.0 } else { rho / self.rho };
            update2(&mut self.u, &system.r, &self.q, |_, r, q| r + beta * q);
            // p ← u + β (q + β p)
            update2(&mut self.p, &self.u, &self.q, |p, u, q| u + beta * (q + beta * p));
            self.rho = rho;
            self.phase = Phase::First;
        }
        if self.phase == Phase::First {
            precondition(self.preconditioner.as_ref(), &self.p, &mut self.hat)?;
            system.tally.product(operator, &self.hat, &mut system.work)?;
            let sigma = dot(&self.shadow, &system.work);
            if negligible(sigma, &self.shadow, &system.work) {
                return Ok(Advance::Ended(Status::Breakdown(
                    "a product is orthogonal to the residual's shadow",
                )));
            }
            let alpha = self.rho / sigma;
            self.alpha = alpha;
            self.v.copy_from_slice(&system.work);
            update2(&mut self.q, &self.u, &self.v, |_, u, v| u - alpha * v);
            update2(&mut self.sum, &self.u, &self.q, |_, u, q| u + q);
            self.phase = Phase::Second;
            return Ok(Advance::Continuing);
        }
        precondition(self.preconditioner.as_ref(), &self.sum, &mut self.hat)?;
        system.tally.product(operator, &self.hat, &mut system.work)?;
        axpy(self.alpha, &self.hat, &mut system.x);
        axpy(-self.alpha, &system.work, &mut system.r);
        let residual = norm(&system.r);
        system.note(residual);
        self.phase = Phase::Direction;
        if residual.is_finite() {
            Ok(Advance::Continuing)
        } else {
            Ok(Advance::Ended(Status::Breakdown("the residual grew beyond all bounds")))
        }
    }

    fn tally(&self) -> Tally {
        self.system.tally
    }

    fn solution(&self) -> Vec<f64> {
        self.system.best().to_vec()
    }
}

/// An inner product that is zero but for rounding: dividing by it would return noise.
pub(super) fn negligible(product: f64, a: &[f64], b: &[f64]) -> bool {
    product.abs() <= f64::EPSILON * norm(a) * norm(b)
}
