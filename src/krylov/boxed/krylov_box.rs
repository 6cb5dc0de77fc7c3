//! Krylov-box, a Krylov method with bounds.

use std::sync::Arc;

use super::Boxed;
use super::model::{SecantModel, Surrogate};
use super::resident::Resident;
use crate::error::{Error, Result};
use crate::krylov::basis::{axpy, dot, update, update2};
use crate::krylov::completeness::Status;
use crate::krylov::linear::{Advance, Recurrence, SolveOptions, Solver, System, ended};
use crate::operator::{Adjoint, Symmetry};

/// Krylov-box: solves `min ‖b − A x‖₂` over the box, for any square `A` of `n × n`, by a model of `A` that every product improves.
///
/// The model `M` agrees with all products so far, and is otherwise as near as possible to a multiple `θ D` of the diagonal. Each step
/// solves the box problem for the model, which takes no product, and then takes the product with the solution `z` (photographs `z`). The
/// step then moves to the best point between `x` and `z`, whose residual follows by linearity. If this move reduces the residual by less
/// than a thousandth, the next step photographs the residual `r`. A symmetric model that knows `A r` knows the true gradient at `x`, so the
/// method stops only at the true optimum.
///
/// The method takes one product per step and needs no transpose. `‖r‖` falls monotonically. Every iterate is inside the box, and the first
/// iterate is scaled to the best brightness. For an operator that is not symmetric, the model is not symmetric either (Broyden's matrix),
/// and the method may stop away from the optimum. A [`SolveOptions::surrogate`], which has a transpose, then reduces the distance to the
/// optimum. All patterns are inside the box, except residuals, which are signed. The method ends when the model knows `A r` and predicts no
/// gain beyond `rtol`. After `k` products the method stores `2k` `n`-vectors (two more for a white photo in the options); `b, x`, the best
/// `x`, `r, D, D^½`, the candidate, a product and four work vectors (five for an operator that is not symmetric). If the operator
/// has a memory of its own ([`Operator::vectors`](crate::operator::Operator::vectors)), a copy of a symmetric model there solves the box
/// problems, and the host goes on if that memory fails.
///
/// References: The secant model is Powell's symmetric Broyden update (1970), doi:10.1016/B978-0-12-597050-1.50006-3, for all pairs at once:
/// Dennis and Moré (1977), doi:10.1137/1019005. Minimal residuals over all products taken: Eirola and Nevanlinna (1989),
/// doi:10.1016/0024-3795(89)90719-2.
pub struct KrylovBox {
    boxed: Boxed,
    white_known: bool,
    model: Option<SecantModel>,
    /// The memory of the operator, where the box problems of a symmetric model are solved.
    resident: Resident,
    candidate: Vec<f64>,
    next: Next,
    rtol: f64,
    surrogate: Option<Arc<dyn Surrogate>>,
    /// The number of products for which memory is allocated.
    capacity: usize,
    /// True if the model knows the product `A r` with the current residual `r`.
    gradient_known: bool,
}

#[derive(Clone, Copy, PartialEq)]
enum Next {
    /// Photograph the first iterate.
    Start,
    /// Solve the model's box problem, and photograph its solution.
    Plan,
    /// Photograph the solution of the model's box problem, which is in `candidate`.
    Candidate,
    /// Photograph the residual.
    Residual,
}

/// If a step reduces the residual by less than this share, the next step photographs the residual.
const GAIN: f64 = 1e-3;

/// The value that replaces [`GAIN`] if there is a surrogate, which contributes most of its knowledge in the first steps.
const SURROGATE_GAIN: f64 = 1e-2;

