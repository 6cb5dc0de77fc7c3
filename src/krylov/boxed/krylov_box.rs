//! Krylov-box: a Krylov method with bounds.

use std::sync::Arc;

use super::super::basis::{dot, norm};
use super::super::linear::system::same_length;
use super::super::linear::{Advance, SolveOptions, Solver, Tally};
use super::super::stats::Status;
use super::super::vectors::{axpy, update2};
use super::bounds::Boxed;
use super::model::Model;
use super::surrogate::Surrogate;
use crate::error::Result;
use crate::operator::{Adjoint, Symmetry};

/// Krylov-box: solves `min ‖b − A x‖₂` over the box, for any square `A` of `n × n`, by a model of `A` that
/// every product improves.
///
/// The model `M` agrees with all products so far, and is otherwise as near as possible to a multiple `θ D` of
/// the diagonal. Each step solves the box problem for the model (dense work, no product), photographs the
/// answer `z`, and moves to the best point between `x` and `z`, whose residual follows by linearity. When
/// this gains less than a thousandth, the next step photographs the residual `r`: a symmetric model that
/// knows `A r` knows the true gradient at `x`, so the method rests only at the true optimum.
///
/// # Properties
/// One product a step. `‖r‖` falls monotonically. Every iterate is inside the box; the first is scaled to the
/// best brightness. No transpose: for an operator that is not symmetric the model is Broyden's, and the
/// method may rest elsewhere than at the optimum; [`SolveOptions::surrogate`], which has a transpose, brings
/// it nearer. All patterns are inside the box, except residuals, which are signed. Ends where the model knows
/// `A r` and predicts no gain beyond `rtol`.
///
/// # Storage
/// After `k` products `2k` `n`-vectors (two more for a white photo in the options); `b, x`, the best `x`,
/// `r, D, D^½`, the candidate, a product and four work vectors (five for an operator that is not symmetric).
///
/// # References
/// The secant model is Powell's symmetric Broyden update (1970), doi:10.1016/B978-0-12-597050-1.50006-3, for
/// all pairs at once: Dennis and Moré (1977), doi:10.1137/1019005. Minimal residuals over all products taken:
/// Eirola and Nevanlinna (1989), doi:10.1016/0024-3795(89)90719-2.
#[derive(Clone)]
pub struct KrylovBox {
    boxed: Boxed,
    white_known: bool,
    model: Option<Model>,
    candidate: Vec<f64>,
    next: Next,
    rtol: f64,
    /// [`SolveOptions::surrogate`].
    surrogate: Option<Arc<dyn Surrogate>>,
    /// Products to allocate memory for.
    capacity: usize,
    /// Whether the model knows `A r` of the current residual.
    gradient_known: bool,
}

#[derive(Clone, Copy, PartialEq)]
enum Next {
    /// Photograph the first iterate.
    Start,
    /// Solve the model's box problem, and photograph the answer.
    Plan,
    /// Photograph the model's answer, which is in `candidate`.
    Candidate,
    /// Photograph the residual.
    Residual,
}

/// A step that gains less than this share of the residual is followed by a photo of the residual.
const GAIN: f64 = 1e-3;

/// The same with a surrogate, which contributes most of its knowledge at once.
const SURROGATE_GAIN: f64 = 1e-2;

impl KrylovBox {
    /// The state before the first step, for `b` of length `n`. Reads `x0`, `lower`, `upper`, `diagonal`,
    /// `surrogate` and `rtol` of the options; without `diagonal` the first product is `A 1`. A `diagonal` in
    /// the options must be `A 1`: it is used as a photo.
    ///
    /// # Errors
    /// As [`ProjectedJacobi::new`](super::ProjectedJacobi::new);
    /// [`Error::Dimension`](crate::Error::Dimension) when the surrogate is of another size.
    pub fn new(b: &[f64], options: &SolveOptions) -> Result<Self> {
        if let Some(surrogate) = &options.surrogate {
            same_length("the surrogate's rows and columns", b.len(), surrogate.size())?;
        }
        Ok(Self {
            boxed: Boxed::new("krylov-box", b, options)?,
            white_known: options.diagonal.is_some(),
            model: None,
            candidate: vec![0.0; b.len()],
            next: Next::Start,
            rtol: options.rtol,
            surrogate: options.surrogate.clone(),
            // A white photo in the options is one product more.
            capacity: options.products + usize::from(options.diagonal.is_some()),
            gradient_known: false,
        })
    }

    /// Moves to the best point between `x` and the candidate, whose product is in `work`. Returns the
    /// residuals before and after.
    fn move_to(&mut self) -> (f64, f64) {
        let system = &mut self.boxed.system;
        let before = system.tally.residual;
        // work ← A (z − x) = A z − b + r
        update2(&mut system.work, &system.b, &system.r, |y, b, r| y - b + r);
        let square = dot(&system.work, &system.work);
        let t = if square > 0.0 { (dot(&system.r, &system.work) / square).clamp(0.0, 1.0) } else { 0.0 };
        super::super::vectors::update(&mut system.x, &self.candidate, |x, z| x + t * (z - x));
        axpy(-t, &system.work, &mut system.r);
        let residual = norm(&system.r);
        system.note(residual);
        (before, residual)
    }
}

impl Solver for KrylovBox {
    fn step(&mut self, operator: &mut dyn Adjoint) -> Result<Advance> {
        self.boxed.system.fits(operator)?;
        let symmetric = operator.symmetry() == Symmetry::Symmetric && self.surrogate.is_none();
        let gain = if self.surrogate.is_some() { SURROGATE_GAIN } else { GAIN };
        let taken = self.boxed.take_diagonal(operator)?;
        let model = match &mut self.model {
            Some(model) => model,
            none => {
                let mut model =
                    Model::new(&self.boxed.diagonal, symmetric, self.surrogate.clone(), self.capacity);
                let ones = vec![1.0; self.boxed.system.b.len()];
                if taken {
                    model.learn(&ones, &self.boxed.system.work);
                } else if self.white_known {
                    model.learn(&ones, &self.boxed.diagonal);
                }
                none.insert(model)
            }
        };
        if taken {
            return Ok(Advance::Continuing);
        }
        let system = &mut self.boxed.system;
        if self.next == Next::Plan {
            self.candidate.copy_from_slice(&system.x);
            let predicted = model.minimize(&system.b, self.boxed.bounds, &mut self.candidate);
            let residual = system.tally.residual;
            self.next = if predicted <= residual * (1.0 - self.rtol.max(f64::EPSILON)) {
                Next::Candidate
            } else if self.gradient_known {
                // Only a symmetric model has the true gradient.
                return Ok(Advance::Ended(if symmetric {
                    Status::ConstrainedOptimum
                } else {
                    Status::Stalled
                }));
            } else {
                Next::Residual
            };
        }
        match self.next {
            Next::Start => {
                system.tally.product(operator, &system.x, &mut system.work)?;
                model.learn(&system.x, &system.work);
                system.pending = false;
                self.boxed.brighten();
                self.boxed.residual_from_work();
                let residual = norm(&self.boxed.system.r);
                self.boxed.system.note(residual);
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
                let (before, after) = self.move_to();
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
                    return Ok(Advance::Ended(Status::Stalled));
                };
            }
        }
        Ok(Advance::Continuing)
    }

    fn tally(&self) -> Tally {
        self.boxed.system.tally()
    }

    fn solution(&self) -> Vec<f64> {
        self.boxed.system.best()
    }
}
