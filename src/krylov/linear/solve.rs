//! The driver: steps until it is time to stop, a row of history for each product.

use std::ops::ControlFlow;

use super::super::stats::{Stats, Status};
use super::options::SolveOptions;
use super::system::Tally;
use crate::error::{Error, Result};
use crate::operator::{Adjoint, Operator, Symmetry};

/// What a step came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Advance {
    /// There is more to gain.
    Continuing,
    /// The method ends here, for this reason.
    Ended(Status),
}

/// A method for `A x = b` as a state that takes steps.
pub trait Solver {
    /// One step: at most one product with `A` or `Aᵀ` of `operator`, which must be the same from step to step.
    ///
    /// # Errors
    /// Whatever the product fails with, and [`Error::Numerical`] for one that holds NaN. After that the state is as
    /// it was (a product of the step before included), and the step can be taken again, to the same bits.
    /// [`Error::Dimension`] when the operator does not fit; [`Error::Numerical`] when it is not declared symmetric
    /// and the method needs that. Whatever the preconditioner fails with; a product may be lost then.
    fn step(&mut self, operator: &mut dyn Adjoint) -> Result<Advance>;
    /// Products and residuals so far.
    fn tally(&self) -> Tally;
    /// The best iterate so far, of length `cols`; its residual norm is [`Tally::best`]. No product.
    fn solution(&self) -> Vec<f64>;
}

/// What a monitor sees after each step.
pub struct SolveProgress<'a> {
    /// Products taken so far.
    pub products: usize,
    /// Products allowed.
    pub budget: usize,
    /// `‖b − A x‖ / ‖b‖` of the current iterate.
    pub residual: f64,
    /// The least so far.
    pub best: f64,
    solver: &'a dyn Solver,
}

impl SolveProgress<'_> {
    /// The best iterate so far: no product, but with GMRES a combination of all basis vectors.
    pub fn solution(&self) -> Vec<f64> {
        self.solver.solution()
    }

    /// How noisy the next product may be, relative to itself, for a true residual of `target` (relative to `‖b‖`) in
    /// the end: `target / (budget · residual)`, at most 1. As the residual falls, later products may be noisier: fewer
    /// samples, or a shorter exposure. Each product adds its noise times its coefficient to the gap between the
    /// residual that the recurrence knows and the true one, and the coefficients fall as the residuals do; the
    /// operator's condition is taken as moderate, which preconditioning is to see to.
    ///
    /// # References
    /// Bouras and Frayssé (2005), doi:10.1137/S0895479801384743; van den Eshof and Sleijpen (2004),
    /// doi:10.1137/S0895479802403459; Simoncini and Szyld (2003), doi:10.1137/S1064827502406415.
    pub fn relaxed_noise(&self, target: f64) -> f64 {
        let bound = self.budget.max(1) as f64 * self.residual.min(1.0);
        if bound > target { target / bound } else { 1.0 }
    }
}

/// Sees each step, and stops the method by [`ControlFlow::Break`].
pub type SolveMonitor<'a> = dyn FnMut(&SolveProgress<'_>) -> ControlFlow<()> + 'a;

/// The monitor that looks on and never stops anything.
pub fn keep_solving(_: &SolveProgress<'_>) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// One product of a run, kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveRow {
    /// Products taken so far.
    pub products: usize,
    /// `‖b − A x‖ / ‖b‖` of the iterate as it was then (absolute for `b = 0`; infinite before a given first iterate's
    /// is known).
    pub residual: f64,
    /// The least so far: that of the solution, had the budget ended here.
    pub best: f64,
}

/// What a solver found.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The best iterate, of length `cols`.
    pub x: Vec<f64>,
    /// Its `‖b − A x‖ / ‖b‖` (absolute for `b = 0`).
    pub residual: f64,
    /// A row for each product of this run.
    pub history: Vec<SolveRow>,
    /// Products in all, and why it ended.
    pub stats: Stats,
}

/// Takes steps until the tolerance is reached, the residual is at the noise floor, the budget is spent, the monitor
/// stops it, or the method itself ends. `options` should be those that the solver was made with; of them `products`,
/// `rtol`, `atol` and `noise` are looked at. `products` counts those already taken.
///
/// # Errors
/// As [`Solver::step`]. The solver then holds everything up to the product that failed: its
/// [`solution`](Solver::solution) is there, and calling this again goes on.
pub fn solve_from(
    solver: &mut dyn Solver,
    operator: &mut dyn Adjoint,
    options: &SolveOptions,
    monitor: &mut SolveMonitor<'_>,
) -> Result<Solution> {
    options.check()?;
    let mut history = Vec::new();
    let status = loop {
        let tally = solver.tally();
        if tally.best <= options.target(tally.rhs_norm) {
            break Status::ReachedTolerance;
        }
        if tally.best <= options.noise * tally.rhs_norm {
            break Status::NoiseFloor;
        }
        if tally.products >= options.products {
            break Status::BudgetSpent;
        }
        let advance = solver.step(operator)?;
        let after = solver.tally();
        let row = SolveRow {
            products: after.products,
            residual: after.relative(after.residual),
            best: after.relative(after.best),
        };
        let mut verdict = ControlFlow::Continue(());
        if after.products > tally.products {
            history.push(row);
            verdict = monitor(&SolveProgress {
                products: row.products,
                budget: options.products,
                residual: row.residual,
                best: row.best,
                solver,
            });
        }
        match (advance, verdict) {
            (Advance::Ended(_), _) if after.best <= options.target(after.rhs_norm) => {
                break Status::ReachedTolerance;
            }
            (Advance::Ended(status), _) => break status,
            (Advance::Continuing, ControlFlow::Break(())) => break Status::Stopped,
            (Advance::Continuing, ControlFlow::Continue(())) => {}
        }
    };
    let tally = solver.tally();
    Ok(Solution {
        x: solver.solution(),
        residual: tally.relative(tally.best),
        history,
        stats: Stats { products: tally.products, status },
    })
}

/// An operator whose transpose is not at hand, where one is asked for that has it. A symmetric operator is its own
/// transpose; of any other one a transposed product is an error.
pub struct ForwardOnly<'a>(pub &'a mut dyn Operator);

impl Operator for ForwardOnly<'_> {
    fn rows(&self) -> usize {
        self.0.rows()
    }
    fn cols(&self) -> usize {
        self.0.cols()
    }
    fn symmetry(&self) -> Symmetry {
        self.0.symmetry()
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.0.apply(x, y)
    }
}

impl Adjoint for ForwardOnly<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        if self.symmetry() == Symmetry::Symmetric {
            return self.apply(y, x);
        }
        Err(Error::Numerical(
            "the method needs the transpose of the operator, which neither has one nor is symmetric; GMRES does not"
                .into(),
        ))
    }
}
