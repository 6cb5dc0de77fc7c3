//! A model of the operator from all products so far, and the box problem for the model.

use std::sync::Arc;

use super::super::basis::{Basis, dot, norm};
use super::super::orthogonalize::orthogonalize;
use super::super::vectors::{axpy, update, update2};
use super::bounds::Bounds;
use super::gram::Gram;
use super::surrogate::{Corrected, Surrogate};

/// The model `M ≈ A`: `M x = A x` for every `x` photographed, and a multiple `θ D` of the diagonal on the
/// rest of the space.
///
/// With `Â = D^-½ A D^-½`, `V` an orthonormal basis of the scaled patterns, `W = Â V` and `H = VᵀW`, the
/// symmetric matrix that agrees with all products and is nearest to `θ I` in the Frobenius norm is
///
/// ```text
/// M̂ = θ I + (W − θV) Vᵀ + V (W − θV)ᵀ − V (H − θI) Vᵀ,
/// M̂ − Â = (I − VVᵀ)(θ I − Â)(I − VVᵀ)
/// ```
///
/// (Powell's symmetric Broyden formula for a block). Indirect or blurred light is smooth, so its part outside
/// the patterns shown vanishes after a few of them. For a general `A` the nearest matrix is Broyden's,
/// `θ I + (W − θV) Vᵀ`. `θ` is the Rayleigh quotient `vᵀ Â v` of the newest direction, an estimate for
/// patterns not yet shown: in focus it is the direct share of the light, and under defocus it falls towards
/// zero. A surrogate `P` in the options replaces `θ I`, and the model is then Broyden's.
///
/// A surrogate is not right in its finest details, and how wrong it is shows where it is compared with the products
/// taken: by `δ²` for each vector of norm 1 ([`Corrected::missed_square`]). The model agrees with the products
/// themselves, so that its photo of `u` is off by about `δ ‖(I − VVᵀ)u‖`. What is minimized is the square of the residual
/// that is then to be expected,
///
/// ```text
/// ‖D^½ M̂ u − b‖² + δ² ‖(I − VVᵀ) u‖²
/// ```
#[derive(Clone)]
pub(super) struct Model {
    /// `D^½`.
    root: Vec<f64>,
    patterns: Basis,
    products: Basis,
    /// `H`, by columns; symmetrized.
    projected: Vec<Vec<f64>>,
    /// Inner products; only for a symmetric model.
    gram: Gram,
    theta: f64,
    symmetric: bool,
    surrogate: Option<Corrected>,
    /// `δ²`: the square of what a product with a vector of norm 1 outside the patterns is expected to differ from the model's, measured
    /// by what the surrogate misses of the products taken; 0 without a surrogate.
    doubt: f64,
    work: Work,
}

/// The work vectors of the inner iteration.
#[derive(Clone)]
struct Work {
    u: Vec<f64>,
    y: Vec<f64>,
    next: Vec<f64>,
    image: Vec<f64>,
    g: Vec<f64>,
    /// `M̂ D^½ b`.
    constant: Vec<f64>,
}

impl Work {
    fn new(n: usize) -> Self {
        let zero = vec![0.0; n];
        let [u, y, next, image, g] = std::array::from_fn(|_| zero.clone());
        Self { u, y, next, image, g, constant: zero }
    }
}

/// A direction whose part outside the span is below this share of its norm is rounding error, and adds
/// nothing.
const NEW: f64 = 1e-8;

impl Model {
    /// The model before any product, with memory for `products` of them. A model with a surrogate is not
    /// symmetric.
    pub(super) fn new(
        diagonal: &[f64],
        symmetric: bool,
        surrogate: Option<Arc<dyn Surrogate>>,
        products: usize,
    ) -> Self {
        let n = diagonal.len();
        let (mut patterns, mut taken) = (Basis::new(n), Basis::new(n));
        patterns.reserve(products.min(n));
        taken.reserve(products.min(n));
        Self {
            root: diagonal.iter().map(|d| d.sqrt()).collect(),
            patterns,
            products: taken,
            projected: Vec::new(),
            gram: Gram::default(),
            theta: 1.0,
            symmetric: symmetric && surrogate.is_none(),
            surrogate: surrogate.map(Corrected::new),
            doubt: 0.0,
            work: Work::new(n),
        }
    }

