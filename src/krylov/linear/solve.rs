//! The driver of the solvers: takes steps until a stopping criterion is met, and records a row of history for
//! each product.

use std::ops::ControlFlow;

use super::super::basis::norm;
use super::super::stats::{Stats, Status};
use super::options::SolveOptions;
use super::system::Tally;
use crate::error::{Error, Result};
use crate::observer::{Estimate, Step};
use crate::operator::{Adjoint, Operator, Symmetry, delegate};

/// The outcome of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Advance {
    /// Further steps can improve the iterate.
    Continuing,
    /// The method ends here, for this reason.
    Ended(Status),
}

/// One product of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveRow {
    /// Products taken so far.
    pub products: usize,
    /// `‖b − A x‖ / ‖b‖` of the iterate after that product (absolute for `b = 0`; infinite until the residual
    /// of `x0` is known).
    pub residual: f64,
    /// The smallest so far: that of the solution if the budget had ended here.
    pub best: f64,
}

/// The result of a solver.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The best iterate, of length `cols`.
    pub x: Vec<f64>,
    /// Its `‖b − A x‖ / ‖b‖` (absolute for `b = 0`).
    pub residual: f64,
    /// A row for each product of this run.
    pub history: Vec<SolveRow>,
    /// The number of products in all, and why the method ended.
    pub stats: Stats,
}

/// Takes steps until the tolerance is reached, the residual is at the noise floor, the budget is spent, the
/// operator's observer stops it, or the method itself ends. The observer sees each product
/// ([`Estimate::Solution`]). `options` should be those that the solver was made with; `products`, `rtol`,
/// `atol` and `noise` are read here. `products` includes those already taken.
///
/// # Errors
/// As [`Solver::step`]. The solver then holds everything up to the product that failed: its
/// [`solution`](Solver::solution) is valid, and another call continues from there.
pub fn solve_from<O: Adjoint + ?Sized>(
    solver: &mut dyn Solver,
    operator: &mut O,
    options: &SolveOptions,
) -> Result<Solution> {
    let mut operator = operator;
    drive(solver, &mut operator, options)
}

fn drive(solver: &mut dyn Solver, operator: &mut dyn Adjoint, options: &SolveOptions) -> Result<Solution> {
    options.check()?;
    let mut history = Vec::new();
    let status = loop {
        let tally = solver.tally();
        if tally.best <= options.target(tally.rhs_norm) {
            break Status::ReachedTolerance;
        }
        // A tolerance of zero asks for the whole budget, whatever noise the operator states.
        let stated = if options.target(tally.rhs_norm) > 0.0 { tally.noise } else { 0.0 };
        if tally.best <= options.noise.max(stated) * tally.rhs_norm {
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
        let mut flow = ControlFlow::Continue(());
        if after.products > tally.products {
            history.push(row);
            let iterate = || solver.solution();
            flow = operator.observer().step(&Step {
                stage: "photos",
                done: row.products as u64,
                total: options.products as u64,
                estimate: Estimate::Solution { residual: row.residual, best: row.best, iterate: &iterate },
            });
        }
        match (advance, flow) {
            (Advance::Ended(_), _) if after.best <= options.target(after.rhs_norm) => {
                break Status::ReachedTolerance;
            }
            (Advance::Ended(status), _) => break status,
            (Advance::Continuing, ControlFlow::Break(())) => break Status::Stopped,
            (Advance::Continuing, ControlFlow::Continue(())) => {}
        }
    };
    let tally = solver.tally();
    let x = solver.solution();
    // An answer that leaves the range of double precision is none.
    let size = norm(&x);
    if !size.is_finite() || size < f64::MIN_POSITIVE / f64::EPSILON && tally.best < tally.rhs_norm {
        let (what, help) = if size < 1.0 { ("small", "multiply") } else { ("large", "divide") };
        return Err(Error::Numerical(format!(
            "the solution is too {what} for double precision: {help} the right-hand side by a power of ten"
        )));
    }
    Ok(Solution {
        x,
        residual: tally.relative(tally.best),
        history,
        stats: Stats { products: tally.products, status },
    })
}

/// An operator without a transpose, for a caller that needs an [`Adjoint`]. A symmetric operator is its own
/// transpose; for any other one a product with the transpose is an error.
pub struct ForwardOnly<'a>(pub &'a mut dyn Operator);

impl ForwardOnly<'_> {
    fn check_symmetric(&self) -> Result<()> {
        if self.symmetry() == Symmetry::Symmetric {
            return Ok(());
        }
        Err(Error::Numerical(
            "the method needs the transpose of the operator, which neither has one nor is symmetric; GMRES does not"
                .into(),
        ))
    }
}

impl Operator for ForwardOnly<'_> {
    delegate!(0: rows, cols, symmetry, apply, block_size, observer, standard_errors, frames);
}

impl Adjoint for ForwardOnly<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.check_symmetric()?;
        self.apply(y, x)
    }
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.check_symmetric()?;
        self.apply_block(ys, xs)
    }
}

/// A method for `A x = b` as a state that takes steps.
pub trait Solver {
    /// One step: at most one product with `A` or `Aᵀ` of `operator`, which must be the same from step to
    /// step.
    ///
    /// # Errors
    /// The error of the product, and [`Error::Numerical`] for a product that holds NaN. The state is then as
    /// before the step, and the step can be taken again, with the same bits. [`Error::Dimension`] when the
    /// operator does not fit; [`Error::Numerical`] when it is not declared symmetric and the method needs
    /// that. The error of the preconditioner; a product may be lost then.
    fn step(&mut self, operator: &mut dyn Adjoint) -> Result<Advance>;
    /// Products and residuals so far.
    fn tally(&self) -> Tally;
    /// The best iterate so far, of length `cols`; its residual norm is [`Tally::best`]. Takes no product.
    fn solution(&self) -> Vec<f64>;
}
