//! The box problem of krylov-box: the least-squares problem of its model inside the box.

use super::Bounds;
use super::model::{SecantModel, WorkVectors};
use super::sweep::{Coordinates, Swept, SweptRow};
use crate::error::Result;
use crate::krylov::basis::{dot, norm, update, update2};

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

/// The vector that an iteration makes from a combination `y` of the last two iterates.
#[derive(Clone, Copy)]
pub(super) enum Finish {
    /// `M̂ D M̂ y`.
    Product,
    /// A step from `y` against the gradient `g = M̂ D M̂ y − M̂ D^½ b`, kept inside the box.
    Step { lipschitz: f64, bounds: Bounds },
}

/// The last two iterates `u` and `v`, in the host's memory or in that of the operator.
pub(super) trait Iterates {
    /// Makes an iterate from `y = a u + b v`, for the coordinates of `u` and of `y`. It becomes `u`, and the last `u` becomes `v`.
    fn sweep(
        &mut self,
        model: &SecantModel,
        weights: (f64, f64),
        coordinates: [&Coordinates; 2],
        finish: Finish,
    ) -> Result<Swept>;
}

/// Iterates in the host's memory, and `M̂ D^½ b`.
struct OnHost<'a> {
    u: &'a mut Vec<f64>,
    v: &'a mut Vec<f64>,
    constant: &'a [f64],
}

impl Iterates for OnHost<'_> {
    fn sweep(
        &mut self,
        model: &SecantModel,
        (a, b): (f64, f64),
        [_, of_y]: [&Coordinates; 2],
        finish: Finish,
    ) -> Result<Swept> {
        let (u, v) = ((a, self.u.as_slice()), (b, self.v.as_mut_slice()));
        let swept = match finish {
            Finish::Product => model.sweep(u, v, of_y, |SweptRow { product, .. }| (product, product)),
            Finish::Step { lipschitz, bounds } => {
                model.sweep(u, v, of_y, |SweptRow { index, y, product }| {
                    let s = model.root[index];
                    let g = product - self.constant[index];
                    ((y - g / lipschitz).max(bounds.lower * s).min(bounds.upper * s), g)
                })
            }
        };
        std::mem::swap(self.u, self.v);
        Ok(swept)
    }
}

impl SecantModel {
    /// `x ← argmin ‖M x − b‖` over the box, starting from `x`. Returns `‖M x − b‖`.
    pub(super) fn minimize(&mut self, b: &[f64], bounds: Bounds, x: &mut [f64]) -> Result<f64> {
        // The work vectors are moved out, because the model is borrowed meanwhile.
        let mut work = std::mem::take(&mut self.work);
        if let Some(surrogate) = &mut self.surrogate {
            surrogate.catch_up(&self.root, &self.patterns, &self.products);
            self.doubt = surrogate.missed_square(&self.root);
        }
        let predicted = if self.symmetric {
            self.minimize_symmetric(&mut work, b, bounds, x)
        } else {
            Ok(self.minimize_general(&mut work, b, bounds, x))
        };
        self.work = work;
        predicted
    }

    /// Minimizes with a symmetric model. Reads patterns and products once per iteration. All vectors are in the coordinates `u = D^½ x`.
    fn minimize_symmetric(
        &self,
        work: &mut WorkVectors,
        b: &[f64],
        bounds: Bounds,
        x: &mut [f64],
    ) -> Result<f64> {
        let WorkVectors { u, y: before, g: constant, dominant, .. } = work;
        let lipschitz = self.lipschitz_symmetric(dominant, before)?;
        // M̂ D^½ b
        update2(before, b, &self.root, |_, b, s| s * b);
        self.apply(true, before, constant);
        update2(u, x, &self.root, |_, x, s| x * s);
        let of_u = self.coordinates(u);
        if lipschitz <= 0.0 {
            return Ok(self.misfit(u, &of_u, b, before));
        }
        before.copy_from_slice(u);
        let of_u = self.descend(&mut OnHost { u, v: before, constant }, of_u, lipschitz, bounds)?;
        let predicted = self.misfit(u, &of_u, b, before);
        update2(x, u, &self.root, |_, u, s| bounds.clip(u / s));
        Ok(predicted)
    }

    /// Iterates from a vector `u` with these coordinates until the iterate settles. Returns the coordinates of the last iterate.
    pub(super) fn descend(
        &self,
        iterates: &mut dyn Iterates,
        mut of_u: Coordinates,
        lipschitz: f64,
        bounds: Bounds,
    ) -> Result<Coordinates> {
        let mut of_before = of_u.clone();
        let mut momentum = Momentum(1.0);
        let mut weight = 0.0;
        for _ in 0..ITERATIONS {
            let of_y = of_u.combined(1.0 + weight, &of_before, -weight);
            let finish = Finish::Step { lipschitz, bounds };
            let swept = iterates.sweep(self, (1.0 + weight, -weight), [&of_u, &of_y], finish)?;
            of_before = std::mem::replace(&mut of_u, swept.coordinates);
            weight = momentum.next(swept.slope > 0.0);
            if swept.step <= SETTLED * swept.norm {
                break;
            }
        }
        Ok(of_u)
    }

    /// A bound on `‖D^½ M̂‖²`: the estimate of a few power iterations, plus ten percent. The iterations start from `u`, the final vector
    /// for the previous model, because one more photo changes it little. If `u` is zero, they start from the white pattern. `v` is
    /// overwritten.
    fn lipschitz_symmetric(&self, u: &mut Vec<f64>, v: &mut Vec<f64>) -> Result<f64> {
        let mut length = norm(u);
        if length == 0.0 {
            u.copy_from_slice(&self.root);
            length = norm(u);
        }
        v.fill(0.0);
        let of_u = self.coordinates(u);
        self.growth(&mut OnHost { u, v, constant: &[] }, of_u, length)
    }

    /// Estimates the bound on `‖D^½ M̂‖²` by power iterations from a vector `u` with these coordinates and this length.
    pub(super) fn growth(
        &self,
        iterates: &mut dyn Iterates,
        mut of_u: Coordinates,
        mut length: f64,
    ) -> Result<f64> {
        let mut square = 0.0_f64;
        for _ in 0..POWERS {
            if length == 0.0 || !length.is_finite() {
                return Ok(0.0);
            }
            let of_y = of_u.combined(length.recip(), &of_u, 0.0);
            let swept = iterates.sweep(self, (length.recip(), 0.0), [&of_u, &of_y], Finish::Product)?;
            of_u = swept.coordinates;
            length = swept.norm;
            let settled = length <= GROWTH * square;
            square = length;
            if settled {
                break;
            }
        }
        Ok(MARGIN * square.max(self.outside()))
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