    /// Adds the product `A x = y`. False when `x` is in the span of the known patterns.
    pub(super) fn learn(&mut self, x: &[f64], y: &[f64]) -> bool {
        let Work { u: v, y: w, .. } = &mut self.work;
        update2(v, x, &self.root, |_, x, s| x * s);
        update2(w, y, &self.root, |_, y, s| y / s);
        let before = norm(v);
        let removed = orthogonalize(&self.patterns, v, 0);
        if removed.norm.is_nan() || removed.norm <= NEW * before {
            return false;
        }
        self.products.accumulate(0, &removed.coefficients, -1.0, w);
        self.patterns.push_scaled(v, removed.norm);
        self.products.push_scaled(w, removed.norm);
        let (Some(v), Some(w)) = (self.patterns.columns().last(), self.products.columns().last()) else {
            return false;
        };
        let left = self.patterns.dots(0, w);
        let right = self.products.dots(0, v);
        let last = left.len() - 1;
        let column: Vec<f64> = left.iter().zip(&right).map(|(a, b)| 0.5 * (a + b)).collect();
        for (row, entry) in self.projected.iter_mut().zip(&column) {
            row.push(*entry);
        }
        self.projected.push(column);
        if let Some(surrogate) = &mut self.surrogate {
            surrogate.learn(x, y);
        }
        if self.symmetric {
            let Work { u: dv, y: dw, .. } = &mut self.work;
            update2(dv, v, &self.root, |_, v, s| s * s * v);
            update2(dw, w, &self.root, |_, w, s| s * s * w);
            self.gram.extend(&self.patterns, &self.products, dv, dw);
        }
        if last > 0 {
            self.theta = left[last].clamp(0.0, 1.0);
        }
        true
    }

    /// `out ← M̂ u`, or `M̂ᵀ u`, in scaled coordinates.
    fn apply(&self, transposed: bool, u: &[f64], out: &mut [f64]) {
        if let Some(surrogate) = &self.surrogate {
            return surrogate.apply(transposed, &self.root, &self.patterns, u, out);
        }
        let theta = self.theta;
        update(out, u, |_, u| theta * u);
        if self.symmetric {
            let c = self.patterns.dots(0, u);
            let d = self.products.dots(0, u);
            let e = self.along_patterns(&c, &d);
            self.products.accumulate(0, &c, 1.0, out);
            self.patterns.accumulate(0, &e, 1.0, out);
        } else if transposed {
            let c = self.patterns.dots(0, u);
            let d = self.products.dots(0, u);
            let e: Vec<f64> = d.iter().zip(&c).map(|(d, c)| d - theta * c).collect();
            self.patterns.accumulate(0, &e, 1.0, out);
        } else {
            let c = self.patterns.dots(0, u);
            self.products.accumulate(0, &c, 1.0, out);
            self.patterns.accumulate(0, &c, -theta, out);
        }
    }

    /// `e = d − (H + θ) c`, the coefficients of `M̂ u` on the patterns, for `c = Vᵀu` and `d = Wᵀu`.
    fn along_patterns(&self, c: &[f64], d: &[f64]) -> Vec<f64> {
        (0..c.len()).map(|i| d[i] - self.theta * c[i] - dot(&self.projected[i], c)).collect()
    }

    /// `g ← M̂ D M̂ u − constant` for a symmetric model. [`Model::gradient`] reads all vectors four times;
    /// with their inner products known, twice is enough.
    fn normal_product(&self, u: &[f64], constant: Option<&[f64]>, image: &mut [f64], g: &mut [f64]) {
        let theta = self.theta;
        let (c, c_weighted) = self.patterns.dots_twice(u, &self.root);
        let (d, d_weighted) = self.products.dots_twice(u, &self.root);
        // M̂ u = θ u + W c + V e, and the same again for D M̂ u.
        let e = self.along_patterns(&c, &d);
        let (mut c_next, mut d_next) = self.gram.apply(&c, &e);
        c_next.iter_mut().zip(&c_weighted).for_each(|(next, weighted)| *next += theta * weighted);
        d_next.iter_mut().zip(&d_weighted).for_each(|(next, weighted)| *next += theta * weighted);
        let e_next = self.along_patterns(&c_next, &d_next);
        update(image, u, |_, u| theta * u);
        match constant {
            Some(constant) => update(g, constant, |_, constant| -constant),
            None => g.fill(0.0),
        }
        self.products.accumulate_twice((&c, image), (&c_next, g));
        self.patterns.accumulate_twice((&e, image), (&e_next, g));
        update2(g, image, &self.root, |g, image, s| g + theta * s * s * image);
    }

