//! CGS and BiCGStab. They need neither symmetry nor a transpose, because a fixed copy of the first residual replaces the transpose.

use super::place::{At, Dots};
use super::system::System;
use super::{Advance, Recurrence, SolveOptions, Solver, ended};
use crate::error::Result;
use crate::krylov::completeness::Status;
use crate::operator::Adjoint;

const RHO_VANISHED: Status = Status::Breakdown("the residual is orthogonal to its shadow");
const SIGMA_VANISHED: Status = Status::Breakdown("a product is orthogonal to the residual's shadow");

/// The shadow residual `r̃ = r_0`.
const SHADOW: At = At::Own(0);
const P: At = At::Own(1);
/// `A M⁻¹ p`.
const V: At = At::Own(2);

/// The inner products with the shadow, and the phase within an iteration of two products.
#[derive(Default)]
struct Shadowed {
    /// `‖r̃‖`.
    length: f64,
    /// `r̃ᵀ r` of the current residual, and of the last direction (0 before the first one).
    overlap: f64,
    rho: f64,
    phase: Phase,
}

#[derive(Clone, Copy, Default, PartialEq)]
enum Phase {
    #[default]
    Start,
    /// The next step computes a new direction.
    Direction,
    /// The next step takes the first product of the iteration.
    First,
    /// The next step takes the second product.
    Second,
}

impl Shadowed {
    /// Begins a step of a method with this number of vectors. Returns true if the step is already complete, because its product gave the
    /// residual of the first iterate.
    fn begin(&mut self, system: &mut System, operator: &mut dyn Adjoint, own: usize) -> Result<bool> {
        if system.begin(operator, [0, own])? {
            return Ok(true);
        }
        if self.phase == Phase::Start {
            system.combine(At::Work, &[(1.0, At::R)], 1.0)?;
            let Dots { square, norm, .. } = system.dots([])?;
            (self.overlap, self.length) = (square, norm);
            system.keep(SHADOW)?;
            self.phase = Phase::Direction;
        }
        Ok(false)
    }

    /// Returns `ρ_k / ρ_{k−1}` for the new direction, where `ρ = r̃ᵀ r`; 0 for the first direction. `None` means that `ρ_k` vanishes.
    fn advance_rho(&mut self, system: &System) -> Option<f64> {
        let rho = self.overlap;
        if negligible(rho, self.length, system.tally.residual) {
            return None;
        }
        let ratio = if self.rho == 0.0 { 0.0 } else { rho / self.rho };
        self.rho = rho;
        Some(ratio)
    }

    /// `α = ρ / r̃ᵀ A M⁻¹ p` from this product. `None` means that the divisor vanishes.
    fn alpha(&self, product: &Dots<1>) -> Option<f64> {
        let [sigma] = product.with;
        (!negligible(sigma, self.length, product.norm)).then(|| self.rho / sigma)
    }

    /// `r ← r − c w` in the place `to`, and `x ← x + c v`, for the product `w` of `v`. Ends a step.
    fn advance(&mut self, system: &mut System, (c, v): (f64, At), w: At, to: At) -> Result<Advance> {
        system.combine(At::Work, &[(1.0, At::R), (-c, w)], 1.0)?;
        let residual = system.dots([SHADOW])?;
        [self.overlap] = residual.with;
        system.keep(to)?;
        system.accept((c, v), residual.norm)?;
        match residual.norm.is_finite() {
            true => Ok(Advance::Continuing),
            false => ended(Status::Breakdown("the residual grew beyond all bounds")),
        }
    }
}

/// Returns true if an inner product of vectors of lengths `a` and `b` is zero to rounding. A quotient by this product would be noise.
fn negligible(product: f64, a: f64, b: f64) -> bool {
    product.abs() <= f64::EPSILON * a * b
}

/// Conjugate gradients squared: solves `A x = b` for any square `A` of `n × n`, preconditioned on the right.
///
/// The method needs no transpose. An iteration takes two products, and the iterate changes only after the second product. `‖r‖` is erratic,
/// so the best iterate is returned. The method ends with [`Breakdown`](crate::krylov::Status::Breakdown) if a divisor vanishes (for example
/// for a skew-symmetric `A`). The method stores eleven `n`-vectors: `b, x`, the best `x`, `r, r̃, u, p, q, v, u + q` and a product; with a
/// preconditioner also a preconditioned vector.
///
/// References: Sonneveld (1989), doi:10.1137/0910004.
#[derive(Default)]
pub struct Cgs {
    shared: Shadowed,
    alpha: f64,
}

const U: At = At::Own(3);
const Q: At = At::Own(4);
/// `u + q`, which the preconditioner is applied to.
const SUM: At = At::Own(5);
/// `M⁻¹` times the vector of the last product, if there is a preconditioner.
const HAT: At = At::Own(6);

impl Cgs {
    /// Makes the state before the first step, for `b` of length `n`. Reads `x0` and `preconditioner` of the options. Fails with the errors
    /// of [`Cg::solver`](crate::krylov::linear::Cg::solver), but accepts any preconditioner.
    pub fn solver(b: &[f64], options: &SolveOptions) -> Result<Solver> {
        Ok(Solver::new(System::split("CGS", false, b.len(), b, options)?, Self::default()))
    }
}

