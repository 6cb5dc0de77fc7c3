//! The generalized minimal residual method, and its flexible form.

use std::sync::{Mutex, PoisonError};

use super::cycle::Cycle;
use super::system::System;
use super::{Advance, Recurrence, Side, SolveOptions, Solver, ended};
use crate::error::Result;
use crate::krylov::basis::{Removed, axpy, norm, orthogonalize, orthogonalized};
use crate::krylov::completeness::Status;
use crate::krylov::factor::MOST;
use crate::operator::vectors::{accumulate, can_combine};
use crate::operator::{Adjoint, Direction, Sums, Vectors};

/// GMRES(m): solves `min ‖b − A x‖₂` over the Krylov space, for any square `A` of `n × n`.
///
/// With the preconditioner on the right (`A M⁻¹ u = b`), the method minimizes the true residual. With the preconditioner on the left
/// (`M⁻¹ A x = M⁻¹ b`), it minimizes `‖M⁻¹ r‖`. It then also keeps the products, to report the true residual without a further product. The
/// flexible form ([`Gmres::flexible`], FGMRES) keeps each preconditioned vector, and `M` may differ from step to step.
///
/// `‖r‖` (or `‖M⁻¹ r‖` with the preconditioner on the left) falls monotonically, also across restarts, unless the memory of the operator
/// fails. The method needs no transpose. A step takes one product; a restart takes no product. The basis is orthonormal to working
/// precision. The method ends with [`Status::Breakdown`] if the Krylov space is invariant and contains no solution (a singular `A`). After
/// `k` steps since the last restart, the method stores `k + 1` basis vectors; `k` more if flexible or preconditioned on the left; `b, x, r`
/// and three work vectors.
///
/// References: Saad and Schultz (1986), doi:10.1137/0907058; flexible: Saad (1993), doi:10.1137/0914028. O'Toole and Kutulakos propose it
/// for light transport compensation (sections 6.1 and 6.2). Their results are by MINRES (section 8.3).
pub struct Gmres {
    side: Side,
    flexible: bool,
    /// True if the preconditioner must be applied to `V y` to make a correction of `x`.
    is_hatted: bool,
    restart: usize,
    cycle: Cycle,
    /// The columns that [`Cycle::basis`] would hold, in the memory of the operator, after `before` other columns. The mutex is for
    /// [`Recurrence::iterate`], which needs the vector `w` of a solver that it does not change.
    resident: Option<Mutex<Box<dyn Vectors>>>,
    /// 2 for a diagonal preconditioner, whose [`INVERSE`] and [`HAT`] are before the basis, else 0.
    before: usize,
    /// Whether the basis may be in the memory of the operator. Preconditioners that are not diagonal, or not on the right, work on the
    /// host.
    may_reside: bool,
    hat: Vec<f64>,
    /// The largest `‖A M⁻¹ v‖` so far.
    scale: f64,
    started: bool,
}

/// The column of the preconditioner's `M⁻¹`.
const INVERSE: usize = 0;
/// The column of `M⁻¹ v`, for the last vector `v` of the basis.
const HAT: usize = 1;

const SINGULAR: Status =
    Status::Breakdown("the Krylov space is used up and holds no solution: the operator is singular");

/// A correction is refused if its rounding errors are at least this share of the first residual of the cycle. The reported residual would
/// otherwise differ from the true residual.
const MEANINGLESS: f64 = 1e-9;

impl Gmres {
    /// Makes the state before the first step, for `b` of length `n`. Reads `x0`, `preconditioner`, `side` and `restart` of the options.
    /// Fails with the errors of [`Cg::solver`](crate::krylov::linear::Cg::solver), but accepts any preconditioner.
    pub fn solver(b: &[f64], options: &SolveOptions) -> Result<Solver> {
        Ok(Self::build(System::new(b.len(), b, options)?, options, false))
    }

    /// Makes FGMRES, whose preconditioner on the right may change from step to step. Fails with the errors of [`Gmres::solver`], and
    /// refuses a preconditioner on the left.
    pub fn flexible(b: &[f64], options: &SolveOptions) -> Result<Solver> {
        let system = System::split("FGMRES", false, b.len(), b, options)?;
        Ok(Self::build(system, options, options.preconditioner.is_some()))
    }

    fn build(system: System, options: &SolveOptions, flexible: bool) -> Solver {
        let n = system.b.len();
        let side = if options.preconditioner.is_some() { options.side } else { Side::Right };
        let restart = options.restart.unwrap_or(usize::MAX);
        let steps = options.products.min(restart).min(n);
        let kept = if flexible || side == Side::Left { steps } else { 0 };
        let is_hatted = !flexible && side == Side::Right && options.preconditioner.is_some();
        let is_diagonal = is_hatted && system.inverse.is_diagonal();
        let before = if is_diagonal { 2 } else { 0 };
        let recurrence = Self {
            side,
            flexible,
            is_hatted,
            restart,
            cycle: Cycle::new(n, steps, kept),
            resident: None,
            before,
            may_reside: (is_diagonal || options.preconditioner.is_none()) && before + steps < MOST,
            hat: vec![0.0; n],
            scale: 0.0,
            started: false,
        };
        Solver::new(system, recurrence)
    }

