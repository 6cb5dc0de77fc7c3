//! The state shared by CGS and BiCGStab: the fixed shadow residual, and the scalars computed with it.

use std::sync::Arc;

use super::super::basis::{dot, norm};
use super::super::precondition::Preconditioner;
use super::super::stats::Status;
use super::system::{System, square};
use super::{Advance, SolveOptions, precondition, refuse_left};
use crate::error::Result;
use crate::operator::Adjoint;

/// A system, its shadow residual `r̃ = r_0`, and the stage within an iteration of two products.
#[derive(Clone)]
pub(super) struct Shadowed {
    pub(super) system: System,
    preconditioner: Option<Arc<dyn Preconditioner>>,
    shadow: Vec<f64>,
    /// `M⁻¹` times the vector that was multiplied last.
    pub(super) hat: Vec<f64>,
    rho: f64,
    pub(super) phase: Phase,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Phase {
    Start,
    /// The next step computes a new direction.
    Direction,
    /// The next step takes the first product of the iteration.
    First,
    /// The next step takes the second product.
    Second,
}

impl Shadowed {
    /// The state before the first step, for `b` of length `n`.
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

    /// Begins a step. `true` when the step took its product for the residual of the first iterate, and is
    /// complete.
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

    /// `A M⁻¹ r`, into the system's `work`.
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

    /// Ends a step that moved the iterate.
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

/// Whether an inner product is zero to rounding: a quotient by it would be noise.
pub(super) fn negligible(product: f64, a: &[f64], b: &[f64]) -> bool {
    product.abs() <= f64::EPSILON * norm(a) * norm(b)
}