impl KrylovBox {
    /// Makes the state before the first step, for `b` of length `n`. Reads `x0`, `lower`, `upper`, `diagonal`, `surrogate` and `rtol` of
    /// the options. Without `diagonal` the first product is `A 1`. A `diagonal` in the options must be `A 1`, because the model learns it
    /// as a photo.
    ///
    /// # Errors
    /// The errors of [`ProjectedJacobi::solver`](crate::krylov::boxed::ProjectedJacobi::solver); [`Error::Dimension`] if the surrogate has
    /// another size.
    pub fn solver(b: &[f64], options: &SolveOptions) -> Result<Solver> {
        if let Some(surrogate) = &options.surrogate {
            Error::check_size("the surrogate's rows and columns", b.len(), surrogate.size())?;
        }
        let (system, boxed) = Boxed::new("krylov-box", b.len(), b, options)?;
        let recurrence = Self {
            boxed,
            white_known: options.diagonal.is_some(),
            model: None,
            resident: Resident::new(false),
            candidate: vec![0.0; b.len()],
            next: Next::Start,
            rtol: options.rtol,
            surrogate: options.surrogate.clone(),
            // A white photo in the options counts as one more product.
            capacity: options.products + usize::from(options.diagonal.is_some()),
            gradient_known: false,
        };
        Ok(Solver::new(system, recurrence))
    }

    /// Moves to the best point between `x` and the candidate, whose product is in `work`. Returns the residuals before and after the move.
    fn move_to(&self, system: &mut System) -> (f64, f64) {
        let before = system.tally.residual;
        // work ← A (z − x) = A z − b + r
        update2(&mut system.work, &system.b, &system.r, |y, b, r| y - b + r);
        let square = dot(&system.work, &system.work);
        let t = if square > 0.0 { (dot(&system.r, &system.work) / square).clamp(0.0, 1.0) } else { 0.0 };
        update(&mut system.x, &self.candidate, |x, z| x + t * (z - x));
        axpy(-t, &system.work, &mut system.r);
        (before, system.note_residual())
    }
}

impl Recurrence for KrylovBox {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        let symmetric = operator.symmetry() == Symmetry::Symmetric && self.surrogate.is_none();
        let gain = if self.surrogate.is_some() { SURROGATE_GAIN } else { GAIN };
        let taken = self.boxed.take_diagonal(system, operator)?;
        let model = match &mut self.model {
            Some(model) => model,
            none => {
                let mut model =
                    SecantModel::new(&self.boxed.diagonal, symmetric, self.surrogate.clone(), self.capacity);
                let ones = vec![1.0; system.b.len()];
                if taken {
                    model.learn(&ones, &system.work);
                } else if self.white_known {
                    model.learn(&ones, &self.boxed.diagonal);
                }
                self.resident = Resident::new(symmetric);
                none.insert(model)
            }
        };
        if taken {
            return Ok(Advance::Continuing);
        }
        if self.next == Next::Plan {
            self.candidate.copy_from_slice(&system.x);
            let bounds = self.boxed.bounds;
            let predicted =
                match self.resident.minimize(operator, model, (&system.b, bounds), &mut self.candidate)? {
                    Some(predicted) => predicted,
                    None => model.minimize(&system.b, bounds, &mut self.candidate)?,
                };
            let residual = system.tally.residual;
            self.next = if predicted <= residual * (1.0 - self.rtol.max(f64::EPSILON)) {
                Next::Candidate
            } else if self.gradient_known {
                // Only a symmetric model knows the true gradient.
                return ended(if symmetric { Status::ConstrainedOptimum } else { Status::Stalled });
            } else {
                Next::Residual
            };
        }
        match self.next {
            Next::Start => {
                system.tally.product(operator, &system.x, &mut system.work)?;
                model.learn(&system.x, &system.work);
                self.boxed.brighten(system);
                system.settle();
                self.next = Next::Plan;
            }
            Next::Residual => {
                system.tally.product(operator, &system.r, &mut system.work)?;
                model.learn(&system.r, &system.work);
                self.gradient_known = true;
                self.next = Next::Plan;
            }
            Next::Candidate | Next::Plan => {
                system.tally.product(operator, &self.candidate, &mut system.work)?;
                let new = model.learn(&self.candidate, &system.work);
                let (before, after) = self.move_to(system);
                let gained = before - after;
                if gained > 0.0 {
                    self.gradient_known = false;
                }
                self.next = if gained > gain * before {
                    Next::Plan
                } else if !self.gradient_known {
                    Next::Residual
                } else if new {
                    Next::Plan
                } else {
                    return ended(Status::Stalled);
                };
            }
        }
        Ok(Advance::Continuing)
    }
}
