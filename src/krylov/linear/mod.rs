//! Linear systems `A x = b`, one product per step.
//!
//! Each method is a state ([`Solver`]) that takes at most one product per step. If a product fails, the step can be taken again, and
//! nothing is lost. [`solve`](super::solve) takes steps until the tolerance is reached, the residual is at the noise, or the budget is
//! spent. The table [`METHODS`](super::METHODS) lists the requirements and the storage of each method.

mod biconjugate;
mod bidiagonal;
mod cycle;
mod gmres;
mod place;
mod symmetric;
mod system;

use std::ops::ControlFlow;
use std::sync::Arc;

use super::basis::norm;
use super::boxed::Surrogate;
use super::completeness::{Stats, Status};
use super::precondition::Preconditioner;
use crate::error::{Error, Result};
use crate::observer::{Estimate, Step};
use crate::operator::{Adjoint, Direction, Operator, Symmetry, Vectors, delegate};

pub use biconjugate::{BiCgStab, Cgs};
pub use bidiagonal::{Lsmr, Lsqr};
pub use gmres::Gmres;
pub(crate) use place::At;
pub use symmetric::{Cg, Minres};
pub use system::Tally;
pub(crate) use system::{System, square};

/// The side of the preconditioner of GMRES. CG and MINRES split the preconditioner, which keeps the operator symmetric. CGS, BiCGStab,
/// FGMRES, LSQR and LSMR apply the preconditioner on the right.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Side {
    /// `A M⁻¹ u = b`, `x = M⁻¹ u`: minimizes the true residual.
    #[default]
    Right,
    /// `M⁻¹ A x = M⁻¹ b`: minimizes `‖M⁻¹ r‖`.
    Left,
}

/// The options of the solvers of `A x = b`. Each field lists the methods that read it; other methods ignore the field unless stated
/// otherwise. Defaults: 50 products, `x_0 = 0`, no preconditioner, the box [0, 1].
#[derive(Clone, Debug)]
pub struct SolveOptions {
    /// The largest number of products, with `A` and `Aᵀ` together. Read by all methods. Default 50.
    pub products: usize,
    /// A solver ends when `‖b − A x‖ ≤ rtol ‖b‖ + atol`. If `rtol` and `atol` are 0, it uses the whole budget. Read by all methods;
    /// krylov-box also ends when its model predicts no gain beyond this tolerance. Default 1e-6.
    pub rtol: f64,
    /// See `rtol`. Read by all methods. Default 0.
    pub atol: f64,
    /// The relative noise `δ` of a product: the measured product lies within `δ ‖A v‖` of `A v`. Steps below `‖b − A x‖ ≤ δ ‖b‖` would fit
    /// noise, so the method stops there (the discrepancy principle: Morozov (1966); for inexact products: Simoncini and Szyld (2003),
    /// doi:10.1137/S1064827502406415). Read by all methods; CG and MINRES also tolerate this degree of asymmetry. This option is meant for
    /// an operator that does not state its noise. Noise that the operator states ([`Operator::standard_errors`]) also counts, unless `rtol`
    /// and `atol` are 0. Default 0.
    pub noise: f64,
    /// The first iterate, of length `cols`. Its residual takes a product. Read by all methods. The default `None` means zero, with the
    /// residual `b`. For the methods with bounds, the default means `b / diagonal`, clipped to the bounds.
    pub x0: Option<Vec<f64>>,
    /// `M⁻¹`. Read by CG, MINRES, LSQR and LSMR (`M` must be symmetric positive definite), and by CGS, BiCGStab, GMRES and FGMRES. The
    /// methods with bounds refuse a preconditioner. Default none.
    pub preconditioner: Option<Arc<dyn Preconditioner>>,
    /// The side of the preconditioner. Read by GMRES; the other methods refuse [`Side::Left`] together with a preconditioner. Default
    /// right.
    pub side: Side,
    /// The number of products after which the method restarts. Read by GMRES and FGMRES. Default `None`: no restart.
    pub restart: Option<usize>,
    /// The lower bound of the box. Read by Jacobi, FISTA and krylov-box. Default 0.
    pub lower: f64,
    /// The upper bound of the box. Read by Jacobi, FISTA and krylov-box. Default 1.
    pub upper: f64,
    /// `D = A 1`, the white photo, of length `n`. It scales the steps and the first iterate. Read by Jacobi, FISTA, krylov-box, MRNSD and
    /// the multiplicative method. With the default `None`, the method first takes the white photo, which costs one product.
    pub diagonal: Option<Vec<f64>>,
    /// The approximation of `A` on directions that no product has explored yet. Read by krylov-box. Default none: a multiple of `D`.
    pub surrogate: Option<Arc<dyn Surrogate>>,
}

