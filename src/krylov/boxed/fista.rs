//! Accelerated projected gradient.

use super::Boxed;
use crate::error::Result;
use crate::krylov::completeness::Status;
use crate::krylov::linear::{Advance, At, Recurrence, SolveOptions, Solver, System};
use crate::operator::Adjoint;

/// FISTA with adaptive restart: minimizes `½ ‖A x − b‖²` over the box, for any `A` of `m × n` with its transpose, in the metric of `D`:
///
/// ```text
/// x⁺ = clip(y − (L D)⁻¹ Aᵀ(A y − b)),    y⁺ = x⁺ + (t − 1)/t⁺ · (x⁺ − x)
/// ```
///
/// The method converges to the constrained optimum. It takes two products per iteration, `A x` and `Aᵀ r` (for a symmetric operator both
/// are products with `A`); `A y` follows from the products with the iterates `x` by linearity. For a non-negative symmetric `A` with
/// `D = A 1`, `L = max D` bounds the curvature in this metric, because `D^-½ A D^-½` has norm 1. If a product shows that `L` is too small,
/// the method doubles `L`. The momentum is reset when it points uphill. The method stores eleven `n`-vectors: `b, x`, the best `x`,
/// `r, D, D^½, y`, the last `x`, two residuals and a product.
///
/// References: Beck and Teboulle (2009), doi:10.1137/080716542; restart: O'Donoghue and Candès (2015), doi:10.1007/s10208-013-9150-3.
pub struct Fista {
    boxed: Boxed,
    lipschitz: f64,
    t: f64,
    /// `‖b − A x‖` of the previous iterate.
    before: f64,
    next: Next,
}

#[derive(Clone, Copy, PartialEq)]
enum Next {
    Start,
    Adjoint,
    Forward,
}

/// `b − A y`.
const MISFIT: At = At::Own(0);
/// The residual `b − A x` of the previous iterate.
const R_OLD: At = At::Own(1);
const Y: At = At::Own(2);
/// The previous iterate.
const X_OLD: At = At::Own(3);
/// `D^½`.
const ROOT: At = At::Own(4);

impl Fista {
    /// Makes the state before the first step, for `x` of length `cols`. Reads `x0`, `lower`, `upper` and `diagonal` of the options. If
    /// `A` is square, both may be missing; without `diagonal` the first product is `A 1`. Fails with the errors of
    /// [`ProjectedJacobi::solver`](crate::krylov::boxed::ProjectedJacobi::solver).
    pub fn solver(cols: usize, b: &[f64], options: &SolveOptions) -> Result<Solver> {
        let (system, boxed) = Boxed::new("FISTA", cols, b, options)?;
        Ok(Solver::new(system, Self { boxed, lipschitz: 0.0, t: 1.0, before: 0.0, next: Next::Start }))
    }

    /// Makes the state after the product with the first iterate.
    fn start(&mut self, system: &mut System) -> Result<()> {
        self.lipschitz = self.boxed.diagonal.iter().copied().fold(0.0, f64::max);
        self.t = 1.0;
        system.set(ROOT, self.boxed.diagonal.iter().map(|d| d.sqrt()).collect())?;
        for (to, from) in [(Y, At::X), (X_OLD, At::X), (MISFIT, At::R), (R_OLD, At::R)] {
            system.combine(to, &[(1.0, from)], 1.0)?;
        }
        self.before = system.tally.residual;
        self.next = Next::Adjoint;
        Ok(())
    }

    /// Computes the next `y` and its residual from the product with `x`.
    fn extrapolate(&mut self, system: &mut System) -> Result<()> {
        // The last step must satisfy ‖A(x − y)‖² ≤ L ‖x − y‖²_D.
        system.combine(At::Work, &[(1.0, At::R), (-1.0, MISFIT)], 1.0)?;
        let change = system.dots([])?.square;
        system.combine(At::Work, &[(1.0, At::X), (-1.0, Y)], 1.0)?;
        system.scale_by(ROOT)?;
        let step = system.dots([])?.square;
        if change > self.lipschitz * step * (1.0 + 1e-12) {
            self.lipschitz *= 2.0;
        }
        let t = 0.5 * (1.0 + (1.0 + 4.0 * self.t * self.t).sqrt());
        let mut momentum = (self.t - 1.0) / t;
        self.t = t;
        if system.tally.residual > self.before {
            // The last step went uphill, so the momentum is reset (the function scheme of O'Donoghue and Candès, which costs no product
            // here).
            self.t = 1.0;
            momentum = 0.0;
        }
        self.before = system.tally.residual;
        for (to, new, old) in [(Y, At::X, X_OLD), (MISFIT, At::R, R_OLD)] {
            system.combine(old, &[(1.0, new), (-1.0, old)], 1.0)?;
            system.combine(to, &[(1.0, new), (momentum, old)], 1.0)?;
            system.combine(old, &[(1.0, new)], 1.0)?;
        }
        Ok(())
    }
}

impl Recurrence for Fista {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        if self.boxed.begin(system, operator, [2, 3])? {
            return Ok(Advance::Continuing);
        }
        if self.next == Next::Start {
            self.start(system)?;
        }
        if self.next == Next::Forward {
            system.multiply(operator, (At::X, 1.0), [])?;
            Boxed::settle(system)?;
            self.extrapolate(system)?;
            self.next = Next::Adjoint;
            return Ok(Advance::Continuing);
        }
        system.multiply_adjoint(operator, MISFIT)?;
        self.boxed.step(system, At::X, Y, self.lipschitz)?;
        self.next = Next::Forward;
        let has_ended = system.distance(At::X, X_OLD)? == 0.0 && system.distance(Y, X_OLD)? == 0.0;
        Ok(if has_ended { Advance::Ended(Status::ConstrainedOptimum) } else { Advance::Continuing })
    }

    fn leave(&mut self, system: &mut System) {
        if system.leave() {
            self.next = Next::Start;
        }
    }
}
