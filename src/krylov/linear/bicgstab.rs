//! The stabilized biconjugate gradient method.

use std::sync::Arc;

use super::super::basis::{dot, norm};
use super::super::precondition::Preconditioner;
use super::super::stats::Status;
use super::super::vectors::{axpy, update2};
use super::cgs::negligible;
use super::system::{System, Tally, square};
use super::{Advance, SolveOptions, Solver, precondition, refuse_left};
use crate::error::Result;
use crate::operator::Adjoint;

/// BiCGStab: `A x = b` for any square `A` of `n × n`, preconditioned from the right.
///
/// # Properties
/// No transpose. Two products an iteration, each of which moves the iterate: after the first along the biconjugate
/// direction, after the second along the residual, so as to make it least. `‖r‖` is not monotone; the best iterate is
/// kept. Ends with a sentence when a divisor vanishes. Stores nine `n`-vectors: `b, x`, the best `x`, `r, r̃, p, v`, a
/// preconditioned one and a product.
///
/// # References
/// van der Vorst (1992), doi:10.1137/0913035.
#[derive(Clone)]
pub struct BiCgStab {
    system: System,
    preconditioner: Option<Arc<dyn Preconditioner>>,
    shadow: Vec<f64>,
    p: Vec<f64>,
    /// `A M⁻¹ p`.
    v: Vec<f64>,
    hat: Vec<f64>,
    rho: f64,
    alpha: f64,
    omega: f64,
    phase: Phase,
}

#[derive(Clone, Copy, PartialEq)]
enum Phase {
    Start,
    /// `p` has to be made.
    Direction,
    /// `A M⁻¹ p` is due.
    Biconjugate,
    /// `A M⁻¹ s` is due, with `s` in the residual's place.
    Stabilize,
}

impl BiCgStab {
    /// For `b` of length `n`. Looks at `x0` and `preconditioner` of the options.
    ///
    /// # Errors
    /// As [`Cg::new`](super::Cg::new), except that any preconditioner will do.
    pub fn new(b: &[f64], options: &SolveOptions) -> Result<Self> {
        refuse_left("BiCGStab", options)?;
        let zero = vec![0.0; b.len()];
        Ok(Self {
            system: System::new(b.len(), b, options)?,
            preconditioner: options.preconditioner.clone(),
            shadow: zero.clone(),
            p: zero.clone(),
            v: zero.clone(),
            hat: zero,
            rho: 0.0,
            alpha: 0.0,
            omega: 0.0,
            phase: Phase::Start,
        })
    }
}

impl Solver for BiCgStab {
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
            let omega = self.omega;
            let beta = if self.rho == 0.0 { 0.0 } else { (rho / self.rho) * (self.alpha / omega) };
            update2(&mut self.p, &system.r, &self.v, |p, r, v| r + beta * (p - omega * v));
            self.rho = rho;
            self.phase = Phase::Biconjugate;
        }
        if self.phase == Phase::Biconjugate {
            precondition(self.preconditioner.as_ref(), &self.p, &mut self.hat)?;
            system.tally.product(operator, &self.hat, &mut system.work)?;
            let sigma = dot(&self.shadow, &system.work);
            if negligible(sigma, &self.shadow, &system.work) {
                return Ok(Advance::Ended(Status::Breakdown(
                    "a product is orthogonal to the residual's shadow",
                )));
            }
            self.alpha = self.rho / sigma;
            self.v.copy_from_slice(&system.work);
            axpy(self.alpha, &self.hat, &mut system.x);
            axpy(-self.alpha, &self.v, &mut system.r);
            self.phase = Phase::Stabilize;
        } else {
            precondition(self.preconditioner.as_ref(), &system.r, &mut self.hat)?;
            system.tally.product(operator, &self.hat, &mut system.work)?;
            let square = dot(&system.work, &system.work);
            let overlap = dot(&system.work, &system.r);
            if square == 0.0 || negligible(overlap, &system.work, &system.r) {
                return Ok(Advance::Ended(Status::Breakdown("a product is orthogonal to the residual")));
            }
            self.omega = overlap / square;
            axpy(self.omega, &self.hat, &mut system.x);
            axpy(-self.omega, &system.work, &mut system.r);
            self.phase = Phase::Direction;
        }
        let residual = norm(&system.r);
        system.note(residual);
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