impl Default for SolveOptions {
    fn default() -> Self {
        Self {
            products: 50,
            rtol: 1e-6,
            atol: 0.0,
            noise: 0.0,
            x0: None,
            preconditioner: None,
            side: Side::default(),
            restart: None,
            lower: 0.0,
            upper: 1.0,
            diagonal: None,
            surrogate: None,
        }
    }
}

impl SolveOptions {
    /// The residual norm that meets the tolerance, given `‖b‖`.
    pub(crate) fn target(&self, rhs_norm: f64) -> f64 {
        self.rtol * rhs_norm + self.atol
    }

    /// Refuses option values that no method accepts.
    pub(crate) fn check(&self) -> Result<()> {
        let refuse = |option: &str, fault: String, help: &str| Err(Error::option(option, fault).help(help));
        if self.products == 0 {
            return refuse("--photos", "0 products were asked for".into(), "ask for at least 1");
        }
        for (option, value) in [("rtol", self.rtol), ("atol", self.atol), ("noise", self.noise)] {
            if value.is_nan() || value < 0.0 {
                return refuse(option, format!("{value} is no tolerance"), "give 0 or a positive number");
            }
        }
        if self.restart == Some(0) {
            return refuse("restart", "a cycle of 0 products".into(), "give at least 1, or none");
        }
        if self.lower.is_nan() || self.upper.is_nan() || self.lower >= self.upper {
            let fault = format!("the box [{}, {}] is empty", self.lower, self.upper);
            return refuse("--floor", fault, "the lower bound must be below the upper one");
        }
        Ok(())
    }
}

/// The outcome of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Advance {
    /// Further steps can improve the iterate.
    Continuing,
    /// The method ends here, with this status.
    Ended(Status),
}

/// One product of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveRow {
    /// The number of products so far.
    pub products: usize,
    /// `‖b − A x‖ / ‖b‖` of the iterate after the last of these products. It is absolute for `b = 0`, and infinite until the residual of
    /// `x0` is known.
    pub residual: f64,
    /// The smallest residual so far. If the budget ends here, it is the residual of the solution.
    pub best: f64,
}

/// The result of a solver.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The best iterate, of length `cols`.
    pub x: Vec<f64>,
    /// `‖b − A x‖ / ‖b‖` of `x` (absolute for `b = 0`).
    pub residual: f64,
    /// A row for each product of this run.
    pub history: Vec<SolveRow>,
    /// The total number of products, and the reason why the solver ended.
    pub stats: Stats,
}

/// Takes steps until the tolerance is reached, the residual is at the noise floor, the budget is spent, the operator's observer stops the
/// solver, or the method itself ends. The observer sees each product ([`Estimate::Solution`]). `options` should be the options that the
/// solver was made with; this function reads `products`, `rtol`, `atol` and `noise`. `products` includes the products already taken.
///
/// # Errors
/// The errors of [`Solver::step`]. The solver then holds all steps up to the product that failed: its [`solution`](Solver::solution) is
/// valid, and another call continues from there. If the operator holds the vectors ([`Operator::vectors`]) and its memory fails, the solver
/// begins again with its first iterate. GMRES goes on from its last restart.
pub fn solve_from(
    solver: &mut Solver,
    operator: &mut dyn Adjoint,
    options: &SolveOptions,
) -> Result<Solution> {
    options.check()?;
    let mut history = Vec::new();
    let status = loop {
        let tally = solver.tally();
        if tally.best <= options.target(tally.rhs_norm) {
            break Status::ReachedTolerance;
        }
        // A tolerance of zero asks for the whole budget, even if the operator states noise.
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
    let x = solver.last_solution()?;
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

/// Wraps an operator without a transpose for a caller that needs an [`Adjoint`]. A symmetric operator is its own transpose. For any other
/// operator, a product with the transpose is an error.
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
    delegate!(0: rows, cols, symmetry, apply, block_size, observer, standard_errors, frames, vectors);

    fn apply_within(&mut self, vectors: &mut dyn Vectors, column: usize, direction: Direction) -> Result<()> {
        if direction == Direction::Adjoint {
            self.check_symmetric()?;
        }
        self.0.apply_within(vectors, column, Direction::Forward)
    }
}

impl Adjoint for ForwardOnly<'_> {
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.check_symmetric()?;
        self.apply_block(ys, xs)
    }
}

