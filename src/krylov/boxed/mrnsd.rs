//! Modified residual norm steepest descent.

use super::super::basis::{dot, norm};
use super::super::linear::{Advance, SolveOptions, Solver, Tally};
use super::super::stats::Status;
use super::super::vectors::{axpy, update2};
use super::bounds::Boxed;
use crate::error::Result;
use crate::operator::Adjoint;

/// MRNSD: minimizes `½ ‖A x − b‖²` over `x ≥ 0`, for any square `A` of `n × n` with its transpose, by
/// steepest descent in the metric of `1/x`, which keeps `x > 0`. A baseline.
///
/// # Properties
/// `‖r‖` falls monotonically. Two products an iteration, `Aᵀ r` and `A s`. Respects only `x ≥ 0`; ignores
/// the bounds of the options. It starts from `x0`, or from `b / D`, with entries raised to be positive.
///
/// # Storage
/// Seven `n`-vectors: `b, x`, the best `x`, `r, D`, a direction and a product.
///
/// # References
/// Kaufman (1993), doi:10.1109/42.232243; Nagy and Strakoš (2000), doi:10.1117/12.402439.
#[derive(Clone)]
pub struct Mrnsd {
    boxed: Boxed,
    s: Vec<f64>,
    /// `sᵀ Aᵀ r`.
    gamma: f64,
    descend: bool,
}

impl Mrnsd {
    /// The state before the first step, for `b` of length `n`. Reads `x0` and `diagonal` of the options;
    /// without `diagonal` the first product is `A 1`.
    ///
    /// # Errors
    /// As [`ProjectedJacobi::new`](super::ProjectedJacobi::new).
    pub fn new(b: &[f64], options: &SolveOptions) -> Result<Self> {
        let options = SolveOptions { lower: 0.0, upper: f64::INFINITY, ..options.clone() };
        Ok(Self {
            boxed: Boxed::new("MRNSD", b, &options)?,
            s: vec![0.0; b.len()],
            gamma: 0.0,
            descend: false,
        })
    }
}

/// An entry that is zero stays zero, so entries of the first iterate are raised to this share of the largest.
pub(super) fn make_positive(x: &mut [f64]) {
    let largest = x.iter().copied().fold(0.0, f64::max);
    let floor = if largest > 0.0 { 1e-3 * largest } else { 1.0 };
    for value in x {
        *value = value.max(floor);
    }
}

impl Solver for Mrnsd {
    fn step(&mut self, operator: &mut dyn Adjoint) -> Result<Advance> {
        let boxed = &mut self.boxed;
        boxed.system.fits(operator)?;
        if boxed.take_diagonal(operator)? {
            return Ok(Advance::Continuing);
        }
        let system = &mut boxed.system;
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
                return Ok(Advance::Ended(Status::ConstrainedOptimum));
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
        let residual = norm(&system.r);
        system.note(residual);
        Ok(if tau == 0.0 { Advance::Ended(Status::Stalled) } else { Advance::Continuing })
    }

    fn tally(&self) -> Tally {
        self.boxed.system.tally()
    }

    fn solution(&self) -> Vec<f64> {
        self.boxed.system.best()
    }
}