    /// `g ← (D^½M̂)ᵀ (D^½ M̂ u − b) + δ² (I − VVᵀ) u`, the gradient of half of what is minimized, in `u = D^½ x`
    /// (`b = 0` if it is `None`); returns `‖M x − b‖`.
    fn gradient(&self, u: &[f64], b: Option<&[f64]>, image: &mut [f64], g: &mut [f64]) -> f64 {
        self.apply(false, u, image);
        match b {
            Some(b) => update2(image, &self.root, b, |y, s, b| s * y - b),
            None => update(image, &self.root, |y, s| s * y),
        }
        let length = norm(image);
        update(image, &self.root, |r, s| r * s);
        self.apply(true, image, g);
        if self.doubt > 0.0 {
            // g ← g + δ² (I − VVᵀ) u
            let shares: Vec<f64> = self.patterns.dots(0, u).iter().map(|share| -self.doubt * share).collect();
            axpy(self.doubt, u, g);
            self.patterns.accumulate(0, &shares, 1.0, g);
        }
        length
    }

    /// `x ← argmin ‖M x − b‖` over the box, from `x`, by accelerated projected gradients with restart; takes
    /// no product. Returns `‖M x − b‖`.
    pub(super) fn minimize(&mut self, b: &[f64], bounds: Bounds, x: &mut [f64]) -> f64 {
        // Moved out of the model, which is borrowed meanwhile.
        let mut work = std::mem::replace(&mut self.work, Work::new(0));
        if let Some(surrogate) = &mut self.surrogate {
            surrogate.catch_up(&self.root, &self.patterns, &self.products);
            self.doubt = surrogate.missed_square(&self.root);
        }
        let predicted = self.minimize_in(&mut work, b, bounds, x);
        self.work = work;
        predicted
    }

    fn minimize_in(&self, work: &mut Work, b: &[f64], bounds: Bounds, x: &mut [f64]) -> f64 {
        /// Iterations: until the iteration rests.
        const ITERATIONS: usize = 400;
        /// The relative accuracy: the iterate is photographed next, and the photo corrects more than this.
        const SETTLED: f64 = 1e-6;
        let Work { u, y, next, image, g, constant } = work;
        let lipschitz = self.lipschitz(next, image, g);
        update2(u, x, &self.root, |_, x, s| x * s);
        y.copy_from_slice(u);
        if self.symmetric {
            update2(image, b, &self.root, |_, b, s| s * b);
            self.apply(true, image, constant);
        }
        if lipschitz <= 0.0 {
            return self.gradient(u, Some(b), image, g);
        }
        let mut t = 1.0_f64;
        for _ in 0..ITERATIONS {
            if self.symmetric {
                self.normal_product(y, Some(constant), image, g);
            } else {
                self.gradient(y, Some(b), image, g);
            }
            next.copy_from_slice(y);
            update2(next, g, &self.root, |y, g, s| {
                (y - g / lipschitz).max(bounds.lower * s).min(bounds.upper * s)
            });
            // u ← next − u, the step.
            update(u, next, |old, new| new - old);
            let step = norm(u);
            if dot(g, u) > 0.0 {
                t = 1.0;
            }
            let t_next = 0.5 * (1.0 + (1.0 + 4.0 * t * t).sqrt());
            let momentum = (t - 1.0) / t_next;
            t = t_next;
            update2(y, next, u, |_, new, step| new + momentum * step);
            std::mem::swap(u, next);
            if step <= SETTLED * norm(u) {
                break;
            }
        }
        let predicted = self.gradient(u, Some(b), image, g);
        update2(x, u, &self.root, |_, u, s| bounds.clip(u / s));
        predicted
    }

    /// A bound of `‖D^½ M̂‖²`: the estimate of a few power iterations from the white pattern, plus ten
    /// percent.
    fn lipschitz(&self, v: &mut [f64], image: &mut [f64], g: &mut [f64]) -> f64 {
        v.copy_from_slice(&self.root);
        let mut square = 0.0_f64;
        for _ in 0..12 {
            let length = norm(v);
            if length == 0.0 || !length.is_finite() {
                return 0.0;
            }
            for value in v.iter_mut() {
                *value /= length;
            }
            if self.symmetric {
                self.normal_product(v, None, image, g);
            } else {
                self.gradient(v, None, image, g);
            }
            let next = norm(g);
            v.copy_from_slice(g);
            // The norms of a power iteration only grow. Where they grow by a thousandth, the ten percent
            // suffice.
            let settled = next <= 1.001 * square;
            square = next;
            if settled {
                break;
            }
        }
        if self.surrogate.is_some() {
            return 1.1 * square;
        }
        // Vectors outside the span are multiplied by θ.
        let largest = self.root.iter().copied().fold(0.0, f64::max);
        1.1 * square.max((self.theta * largest).powi(2))
    }
}
