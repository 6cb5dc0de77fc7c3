//! The box problem for a model, by accelerated projected gradients with restart. It takes no product.

use super::super::basis::{dot, norm};
use super::super::vectors::{update, update2};
use super::bounds::Bounds;
use super::model::{Model, Work};
use super::normal::Row;

/// Iterations: until the iteration rests.
const ITERATIONS: usize = 400;

/// The relative accuracy: the iterate is photographed next, and the photo corrects more than this.
const SETTLED: f64 = 1e-6;

/// The most steps of a power iteration.
const POWERS: usize = 12;

/// The norms of a power iteration only grow. Where they grow by no more than this factor, the margin suffices.
const GROWTH: f64 = 1.001;

/// On top of the estimate of a few power iterations.
const MARGIN: f64 = 1.1;

/// The weight of Nesterov's momentum, from iteration to iteration.
struct Momentum(f64);

impl Momentum {
    /// The next weight; `uphill` starts anew.
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

impl Model {
    /// `x ← argmin ‖M x − b‖` over the box, from `x`. Returns `‖M x − b‖`.
    pub(super) fn minimize(&mut self, b: &[f64], bounds: Bounds, x: &mut [f64]) -> f64 {
        // Moved out of the model, which is borrowed meanwhile.
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

    /// One reading of patterns and products an iteration. All vectors are in the coordinates `u = D^½ x`.
    fn minimize_symmetric(&self, work: &mut Work, b: &[f64], bounds: Bounds, x: &mut [f64]) -> f64 {
        let Work { u, y: before, g: constant, dominant, .. } = work;
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
                self.sweep((1.0 + weight, u), (-weight, before), &of_y, |Row { index, y, product }| {
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

    /// A bound of `‖D^½ M̂‖²`: the estimate of a few power iterations, plus ten percent. They go on from the vector `u` of
    /// the model before, which one more photo hardly moves, and begin from the white pattern. `v` is overwritten.
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
            let swept =
                self.sweep((length.recip(), u), (0.0, v), &of_y, |Row { product, .. }| (product, product));
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

    /// Vectors outside the span are multiplied by `θ`.
    fn outside(&self) -> f64 {
        let largest = self.root.iter().copied().fold(0.0, f64::max);
        (self.theta * largest).powi(2)
    }

    /// For a model that is not symmetric. All vectors are in the coordinates `u = D^½ x`.
    fn minimize_general(&self, work: &mut Work, b: &[f64], bounds: Bounds, x: &mut [f64]) -> f64 {
        let Work { u, y, next, image, g, .. } = work;
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
            // u ← next − u, the step.
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

    /// As [`Model::lipschitz_symmetric`], always from the white pattern. Overwrites its arguments.
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
