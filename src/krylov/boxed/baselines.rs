//! Simple methods for comparison: projected Jacobi, MRNSD and multiplicative updates.

use super::Boxed;
use crate::error::Result;
use crate::krylov::basis::{axpy, dot, update2};
use crate::krylov::completeness::Status;
use crate::krylov::linear::{Advance, At, Recurrence, SolveOptions, Solver, System, ended};
use crate::operator::Adjoint;

/// Projected Jacobi: seeks `A x = b` in the box for any square `A` of `n × n`, by `x ← clip(x + (b − A x) / D)`.
///
/// The method takes one product per iteration and needs neither transpose nor symmetry. For a non-negative symmetric `A` with `D = A 1`,
/// the step is a contraction where direct light dominates. At its fixed point the signs of `b − A x` fit the bounds, but the signs of
/// `Aᵀ(b − A x)` need not. The method therefore ends near the least-squares optimum but not at it, and may pass a better point. The best
/// iterate is returned. The method stores seven `n`-vectors: `b, x`, the best `x`, `r, D`, the next `x` and a product.
///
/// References: Projected Richardson iteration with diagonal scaling; Bertsekas and Tsitsiklis, *Parallel and Distributed Computation*,
/// section 3.3 (1989). Its use for compensation: Grossberg, Peri, Nayar and Belhumeur (2004), doi:10.1109/CVPR.2004.1315065.
pub struct ProjectedJacobi(Boxed);

/// The next iterate of [`ProjectedJacobi`].
const NEXT: At = At::Own(0);

impl ProjectedJacobi {
    /// Makes the state before the first step, for `b` of length `n`. Reads `x0`, `lower`, `upper` and
    /// `diagonal` of the options; without `diagonal` the first product is `A 1`.
    ///
    /// # Errors
    /// [`Error::Dimension`](crate::Error::Dimension) if lengths differ, [`Error::Numerical`](crate::Error::Numerical) for NaN,
    /// [`Error::Option`](crate::Error::Option) for a preconditioner or an empty box.
    pub fn solver(b: &[f64], options: &SolveOptions) -> Result<Solver> {
        let (system, boxed) = Boxed::new("projected Jacobi", b.len(), b, options)?;
        Ok(Solver::new(system, Self(boxed)))
    }
}

impl Recurrence for ProjectedJacobi {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        let Self(boxed) = self;
        if boxed.begin(system, operator, [0, 1])? {
            return Ok(Advance::Continuing);
        }
        system.combine(At::Work, &[(1.0, At::R)], 1.0)?;
        boxed.step(system, NEXT, At::X, 1.0)?;
        if system.distance(NEXT, At::X)? == 0.0 {
            return ended(Status::Stalled);
        }
        system.multiply(operator, (NEXT, 1.0), [])?;
        system.exchange(At::X, NEXT);
        Boxed::settle(system)?;
        Ok(Advance::Continuing)
    }

    fn leave(&mut self, system: &mut System) {
        system.leave();
    }
}

/// MRNSD: minimizes `½ ‖A x − b‖²` over `x ≥ 0`, for any square `A` of `n × n` with its transpose. The method is steepest descent in the
/// metric of `1/x`, which keeps `x > 0`. It serves as a baseline.
///
/// `‖r‖` falls monotonically. An iteration takes two products, `Aᵀ r` and `A s`. The method respects only `x ≥ 0` and ignores the bounds of
/// the options. It starts from `x0`, or from `b / D`, and raises small entries of this start, so that all are positive. The method stores
/// seven `n`-vectors: `b, x`, the best `x`, `r, D`, a direction and a product.
///
/// References: Kaufman (1993), doi:10.1109/42.232243; Nagy and Strakoš (2000), doi:10.1117/12.402439.
pub struct Mrnsd {
    boxed: Boxed,
    s: Vec<f64>,
    /// `sᵀ Aᵀ r`.
    gamma: f64,
    descend: bool,
}

impl Mrnsd {
    /// Makes the state before the first step, for `b` of length `n`. Reads `x0` and `diagonal` of the options; without `diagonal` the first
    /// product is `A 1`. Fails with the errors of [`ProjectedJacobi::solver`](crate::krylov::boxed::ProjectedJacobi::solver).
    pub fn solver(b: &[f64], options: &SolveOptions) -> Result<Solver> {
        let options = SolveOptions { lower: 0.0, upper: f64::INFINITY, ..options.clone() };
        let (system, boxed) = Boxed::new("MRNSD", b.len(), b, &options)?;
        Ok(Solver::new(system, Self { boxed, s: vec![0.0; b.len()], gamma: 0.0, descend: false }))
    }
}

