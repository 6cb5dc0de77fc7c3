//! CGS and BiCGStab. They need neither symmetry nor a transpose, because a fixed copy of the first residual replaces the transpose.

use super::system::System;
use super::{Advance, Recurrence, SolveOptions, Solver, ended};
use crate::error::Result;
use crate::krylov::basis::{axpy, dot, norm, update2};
use crate::krylov::completeness::Status;
use crate::operator::Adjoint;

const RHO_VANISHED: Status = Status::Breakdown("the residual is orthogonal to its shadow");
const SIGMA_VANISHED: Status = Status::Breakdown("a product is orthogonal to the residual's shadow");

/// The shadow residual `r̃ = r_0`, and the phase within an iteration of two products.
struct Shadowed {
    shadow: Vec<f64>,
    /// `M⁻¹` times the vector of the last product.
    hat: Vec<f64>,
    rho: f64,
    phase: Phase,
}

#[derive(Clone, Copy, PartialEq)]
enum Phase {
    Start,
    /// The next step computes a new direction.
    Direction,
    /// The next step takes the first product of the iteration.
    First,
    /// The next step takes the second product.
    Second,
}

impl Shadowed {
    fn new(n: usize) -> Self {
        Self { shadow: vec![0.0; n], hat: vec![0.0; n], rho: 0.0, phase: Phase::Start }
    }

    /// Begins a step. Returns true if the step is already complete, because its product gave the residual of the first iterate.
    fn open(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<bool> {
        if system.open(operator)? {
            return Ok(true);
        }
        if self.phase == Phase::Start {
            self.shadow.copy_from_slice(&system.r);
            self.phase = Phase::Direction;
        }
        Ok(false)
    }

    /// Returns `ρ_k / ρ_{k−1}` for the new direction, where `ρ = r̃ᵀ r`; 0 for the first direction. `None` means that `ρ_k` vanishes.
    fn advance_rho(&mut self, system: &System) -> Option<f64> {
        let rho = dot(&self.shadow, &system.r);
        if negligible(rho, &self.shadow, &system.r) {
            return None;
        }
        let ratio = if self.rho == 0.0 { 0.0 } else { rho / self.rho };
        self.rho = rho;
        Some(ratio)
    }

    /// Writes `A M⁻¹ v` to the system's `work`. If `v` is `None`, `v` is the residual.
    fn product(&mut self, system: &mut System, operator: &mut dyn Adjoint, v: Option<&[f64]>) -> Result<()> {
        system.inverse.apply(v.unwrap_or(&system.r), &mut self.hat)?;
        system.tally.product(operator, &self.hat, &mut system.work)
    }

    /// `α = ρ / r̃ᵀ A M⁻¹ p` from the product in `work`. `None` means that the divisor vanishes.
    fn alpha(&self, system: &System) -> Option<f64> {
        let sigma = dot(&self.shadow, &system.work);
        (!negligible(sigma, &self.shadow, &system.work)).then(|| self.rho / sigma)
    }

    /// Ends a step that changed the iterate.
    fn close(&mut self, system: &mut System, next: Phase) -> Result<Advance> {
        self.phase = next;
        match system.note_residual().is_finite() {
            true => Ok(Advance::Continuing),
            false => ended(Status::Breakdown("the residual grew beyond all bounds")),
        }
    }
}

/// Returns true if an inner product of `a` and `b` is zero to rounding. A quotient by this product would be noise.
fn negligible(product: f64, a: &[f64], b: &[f64]) -> bool {
    product.abs() <= f64::EPSILON * norm(a) * norm(b)
}

/// Conjugate gradients squared: solves `A x = b` for any square `A` of `n × n`, preconditioned on the right.
///
/// The method needs no transpose. An iteration takes two products, and the iterate changes only after the second product. `‖r‖` is erratic,
/// so the best iterate is returned. The method ends with [`Breakdown`](crate::krylov::Status::Breakdown) if a divisor vanishes (for example
/// for a skew-symmetric `A`). The method stores twelve `n`-vectors: `b, x`, the best `x`, `r, r̃, u, p, q, v`, two preconditioned vectors,
/// and a product.
///
/// References: Sonneveld (1989), doi:10.1137/0910004.
pub struct Cgs {
    shared: Shadowed,
    u: Vec<f64>,
    p: Vec<f64>,
    q: Vec<f64>,
    /// `A M⁻¹ p`.
    v: Vec<f64>,
    /// `u + q`, which the preconditioner is applied to.
    sum: Vec<f64>,
    alpha: f64,
}

impl Cgs {
    /// Makes the state before the first step, for `b` of length `n`. Reads `x0` and `preconditioner` of the options. Fails with the errors
    /// of [`Cg::solver`](crate::krylov::linear::Cg::solver), but accepts any preconditioner.
    pub fn solver(b: &[f64], options: &SolveOptions) -> Result<Solver> {
        let [u, p, q, v, sum] = [(); 5].map(|()| vec![0.0; b.len()]);
        let recurrence = Self { shared: Shadowed::new(b.len()), u, p, q, v, sum, alpha: 0.0 };
        Ok(Solver::new(System::split("CGS", false, b.len(), b, options)?, recurrence))
    }
}

impl Recurrence for Cgs {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        if self.shared.open(system, operator)? {
            return Ok(Advance::Continuing);
        }
        if self.shared.phase == Phase::Direction {
            let Some(beta) = self.shared.advance_rho(system) else { return ended(RHO_VANISHED) };
            update2(&mut self.u, &system.r, &self.q, |_, r, q| r + beta * q);
            update2(&mut self.p, &self.u, &self.q, |p, u, q| u + beta * (q + beta * p));
            self.shared.phase = Phase::First;
        }
        if self.shared.phase == Phase::First {
            self.shared.product(system, operator, Some(&self.p))?;
            let Some(alpha) = self.shared.alpha(system) else { return ended(SIGMA_VANISHED) };
            self.alpha = alpha;
            self.v.copy_from_slice(&system.work);
            update2(&mut self.q, &self.u, &self.v, |_, u, v| u - alpha * v);
            update2(&mut self.sum, &self.u, &self.q, |_, u, q| u + q);
            self.shared.phase = Phase::Second;
            return Ok(Advance::Continuing);
        }
        self.shared.product(system, operator, Some(&self.sum))?;
        axpy(self.alpha, &self.shared.hat, &mut system.x);
        axpy(-self.alpha, &system.work, &mut system.r);
        self.shared.close(system, Phase::Direction)
    }
}

