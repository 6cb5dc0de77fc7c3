//! Accelerated projected gradient.

use super::Boxed;
use crate::error::Result;
use crate::krylov::basis::{dot, norm, update, update2};
use crate::krylov::completeness::Status;
use crate::krylov::linear::{Advance, Recurrence, SolveOptions, Solver, System};
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
/// `r, D, y`, the last `x`, two residuals and two work vectors.
///
/// References: Beck and Teboulle (2009), doi:10.1137/080716542; restart: O'Donoghue and Candès (2015), doi:10.1007/s10208-013-9150-3.
pub struct Fista {
    boxed: Boxed,
    y: Vec<f64>,
    /// `b − A y`.
    misfit: Vec<f64>,
    /// The residual `b − A x` of the previous iterate, and the previous iterate.
    r_old: Vec<f64>,
    x_old: Vec<f64>,
    scratch: Vec<f64>,
    lipschitz: f64,
    t: f64,
    forward: bool,
    first: bool,
}

impl Fista {
    /// Makes the state before the first step, for `x` of length `cols`. Reads `x0`, `lower`, `upper` and `diagonal` of the options. If
    /// `A` is square, both may be missing; without `diagonal` the first product is `A 1`. Fails with the errors of
    /// [`ProjectedJacobi::solver`](crate::krylov::boxed::ProjectedJacobi::solver).
    pub fn solver(cols: usize, b: &[f64], options: &SolveOptions) -> Result<Solver> {
        let (system, boxed) = Boxed::new("FISTA", cols, b, options)?;
        let [y, x_old, scratch] = [(); 3].map(|()| vec![0.0; cols]);
        let [misfit, r_old] = [(); 2].map(|()| vec![0.0; b.len()]);
        let (lipschitz, t, forward, first) = (0.0, 1.0, true, true);
        let recurrence = Self { boxed, y, misfit, r_old, x_old, scratch, lipschitz, t, forward, first };
        Ok(Solver::new(system, recurrence))
    }

    /// Computes the next `y` and its residual from the product with `x`.
    fn extrapolate(&mut self, system: &mut System) {
        let mut momentum = 0.0;
        if !self.first {
            // The last step must satisfy ‖A(x − y)‖² ≤ L ‖x − y‖²_D.
            update2(&mut system.work, &system.r, &self.misfit, |_, rx, ry| rx - ry);
            let change = dot(&system.work, &system.work);
            update2(&mut self.scratch, &system.x, &self.y, |_, x, y| x - y);
            update(&mut self.scratch, &self.boxed.diagonal, |step, d| step * d.sqrt());
            let step = dot(&self.scratch, &self.scratch);
            if change > self.lipschitz * step * (1.0 + 1e-12) {
                self.lipschitz *= 2.0;
            }
            let t = 0.5 * (1.0 + (1.0 + 4.0 * self.t * self.t).sqrt());
            momentum = (self.t - 1.0) / t;
            self.t = t;
            if norm(&system.r) > norm(&self.r_old) {
                // The last step went uphill, so the momentum is reset (the function scheme of O'Donoghue and Candès, which costs no product
                // here).
                self.t = 1.0;
                momentum = 0.0;
            }
        }
        update2(&mut self.y, &system.x, &self.x_old, |_, x, old| x + momentum * (x - old));
        update2(&mut self.misfit, &system.r, &self.r_old, |_, r, old| r + momentum * (r - old));
        self.x_old.copy_from_slice(&system.x);
        self.r_old.copy_from_slice(&system.r);
        self.first = false;
    }
}

impl Recurrence for Fista {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        if self.boxed.take_diagonal(system, operator)? {
            return Ok(Advance::Continuing);
        }
        if self.first {
            self.lipschitz = self.boxed.diagonal.iter().copied().fold(0.0, f64::max);
        }
        if self.forward {
            system.tally.product(operator, &system.x, &mut system.work)?;
            system.settle();
            self.extrapolate(system);
            self.forward = false;
            return Ok(Advance::Continuing);
        }
        system.tally.adjoint(operator, &self.misfit, &mut self.scratch)?;
        let (bounds, lipschitz) = (self.boxed.bounds, self.lipschitz);
        system.x.copy_from_slice(&self.y);
        update2(&mut system.x, &self.scratch, &self.boxed.diagonal, |y, g, d| {
            bounds.clip(y + g / (lipschitz * d))
        });
        self.forward = true;
        Ok(if system.x == self.x_old && self.y == self.x_old {
            Advance::Ended(Status::ConstrainedOptimum)
        } else {
            Advance::Continuing
        })
    }
}