    fn start(&mut self, system: &System, operator: &dyn Adjoint) -> Result<bool> {
        if self.side == Side::Left {
            system.inverse.apply(&system.r, &mut self.hat)?;
        } else {
            self.hat.copy_from_slice(&system.r);
        }
        let length = norm(&self.hat);
        let is_ordinary = system.tally.operator_power.unwrap_or(0) == 0;
        if self.may_reside && is_ordinary && self.resident.is_none() {
            let mut vectors = operator.vectors(self.before + self.cycle.steps + 1, None)?;
            if let Some(made) = vectors.as_deref_mut().filter(|_| self.before > 0)
                && !can_combine(made, HAT)?
            {
                vectors = None;
            }
            self.resident = vectors.map(Mutex::new);
            self.may_reside = self.resident.is_some();
        }
        self.cycle.start(&self.hat, length, self.resident.is_some());
        if let Some(resident) = self.resident.as_mut().filter(|_| length > 0.0) {
            let vectors = &mut **own(resident);
            vectors.clear();
            if let Some(inverse) = system.inverse.diagonal() {
                vectors.load(&inverse)?;
                (0..self.before).try_for_each(|_| vectors.push(1.0))?;
            }
            vectors.load(&self.hat)?;
            push(vectors, length, self.before > 0)?;
        }
        self.started = length > 0.0;
        Ok(self.started)
    }

    /// Overwrites `r`, the cycle's first residual, with the true residual of this cycle's iterate. Takes no product.
    fn residual(&self, r: &mut [f64]) -> Result<()> {
        if self.side == Side::Left {
            self.cycle.combine_kept(-1.0, r);
            return Ok(());
        }
        r.fill(0.0);
        self.add(&self.cycle.residual(), r)
    }

    /// Adds `V y` to `sum`, for the columns of the basis. After an error, `sum` is unchanged.
    fn add(&self, y: &[f64], sum: &mut [f64]) -> Result<()> {
        let Some(resident) = &self.resident else {
            self.cycle.basis.accumulate(0, y, 1.0, sum);
            return Ok(());
        };
        let mut vectors = resident.lock().unwrap_or_else(PoisonError::into_inner);
        accumulate(&mut **vectors, self.before, y, sum)
    }

    /// Adds the correction of `x` to `sum`, before the preconditioner.
    fn add_correction(&self, sum: &mut [f64]) -> Result<()> {
        if self.flexible {
            self.cycle.combine_kept(1.0, sum);
            return Ok(());
        }
        let mut y = self.cycle.coefficients();
        // The last basis vector has no coefficient yet.
        y.resize(self.cycle.width, 0.0);
        self.add(&y, sum)
    }

    /// Ends the cycle. Updates `x` and `r` without a product.
    fn close(&mut self, system: &mut System) -> Result<()> {
        let mut correction = std::mem::take(&mut self.hat);
        correction.fill(0.0);
        let added = self.add_correction(&mut correction);
        self.hat = correction;
        added?;
        if self.is_hatted {
            system.inverse.apply(&self.hat, &mut system.work)?;
            std::mem::swap(&mut self.hat, &mut system.work);
        }
        if self.resident.is_some() {
            // After an error, `r` is as before.
            self.residual(&mut system.work)?;
            std::mem::swap(&mut system.r, &mut system.work);
        } else {
            self.residual(&mut system.r)?;
        }
        axpy(1.0, &self.hat, &mut system.x);
        self.started = false;
        Ok(())
    }

    /// Copies the basis to the host's memory, for more steps than were expected.
    fn download(&mut self) -> Result<()> {
        let Some(vectors) = &mut self.resident else { return Ok(()) };
        let vectors = own(vectors);
        self.cycle.basis.clear();
        for index in 0..self.cycle.width {
            self.cycle.basis.push_scaled(&vectors.column(self.before + index)?, 1.0);
        }
        self.resident = None;
        self.may_reside = false;
        Ok(())
    }

    /// Takes a step with the basis in the memory of the operator.
    fn step_resident(
        &mut self,
        system: &mut System,
        operator: &mut dyn Adjoint,
        vectors: &mut dyn Vectors,
    ) -> Result<Advance> {
        let before = self.before;
        let of_basis = |(mut dots, length): Sums| (dots.split_off(before), length);
        let column = if before > 0 { HAT } else { self.cycle.width - 1 };
        let product = system.tally.product_within(operator, vectors, (column, Direction::Forward, 1.0))?;
        let length = product.1;
        let removed = orthogonalized(of_basis(product), |h| {
            let mut of_all = vec![0.0; before];
            of_all.extend(h);
            vectors.remove_and_dot(&of_all).map(of_basis)
        })?;
        let left = removed.norm;
        let Some((residual, is_invariant)) = self.grow(length, removed) else {
            return ended(SINGULAR);
        };
        if !is_invariant {
            push(vectors, left, before > 0).inspect_err(|_| self.cycle.undo())?;
            self.cycle.width += 1;
        }
        Ok(settled(system, residual, is_invariant))
    }