/// BiCGStab: solves `A x = b` for any square `A` of `n × n`, preconditioned on the right.
///
/// The method needs no transpose. An iteration takes two products. After the first product, the iterate moves along the biconjugate
/// direction; after the second, it moves along the residual, by the step that minimizes the residual. `‖r‖` is not monotone, so the best
/// iterate is returned. The method ends with [`Status::Breakdown`] if a divisor vanishes. The method stores nine `n`-vectors: `b, x`, the
/// best `x`, `r, r̃, p, v`, a preconditioned vector and a product.
///
/// References: van der Vorst (1992), doi:10.1137/0913035.
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
    /// of [`Cg::solver`](crate::krylov::linear::Cg::solver), but accepts any preconditioner.
    pub fn solver(b: &[f64], options: &SolveOptions) -> Result<Solver> {
        let [p, v] = [(); 2].map(|()| vec![0.0; b.len()]);
        let recurrence = Self { shared: Shadowed::new(b.len()), p, v, alpha: 0.0, omega: 0.0 };
        Ok(Solver::new(System::split("BiCGStab", false, b.len(), b, options)?, recurrence))
    }
}

impl Recurrence for BiCgStab {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        if self.shared.open(system, operator)? {
            return Ok(Advance::Continuing);
        }
        if self.shared.phase == Phase::Direction {
            let Some(ratio) = self.shared.advance_rho(system) else { return ended(RHO_VANISHED) };
            let omega = self.omega;
            let beta = if ratio == 0.0 { 0.0 } else { ratio * (self.alpha / omega) };
            update2(&mut self.p, &system.r, &self.v, |p, r, v| r + beta * (p - omega * v));
            self.shared.phase = Phase::First;
        }
        if self.shared.phase == Phase::First {
            // Moves along the biconjugate direction.
            self.shared.product(system, operator, Some(&self.p))?;
            let Some(alpha) = self.shared.alpha(system) else { return ended(SIGMA_VANISHED) };
            self.alpha = alpha;
            self.v.copy_from_slice(&system.work);
            axpy(self.alpha, &self.shared.hat, &mut system.x);
            axpy(-self.alpha, &self.v, &mut system.r);
            self.shared.close(system, Phase::Second)
        } else {
            // Moves along the residual, which holds `s` here.
            self.shared.product(system, operator, None)?;
            let square = dot(&system.work, &system.work);
            let overlap = dot(&system.work, &system.r);
            if square == 0.0 || negligible(overlap, &system.work, &system.r) {
                return ended(Status::Breakdown("a product is orthogonal to the residual"));
            }
            self.omega = overlap / square;
            axpy(self.omega, &self.shared.hat, &mut system.x);
            axpy(-self.omega, &system.work, &mut system.r);
            self.shared.close(system, Phase::Direction)
        }
    }
}