/// A method for `A x = b`, as a state that takes steps.
pub struct Solver {
    system: System,
    recurrence: Box<dyn Recurrence>,
    /// The name of the method if it needs a symmetric operator.
    symmetric: Option<&'static str>,
}

impl Solver {
    pub(crate) fn new(system: System, recurrence: impl Recurrence + 'static) -> Self {
        Self { system, recurrence: Box::new(recurrence), symmetric: None }
    }

    /// Makes the solver refuse an operator that is not symmetric. `method` names the method in the error.
    pub(crate) fn symmetric(self, method: &'static str) -> Self {
        Self { symmetric: Some(method), ..self }
    }

    /// Takes one step: at most one product with `A` or `Aᵀ` of `operator`. The operator must be the same in every step.
    ///
    /// # Errors
    /// The error of the product, and [`Error::Numerical`] for a product that holds NaN. The state is then as before the step, and the step
    /// can be taken again with bitwise equal results. If the memory of the operator held the vectors and failed, the iterate and its
    /// residual are those of the first step, or with GMRES those of the last restart. [`Error::Dimension`] if the operator does not fit. [`Error::Numerical`] if the method
    /// needs a symmetric operator and this operator is not declared symmetric. The error of the preconditioner; in this case a product may
    /// be lost.
    pub fn step(&mut self, operator: &mut dyn Adjoint) -> Result<Advance> {
        self.system.fits(operator)?;
        if let Some(method) = self.symmetric
            && operator.symmetry() != Symmetry::Symmetric
        {
            return Err(Error::Numerical(format!(
                "{method} needs a symmetric operator (a coaxial rig's), and this one is not declared symmetric; GMRES does not"
            )));
        }
        let stepped = self.recurrence.step(&mut self.system, operator);
        if matches!(stepped, Err(Error::Device { .. })) {
            self.recurrence.leave(&mut self.system);
        }
        // A product has shown that the operator is not of ordinary size, and the host begins again.
        if std::mem::take(&mut self.system.tally.is_refused) { Ok(Advance::Continuing) } else { stepped }
    }

    /// The products and residuals so far.
    pub fn tally(&self) -> Tally {
        self.system.tally()
    }

    /// Works like [`Solver::solution`]. Fails with the error of the preconditioner, or of the memory in which the vectors are; the state is
    /// then as after such an error of a step.
    fn last_solution(&mut self) -> Result<Vec<f64>> {
        let x = self.recurrence.iterate(&self.system);
        if matches!(x, Err(Error::Device { .. })) {
            self.recurrence.leave(&mut self.system);
        }
        x.map(|x| self.system.undivided(x))
    }

    /// The best iterate so far, of length `cols`. Its residual norm is [`Tally::best`]. Takes no product. If the memory in which the
    /// vectors are fails, or the preconditioner, the result is the first iterate, or with GMRES that of the last restart; its residual is
    /// larger.
    pub fn solution(&self) -> Vec<f64> {
        let x = self.recurrence.iterate(&self.system).unwrap_or_else(|_| self.system.x.clone());
        self.system.undivided(x)
    }
}

/// The part of a [`Solver`] that differs between methods: the recurrence of the iterates.
pub(crate) trait Recurrence: Send {
    /// Takes one step: at most one product.
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance>;

    /// Goes on with the host, after a failure of the memory of the operator. If vectors were there, the state is an earlier one, whose
    /// residual is true.
    fn leave(&mut self, _: &mut System) {}

    /// The best iterate so far, in the units of the system. Fails with the errors of [`Solver::last_solution`].
    fn iterate(&self, system: &System) -> Result<Vec<f64>> {
        system.best_iterate()
    }
}

/// Ends a method.
pub(crate) fn ended(status: Status) -> Result<Advance> {
    Ok(Advance::Ended(status))
}