    /// Adds a product of this length, which the basis has been removed from, to the cycle. Returns the new residual norm, and whether the
    /// space is invariant, or `None` if the product adds nothing.
    fn grow(&mut self, length: f64, removed: Removed) -> Option<(f64, bool)> {
        // If the vector is in the span of the basis, orthogonalization leaves only rounding errors.
        let tiny = 10.0 * f64::EPSILON * length;
        let is_invariant = removed.norm <= tiny;
        let below = if is_invariant { 0.0 } else { removed.norm };
        let left = self.cycle.append(removed.coefficients, below, tiny)?;
        self.scale = self.scale.max(length);
        if norm(&self.cycle.coefficients()) * self.scale * f64::EPSILON
            > MEANINGLESS * self.cycle.first_residual()
        {
            self.cycle.undo();
            return None;
        }
        Some((left, is_invariant))
    }
}

/// Adds `w/divisor` to the basis, and also makes its `HAT`. Overwrites `w`.
fn push(vectors: &mut dyn Vectors, divisor: f64, is_hatted: bool) -> Result<()> {
    vectors.push(divisor)?;
    if is_hatted {
        vectors.combine(None, &[(1.0, None)], divisor)?;
        vectors.scale_by(INVERSE)?;
        vectors.keep(HAT)?;
    }
    Ok(())
}

/// The vectors in the mutex of a solver.
fn own(vectors: &mut Mutex<Box<dyn Vectors>>) -> &mut Box<dyn Vectors> {
    vectors.get_mut().unwrap_or_else(PoisonError::into_inner)
}

/// Records the residual norm of a step.
fn settled(system: &mut System, residual: f64, is_invariant: bool) -> Advance {
    system.tally.residual = residual;
    system.tally.best = residual;
    if is_invariant { Advance::Ended(Status::SpaceExhausted) } else { Advance::Continuing }
}

impl Recurrence for Gmres {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        if system.open(operator)? {
            return Ok(Advance::Continuing);
        }
        if self.started && self.cycle.len() >= self.restart {
            self.close(system)?;
        }
        if !self.started && !self.start(system, operator)? {
            return ended(Status::ReachedTolerance);
        }
        if self.cycle.width == self.cycle.len() {
            return ended(Status::SpaceExhausted);
        }
        if self.cycle.width > self.cycle.steps {
            self.download()?;
        }
        match self.resident.take() {
            Some(mut vectors) => {
                let stepped = self.step_resident(system, operator, &mut **own(&mut vectors));
                self.resident = Some(vectors);
                stepped
            }
            None => self.step_on_host(system, operator),
        }
    }

    fn leave(&mut self, system: &mut System) {
        self.may_reside = false;
        if self.resident.take().is_some() {
            self.started = false;
            system.tally.residual = norm(&system.r);
            system.tally.best = system.tally.residual;
        }
    }

    fn iterate(&self, system: &System) -> Result<Vec<f64>> {
        let mut x = system.x.clone();
        if self.started && !self.is_hatted {
            self.add_correction(&mut x)?;
        } else if self.started {
            let (mut sum, mut hat) = (vec![0.0; x.len()], vec![0.0; x.len()]);
            self.add_correction(&mut sum)?;
            system.inverse.apply(&sum, &mut hat)?;
            axpy(1.0, &hat, &mut x);
        }
        Ok(x)
    }
}

impl Gmres {
    fn step_on_host(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        let Some(v) = self.cycle.basis.columns().last() else {
            return ended(Status::SpaceExhausted);
        };
        let right = self.side == Side::Right;
        if right {
            system.inverse.apply(v, &mut self.hat)?;
        } else {
            self.hat.copy_from_slice(v);
        }
        system.tally.product(operator, &self.hat, &mut system.work)?;
        // The new direction overwrites the product. If the preconditioner is on the left, the new direction overwrites the copy of the
        // basis vector instead, because the product is kept.
        let w = if right {
            &mut system.work
        } else {
            system.inverse.apply(&system.work, &mut self.hat)?;
            &mut self.hat
        };
        let length = norm(w);
        let removed = orthogonalize(&self.cycle.basis, w);
        let below = removed.norm;
        let Some((left, is_invariant)) = self.grow(length, removed) else {
            return ended(SINGULAR);
        };
        if self.flexible {
            self.cycle.kept.push_scaled(&self.hat, 1.0);
        } else if !right {
            self.cycle.kept.push_scaled(&system.work, 1.0);
        }
        if !is_invariant {
            self.cycle.basis.push_scaled(if right { &system.work } else { &self.hat }, below);
            self.cycle.width += 1;
        }
        let residual = if right {
            left
        } else {
            let mut r = std::mem::take(&mut self.hat);
            r.copy_from_slice(&system.r);
            let found = self.residual(&mut r);
            self.hat = r;
            found?;
            norm(&self.hat)
        };
        Ok(settled(system, residual, is_invariant))
    }
}