/// Raises small entries of the first iterate to a share of the largest entry, because an entry that is zero stays zero.
fn make_positive(x: &mut [f64]) {
    let largest = x.iter().copied().fold(0.0, f64::max);
    let floor = if largest > 0.0 { 1e-3 * largest } else { 1.0 };
    for value in x {
        *value = value.max(floor);
    }
}

impl Recurrence for Mrnsd {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        if self.boxed.take_diagonal(system, operator)? {
            return Ok(Advance::Continuing);
        }
        if system.pending {
            make_positive(&mut system.x);
            system.first_residual(operator)?;
            return Ok(Advance::Continuing);
        }
        if !self.descend {
            system.tally.adjoint(operator, &system.r, &mut system.work)?;
            update2(&mut self.s, &system.x, &system.work, |_, x, g| x * g);
            self.gamma = dot(&self.s, &system.work);
            if self.gamma <= 0.0 {
                return ended(Status::ConstrainedOptimum);
            }
            self.descend = true;
            return Ok(Advance::Continuing);
        }
        system.tally.product(operator, &self.s, &mut system.work)?;
        let square = dot(&system.work, &system.work);
        let mut tau = if square > 0.0 { self.gamma / square } else { 0.0 };
        for (x, s) in system.x.iter().zip(&self.s) {
            if *s < 0.0 {
                tau = tau.min(-x / s);
            }
        }
        axpy(tau, &self.s, &mut system.x);
        axpy(-tau, &system.work, &mut system.r);
        for x in &mut system.x {
            *x = x.max(0.0);
        }
        self.descend = false;
        system.note_residual();
        Ok(if tau == 0.0 { Advance::Ended(Status::Stalled) } else { Advance::Continuing })
    }
}

/// The image space reconstruction algorithm: minimizes `‖A x − b‖` over `x ≥ 0`, for a square `A ≥ 0` of
/// `n × n` with its transpose and `b ≥ 0`, by `x ← x ∘ (Aᵀb) / (AᵀA x)`. It serves as a baseline.
///
/// `‖r‖` falls monotonically for non-negative `A` and `b`. The method first takes one product with `Aᵀ`, and then two products per
/// iteration, `A x` and `Aᵀ(A x)`. It respects only `x ≥ 0` and ignores the bounds of the options. The method stores eight `n`-vectors:
/// `b, x`, the best `x`, `r, D, Aᵀb, A x` and a product.
///
/// References: Daube-Witherspoon and Muehllehner (1986), doi:10.1109/TMI.1986.4307748; Lee and Seung's updates (2001) for one factor.
pub struct Multiplicative {
    boxed: Boxed,
    /// `Aᵀ b` with negative entries replaced by 0; empty until it is known.
    numerator: Vec<f64>,
    image: Vec<f64>,
    forward: bool,
}

impl Multiplicative {
    /// Makes the state before the first step, for `b` of length `n`. Reads `x0` and `diagonal` of the options; without `diagonal` the first
    /// product is `A 1`. Fails with the errors of [`ProjectedJacobi::solver`](crate::krylov::boxed::ProjectedJacobi::solver).
    pub fn solver(b: &[f64], options: &SolveOptions) -> Result<Solver> {
        let options = SolveOptions { lower: 0.0, upper: f64::INFINITY, ..options.clone() };
        let (system, boxed) = Boxed::new("multiplicative updates", b.len(), b, &options)?;
        let (numerator, image) = (Vec::new(), vec![0.0; b.len()]);
        Ok(Solver::new(system, Self { boxed, numerator, image, forward: true }))
    }
}

impl Recurrence for Multiplicative {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        if self.boxed.take_diagonal(system, operator)? {
            return Ok(Advance::Continuing);
        }
        if self.numerator.is_empty() {
            system.tally.adjoint(operator, &system.b, &mut system.work)?;
            self.numerator = system.work.iter().map(|value| value.max(0.0)).collect();
            return Ok(Advance::Continuing);
        }
        if self.forward {
            if system.pending {
                make_positive(&mut system.x);
            }
            system.tally.product(operator, &system.x, &mut system.work)?;
            self.image.copy_from_slice(&system.work);
            system.settle();
            self.forward = false;
            return Ok(Advance::Continuing);
        }
        system.tally.adjoint(operator, &self.image, &mut system.work)?;
        update2(&mut system.x, &self.numerator, &system.work, |x, above, below| {
            if below > 0.0 { x * above / below } else { x }
        });
        self.forward = true;
        Ok(Advance::Continuing)
    }
}
