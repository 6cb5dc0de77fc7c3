//! Krylov-box, a Krylov method with bounds, and the solver of its box problem (the least-squares problem of its model inside the box).

use std::sync::Arc;

use super::model::{SecantModel, Surrogate, WorkVectors};
use super::sweep::SweptRow;
use super::{Bounds, Boxed};
use crate::error::{Error, Result};
use crate::krylov::basis::{axpy, dot, norm, update, update2};
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
/// `x`, `r, D, D^½`, the candidate, a product and four work vectors (five for an operator that is not symmetric).
///
/// References: The secant model is Powell's symmetric Broyden update (1970), doi:10.1016/B978-0-12-597050-1.50006-3, for all pairs at once:
/// Dennis and Moré (1977), doi:10.1137/1019005. Minimal residuals over all products taken: Eirola and Nevanlinna (1989),
/// doi:10.1016/0024-3795(89)90719-2.
pub struct KrylovBox {
    boxed: Boxed,
    white_known: bool,
    model: Option<SecantModel>,
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
                none.insert(model)
            }
        };
        if taken {
            return Ok(Advance::Continuing);
        }
        if self.next == Next::Plan {
            self.candidate.copy_from_slice(&system.x);
            let predicted = model.minimize(&system.b, self.boxed.bounds, &mut self.candidate);
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

/// The largest number of iterations. The loop ends earlier when the iterate settles.
const ITERATIONS: usize = 400;

/// The iteration ends when its relative step is below this value. Its result is photographed next, and this photo corrects even larger
/// errors.
const SETTLED: f64 = 1e-6;

/// The largest number of steps of a power iteration.
const POWERS: usize = 12;

/// A power iteration ends when its estimate, the norm of the image of a unit vector, grows by at most this factor per step. The estimate
/// never falls, and [`MARGIN`] covers its further growth.
const GROWTH: f64 = 1.001;

/// The factor by which the estimate of a power iteration is increased, to become a bound.
const MARGIN: f64 = 1.1;

/// The weight of Nesterov's momentum. It changes in each iteration.
struct Momentum(f64);

impl Momentum {
    /// Returns the next weight. If the last step went `uphill`, the momentum restarts.
    fn next(&mut self, uphill: bool) -> f64 {
        if uphill {
            self.0 = 1.0;
        }
        let next = 0.5 * (1.0 + (1.0 + 4.0 * self.0 * self.0).sqrt());
        let weight = (self.0 - 1.0) / next;
        self.0 = next;
        weight
    }
}

impl SecantModel {
    /// `x ← argmin ‖M x − b‖` over the box, starting from `x`. Returns `‖M x − b‖`.
    fn minimize(&mut self, b: &[f64], bounds: Bounds, x: &mut [f64]) -> f64 {
        // The work vectors are moved out, because the model is borrowed meanwhile.
        let mut work = std::mem::take(&mut self.work);
        if let Some(surrogate) = &mut self.surrogate {
            surrogate.catch_up(&self.root, &self.patterns, &self.products);
            self.doubt = surrogate.missed_square(&self.root);
        }
        let predicted = if self.symmetric {
            self.minimize_symmetric(&mut work, b, bounds, x)
        } else {
            self.minimize_general(&mut work, b, bounds, x)
        };
        self.work = work;
        predicted
    }

    /// Minimizes with a symmetric model. Reads patterns and products once per iteration. All vectors are in the coordinates `u = D^½ x`.
    fn minimize_symmetric(&self, work: &mut WorkVectors, b: &[f64], bounds: Bounds, x: &mut [f64]) -> f64 {
        let WorkVectors { u, y: before, g: constant, dominant, .. } = work;
        let lipschitz = self.lipschitz_symmetric(dominant, before);
        // M̂ D^½ b
        update2(before, b, &self.root, |_, b, s| s * b);
        self.apply(true, before, constant);
        update2(u, x, &self.root, |_, x, s| x * s);
        let mut of_u = self.coordinates(u);
        if lipschitz <= 0.0 {
            return self.misfit(u, &of_u, b, before);
        }
        before.copy_from_slice(u);
        let mut of_before = of_u.clone();
        let mut momentum = Momentum(1.0);
        let mut weight = 0.0;
        for _ in 0..ITERATIONS {
            let of_y = of_u.combined(1.0 + weight, &of_before, -weight);
            let swept =
                self.sweep((1.0 + weight, u), (-weight, before), &of_y, |SweptRow { index, y, product }| {
                    let s = self.root[index];
                    let g = product - constant[index];
                    ((y - g / lipschitz).max(bounds.lower * s).min(bounds.upper * s), g)
                });
            std::mem::swap(u, before);
            of_before = std::mem::replace(&mut of_u, swept.coordinates);
            weight = momentum.next(swept.slope > 0.0);
            if swept.step <= SETTLED * swept.norm {
                break;
            }
        }
        let predicted = self.misfit(u, &of_u, b, before);
        update2(x, u, &self.root, |_, u, s| bounds.clip(u / s));
        predicted
    }

    /// A bound on `‖D^½ M̂‖²`: the estimate of a few power iterations, plus ten percent. The iterations start from `u`, the final vector
    /// for the previous model, because one more photo changes it little. If `u` is zero, they start from the white pattern. `v` is
    /// overwritten.
    fn lipschitz_symmetric(&self, u: &mut Vec<f64>, v: &mut Vec<f64>) -> f64 {
        let mut length = norm(u);
        if length == 0.0 {
            u.copy_from_slice(&self.root);
            length = norm(u);
        }
        v.fill(0.0);
        let mut of_u = self.coordinates(u);
        let mut square = 0.0_f64;
        for _ in 0..POWERS {
            if length == 0.0 || !length.is_finite() {
                return 0.0;
            }
            let of_y = of_u.combined(length.recip(), &of_u, 0.0);
            let swept = self
                .sweep((length.recip(), u), (0.0, v), &of_y, |SweptRow { product, .. }| (product, product));
            std::mem::swap(u, v);
            of_u = swept.coordinates;
            length = swept.norm;
            let settled = length <= GROWTH * square;
            square = length;
            if settled {
                break;
            }
        }
        MARGIN * square.max(self.outside())
    }

    /// A bound on `‖D^½ M̂‖²` for vectors outside the span of the patterns, which the model `M̂` multiplies by `θ`.
    fn outside(&self) -> f64 {
        let largest = self.root.iter().copied().fold(0.0, f64::max);
        (self.theta * largest).powi(2)
    }

    /// Minimizes with a model that is not symmetric. All vectors are in the coordinates `u = D^½ x`.
    fn minimize_general(&self, work: &mut WorkVectors, b: &[f64], bounds: Bounds, x: &mut [f64]) -> f64 {
        let WorkVectors { u, y, next, image, g, .. } = work;
        let lipschitz = self.lipschitz_general(next, image, g);
        update2(u, x, &self.root, |_, x, s| x * s);
        if lipschitz <= 0.0 {
            self.residual(u, Some(b), image);
            return norm(image);
        }
        y.copy_from_slice(u);
        let mut momentum = Momentum(1.0);
        for _ in 0..ITERATIONS {
            self.gradient(y, Some(b), image, g);
            next.copy_from_slice(y);
            update2(next, g, &self.root, |y, g, s| {
                (y - g / lipschitz).max(bounds.lower * s).min(bounds.upper * s)
            });
            update(u, next, |old, new| new - old);
            let step = norm(u);
            let weight = momentum.next(dot(g, u) > 0.0);
            update2(y, next, u, |_, new, step| new + weight * step);
            std::mem::swap(u, next);
            if step <= SETTLED * norm(u) {
                break;
            }
        }
        self.residual(u, Some(b), image);
        update2(x, u, &self.root, |_, u, s| bounds.clip(u / s));
        norm(image)
    }

    /// Computes the same bound as [`SecantModel::lipschitz_symmetric`], but always starts from the white pattern. Overwrites its arguments.
    fn lipschitz_general(&self, v: &mut [f64], image: &mut [f64], g: &mut [f64]) -> f64 {
        v.copy_from_slice(&self.root);
        let mut square = 0.0_f64;
        for _ in 0..POWERS {
            let length = norm(v);
            if length == 0.0 || !length.is_finite() {
                return 0.0;
            }
            for value in v.iter_mut() {
                *value /= length;
            }
            self.gradient(v, None, image, g);
            let next = norm(g);
            v.copy_from_slice(g);
            let settled = next <= GROWTH * square;
            square = next;
            if settled {
                break;
            }
        }
        if self.surrogate.is_some() {
            return MARGIN * square;
        }
        MARGIN * square.max(self.outside())
    }
}
