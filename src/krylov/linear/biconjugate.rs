//! CGS and BiCGStab. They need neither symmetry nor a transpose: a fixed shadow of the first residual replaces the transpose.

use super::system::System;
use super::{Advance, SolveOptions, Solver};
use crate::error::Result;
use crate::krylov::basis::{axpy, dot, norm, update2};
use crate::krylov::completeness::Status;
use crate::operator::Adjoint;

/// A system, its shadow residual `r̃ = r_0`, and the stage within an iteration of two products.
#[derive(Clone)]
struct Shadowed {
    system: System,
    shadow: Vec<f64>,
    /// `M⁻¹` times the last vector multiplied.
    hat: Vec<f64>,
    rho: f64,
    phase: Phase,
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
    fn new(method: &str, b: &[f64], options: &SolveOptions) -> Result<Self> {
        Ok(Self {
            system: System::split(method, false, b.len(), b, options)?,
            shadow: vec![0.0; b.len()],
            hat: vec![0.0; b.len()],
            rho: 0.0,
            phase: Phase::Start,
        })
    }

    /// Begins a step. Returns true if the step took its product for the residual of the first iterate and is complete.
    fn open(&mut self, operator: &mut dyn Adjoint) -> Result<bool> {
        if self.system.open(operator, None)? {
            return Ok(true);
        }
        if self.phase == Phase::Start {
            self.shadow.copy_from_slice(&self.system.r);
            self.phase = Phase::Direction;
        }
        Ok(false)
    }

    /// `ρ_k / ρ_{k−1}` for the new direction, 0 for the first; `ρ = r̃ᵀ r`.
    fn advance_rho(&mut self) -> std::result::Result<f64, Status> {
        let rho = dot(&self.shadow, &self.system.r);
        if negligible(rho, &self.shadow, &self.system.r) {
            return Err(Status::Breakdown("the residual is orthogonal to its shadow"));
        }
        let ratio = if self.rho == 0.0 { 0.0 } else { rho / self.rho };
        self.rho = rho;
        Ok(ratio)
    }

    /// Writes `A M⁻¹ v` to the system's `work`.
    fn product(&mut self, operator: &mut dyn Adjoint, v: &[f64]) -> Result<()> {
        self.system.precondition(v, &mut self.hat)?;
        self.system.tally.product(operator, &self.hat, &mut self.system.work)
    }

    /// Writes `A M⁻¹ r` to the system's `work`.
    fn residual_product(&mut self, operator: &mut dyn Adjoint) -> Result<()> {
        self.system.precondition(&self.system.r, &mut self.hat)?;
        self.system.tally.product(operator, &self.hat, &mut self.system.work)
    }

    /// `α = ρ / r̃ᵀ A M⁻¹ p` from the product in `work`.
    fn alpha(&self) -> std::result::Result<f64, Status> {
        let sigma = dot(&self.shadow, &self.system.work);
        if negligible(sigma, &self.shadow, &self.system.work) {
            return Err(Status::Breakdown("a product is orthogonal to the residual's shadow"));
        }
        Ok(self.rho / sigma)
    }

    /// Ends a step that moved the iterate.
    fn close(&mut self) -> Advance {
        let residual = norm(&self.system.r);
        self.system.note(residual);
        if residual.is_finite() {
            Advance::Continuing
        } else {
            Advance::Ended(Status::Breakdown("the residual grew beyond all bounds"))
        }
    }
}

/// Returns true if an inner product is zero to rounding: a quotient by it would be noise.
fn negligible(product: f64, a: &[f64], b: &[f64]) -> bool {
    product.abs() <= f64::EPSILON * norm(a) * norm(b)
}

/// Conjugate gradients squared: solves `A x = b` for any square `A` of `n × n`, preconditioned on the right.
///
/// The method needs no transpose. An iteration takes two products, and the iterate moves with the second. `‖r‖` is erratic, so the best
/// iterate is returned. The method ends with [`Breakdown`](crate::krylov::Status::Breakdown) if a divisor vanishes (for example for a
/// skew-symmetric `A`). The method stores twelve `n`-vectors: `b, x`, the best `x`, `r, r̃, u, p, q, v`, two preconditioned vectors, and a
/// product.
///
/// References: Sonneveld (1989), doi:10.1137/0910004.
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
    /// Makes the state before the first step, for `b` of length `n`. Reads `x0` and `preconditioner` of the options. Fails with the errors
    /// of [`Cg::new`](crate::krylov::linear::Cg::new), but accepts any preconditioner.
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

    fn system(&self) -> &System {
        &self.shared.system
    }
}

/// BiCGStab: solves `A x = b` for any square `A` of `n × n`, preconditioned on the right.
///
/// The method needs no transpose. An iteration takes two products, and each moves the iterate: the first along the biconjugate direction,
/// the second along the residual, by the step that minimizes it. `‖r‖` is not monotone; the best iterate is returned. The method ends with
/// [`Status::Breakdown`] if a divisor vanishes. The method stores nine `n`-vectors: `b, x`, the best `x`, `r, r̃, p, v`, a preconditioned
/// vector and a product.
///
/// References: van der Vorst (1992), doi:10.1137/0913035.
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
    /// Makes the state before the first step, for `b` of length `n`. Reads `x0` and `preconditioner` of the options. Fails with the errors
    /// of [`Cg::new`](crate::krylov::linear::Cg::new), but accepts any preconditioner.
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
            // Moves along the biconjugate direction.
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
            // Moves along the residual, which holds `s` here.
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

    fn system(&self) -> &System {
        &self.shared.system
    }
}
