//! Projected Jacobi iteration, the baseline.

use super::super::basis::norm;
use super::super::linear::{Advance, SolveOptions, Solver, Tally};
use super::super::stats::Status;
use super::super::vectors::update2;
use super::bounds::Boxed;
use crate::error::Result;
use crate::operator::Adjoint;

/// Projected Jacobi: seeks `A x = b` in the box for any square `A` of `n × n`, by
/// `x ← clip(x + (b − A x) / D)`.
///
/// # Properties
/// One product an iteration; needs neither transpose nor symmetry. For a non-negative symmetric `A` with
/// `D = A 1` the step is a contraction where direct light dominates. At its fixed point the signs of
/// `b − A x` fit the bounds, and not those of `Aᵀ(b − A x)`. So it ends near the least-squares optimum but
/// not at it, and may pass a better point; the best iterate is returned.
///
/// # Storage
/// Seven `n`-vectors: `b, x`, the best `x`, `r, D`, the next `x` and a product.
///
/// # References
/// Projected Richardson iteration with diagonal scaling; Bertsekas and Tsitsiklis, *Parallel and Distributed
/// Computation*, section 3.3 (1989). Its use for compensation: Grossberg, Peri, Nayar and Belhumeur (2004),
/// doi:10.1109/CVPR.2004.1315065.
#[derive(Clone)]
pub struct ProjectedJacobi {
    boxed: Boxed,
    next: Vec<f64>,
}

impl ProjectedJacobi {
    /// The state before the first step, for `b` of length `n`. Reads `x0`, `lower`, `upper` and `diagonal` of
    /// the options; without `diagonal` the first product is `A 1`.
    ///
    /// # Errors
    /// [`Error::Dimension`](crate::Error::Dimension) when lengths differ,
    /// [`Error::Numerical`](crate::Error::Numerical) for NaN, [`Error::Option`](crate::Error::Option) for a
    /// preconditioner or an empty box.
    pub fn new(b: &[f64], options: &SolveOptions) -> Result<Self> {
        Ok(Self { boxed: Boxed::new("projected Jacobi", b, options)?, next: vec![0.0; b.len()] })
    }
}

impl Solver for ProjectedJacobi {
    fn step(&mut self, operator: &mut dyn Adjoint) -> Result<Advance> {
        let boxed = &mut self.boxed;
        boxed.system.fits(operator)?;
        if boxed.take_diagonal(operator)? {
            return Ok(Advance::Continuing);
        }
        let bounds = boxed.bounds;
        self.next.copy_from_slice(&boxed.system.x);
        if !boxed.system.pending {
            update2(&mut self.next, &boxed.system.r, &boxed.diagonal, |x, r, d| bounds.clip(x + r / d));
            if self.next == boxed.system.x {
                return Ok(Advance::Ended(Status::Stalled));
            }
        }
        boxed.system.tally.product(operator, &self.next, &mut boxed.system.work)?;
        boxed.system.pending = false;
        std::mem::swap(&mut boxed.system.x, &mut self.next);
        boxed.residual_from_work();
        let residual = norm(&boxed.system.r);
        boxed.system.note(residual);
        Ok(Advance::Continuing)
    }

    fn tally(&self) -> Tally {
        self.boxed.system.tally()
    }

    fn solution(&self) -> Vec<f64> {
        self.boxed.system.best()
    }
}