impl Recurrence for Cgs {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        if self.shared.begin(system, operator, if system.inverse.is_identity() { 6 } else { 7 })? {
            return Ok(Advance::Continuing);
        }
        if self.shared.phase == Phase::Direction {
            let Some(beta) = self.shared.advance_rho(system) else { return ended(RHO_VANISHED) };
            system.combine(U, &[(1.0, At::R), (beta, Q)], 1.0)?;
            // p ← u + β (q + β p)
            system.combine(P, &[(1.0, Q), (beta, P)], 1.0)?;
            system.combine(P, &[(1.0, U), (beta, P)], 1.0)?;
            self.shared.phase = Phase::First;
        }
        if self.shared.phase == Phase::First {
            let hat = system.preconditioned(P, HAT)?;
            let product = system.multiply(operator, (hat, system.tally.residual), [SHADOW])?;
            let Some(alpha) = self.shared.alpha(&product) else { return ended(SIGMA_VANISHED) };
            self.alpha = alpha;
            system.keep(V)?;
            system.combine(Q, &[(1.0, U), (-alpha, V)], 1.0)?;
            system.combine(SUM, &[(1.0, U), (1.0, Q)], 1.0)?;
            self.shared.phase = Phase::Second;
            return Ok(Advance::Continuing);
        }
        let hat = system.preconditioned(SUM, HAT)?;
        system.multiply(operator, (hat, system.tally.residual), [])?;
        self.shared.phase = Phase::Direction;
        self.shared.advance(system, (self.alpha, hat), At::Work, At::R)
    }

    fn leave(&mut self, system: &mut System) {
        if system.leave() {
            *self = Self::default();
        }
    }
}

/// BiCGStab: solves `A x = b` for any square `A` of `n × n`, preconditioned on the right.
///
/// The method needs no transpose. An iteration takes two products. After the first product, the iterate moves along the biconjugate
/// direction; after the second, it moves along the residual, by the step that minimizes the residual. `‖r‖` is not monotone, so the best
/// iterate is returned. The method ends with [`Status::Breakdown`] if a divisor vanishes. The method stores nine `n`-vectors: `b, x`, the
/// best `x`, `r, r̃, p, v`, a preconditioned vector or the next `r`, and a product.
///
/// References: van der Vorst (1992), doi:10.1137/0913035.
#[derive(Default)]
pub struct BiCgStab {
    shared: Shadowed,
    alpha: f64,
    omega: f64,
}

/// `M⁻¹` times the vector of the last product, or without a preconditioner the next residual.
const SPARE: At = At::Own(3);

impl BiCgStab {
    /// Makes the state before the first step, for `b` of length `n`. Reads `x0` and `preconditioner` of the options. Fails with the errors
    /// of [`Cg::solver`](crate::krylov::linear::Cg::solver), but accepts any preconditioner.
    pub fn solver(b: &[f64], options: &SolveOptions) -> Result<Solver> {
        Ok(Solver::new(System::split("BiCGStab", false, b.len(), b, options)?, Self::default()))
    }
}

impl Recurrence for BiCgStab {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        if self.shared.begin(system, operator, 4)? {
            return Ok(Advance::Continuing);
        }
        if self.shared.phase == Phase::Direction {
            let Some(ratio) = self.shared.advance_rho(system) else { return ended(RHO_VANISHED) };
            let beta = if ratio == 0.0 { 0.0 } else { ratio * (self.alpha / self.omega) };
            // p ← r + β (p − ω v)
            system.combine(P, &[(1.0, P), (-self.omega, V)], 1.0)?;
            system.combine(P, &[(1.0, At::R), (beta, P)], 1.0)?;
            self.shared.phase = Phase::First;
        }
        if self.shared.phase == Phase::First {
            // Moves along the biconjugate direction.
            let hat = system.preconditioned(P, SPARE)?;
            let product = system.multiply(operator, (hat, system.tally.residual), [SHADOW])?;
            let Some(alpha) = self.shared.alpha(&product) else { return ended(SIGMA_VANISHED) };
            self.alpha = alpha;
            system.keep(V)?;
            self.shared.phase = Phase::Second;
            return self.shared.advance(system, (alpha, hat), V, At::R);
        }
        // Moves along the residual, which holds `s` here.
        let hat = system.preconditioned(At::R, SPARE)?;
        let Dots { with: [overlap], square, norm } =
            system.multiply(operator, (hat, system.tally.residual), [At::R])?;
        if square == 0.0 || negligible(overlap, norm, system.tally.residual) {
            return ended(Status::Breakdown("a product is orthogonal to the residual"));
        }
        self.omega = overlap / square;
        self.shared.phase = Phase::Direction;
        let next = if hat == At::R { SPARE } else { At::R };
        let advance = self.shared.advance(system, (self.omega, hat), At::Work, next)?;
        if next == SPARE {
            system.exchange(SPARE, At::R);
        }
        Ok(advance)
    }

    fn leave(&mut self, system: &mut System) {
        if system.leave() {
            *self = Self::default();
        }
    }
}
