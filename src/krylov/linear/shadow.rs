//! What CGS and BiCGStab share: a fixed shadow of the first residual, and the scalars that it gives.

use std::sync::Arc;

use super::super::basis::{dot, norm};
use super::super::precondition::Preconditioner;
use super::super::stats::Status;
use super::system::{System, square};
use super::{Advance, SolveOptions, precondition, refuse_left};
use crate::error::Result;
use crate::operator::Adjoint;

/// A system, the shadow `r̃ = r_0` of its residual, and where in an iteration of two products the method stands.
#[derive(Clone)]
pub(super) struct Shadowed {
    pub(super) system: System,
    preconditioner: Option<Arc<dyn Preconditioner>>,
    shadow: Vec<f64>,
    /// `M⁻¹` of what was multiplied last.
    pub(super) hat: Vec<f64>,
    rho: f64,
    pub(super) phase: Phase,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Phase {
    Start,
    /// A new direction has to be made.
    Direction,
    /// The first product of the iteration is due.
    First,
    /// The second is due.
    Second,
}

impl Shadowed {
    /// For `b` of length `n`.
    pub(super) fn new(method: &str, b: &[f64], options: &SolveOptions) -> Result<Self> {
        refuse_left(method, options)?;
        Ok(Self {
            system: System::new(b.len(), b, options)?,
            preconditioner: options.preconditioner.clone(),
            shadow: vec![0.0; b.len()],
            hat: vec![0.0; b.len()],
            rho: 0.0,
            phase: Phase::Start,
        })
    }

    /// Opens a step: `true` when it took the residual of a given first iterate, and is done with that.
    pub(super) fn open(&mut self, operator: &mut dyn Adjoint) -> Result<bool> {
        self.system.fits(operator)?;
        square(self.system.b.len(), self.system.x.len())?;
        if self.system.pending {
            self.system.first_residual(operator)?;
            return Ok(true);
        }
        if self.phase == Phase::Start {
            self.shadow.copy_from_slice(&self.system.r);
            self.phase = Phase::Direction;
        }
        Ok(false)
    }

    /// `ρ_k / ρ_{k−1}` for the new direction, 0 for the first; `ρ = r̃ᵀ r`.
    pub(super) fn advance_rho(&mut self) -> std::result::Result<f64, Status> {
        let rho = dot(&self.shadow, &self.system.r);
        if negligible(rho, &self.shadow, &self.system.r) {
            return Err(Status::Breakdown("the residual is orthogonal to its shadow"));
        }
        let ratio = if self.rho == 0.0 { 0.0 } else { rho / self.rho };
        self.rho = rho;
        Ok(ratio)
    }

    /// `A M⁻¹ v`, into the system's `work`.
    pub(super) fn product(&mut self, operator: &mut dyn Adjoint, v: &[f64]) -> Result<()> {
        precondition(self.preconditioner.as_ref(), v, &mut self.hat)?;
        self.system.tally.product(operator, &self.hat, &mut self.system.work)
    }

    /// `A M⁻¹ r`, likewise.
    pub(super) fn residual_product(&mut self, operator: &mut dyn Adjoint) -> Result<()> {
        precondition(self.preconditioner.as_ref(), &self.system.r, &mut self.hat)?;
        self.system.tally.product(operator, &self.hat, &mut self.system.work)
    }

    /// `α = ρ / r̃ᵀ A M⁻¹ p` from the product in `work`.
    pub(super) fn alpha(&self) -> std::result::Result<f64, Status> {
        let sigma = dot(&self.shadow, &self.system.work);
        if negligible(sigma, &self.shadow, &self.system.work) {
            return Err(Status::Breakdown("a product is orthogonal to the residual's shadow"));
        }
        Ok(self.rho / sigma)
    }

    /// Closes a step that moved the iterate.
    pub(super) fn close(&mut self) -> Advance {
        let residual = norm(&self.system.r);
        self.system.note(residual);
        if residual.is_finite() {
            Advance::Continuing
        } else {
            Advance::Ended(Status::Breakdown("the residual grew beyond all bounds"))
        }
    }
}

/// An inner product that is zero but for rounding: dividing by it would return noise.
pub(super) fn negligible(product: f64, a: &[f64], b: &[f64]) -> bool {
    product.abs() <= f64::EPSILON * norm(a) * norm(b)
}
