//! The model of the operator that krylov-box learns from its products, and surrogates for unexplored directions.

use std::fmt;
use std::sync::Arc;

use super::sweep::InnerProducts;
use crate::krylov::basis::{Basis, axpy, dot, norm, orthogonalize, update, update2};

/// The model `M ≈ A`: `M x = A x` for every photographed `x`, and a multiple `θ D` of the diagonal on the complement of these patterns.
///
/// Let `Â = D^-½ A D^-½`, `V` be an orthonormal basis of the scaled patterns, `W = Â V` and `H = VᵀW`. The symmetric matrix that agrees
/// with all products and is nearest to `θ I` in the Frobenius norm is
///
/// ```text
/// M̂ = θ I + (W − θV) Vᵀ + V (W − θV)ᵀ − V (H − θI) Vᵀ,
/// M̂ − Â = (I − VVᵀ)(θ I − Â)(I − VVᵀ)
/// ```
///
/// (Powell's symmetric Broyden formula for a block). Indirect or blurred light is smooth, so its part outside the span of the shown
/// patterns vanishes after a few patterns. For a general `A` the nearest matrix is Broyden's, `θ I + (W − θV) Vᵀ`. `θ` is the Rayleigh
/// quotient `vᵀ Â v` of the newest direction `v`, an estimate for patterns not yet shown. In focus, `θ` is the direct share of the light;
/// under defocus, it falls towards zero. A surrogate `P` in the options replaces `θ I`, and the model is then Broyden's.
///
/// A surrogate is wrong in its finest details. A comparison with the products taken measures its error: `δ²` for each vector of norm 1
/// ([`Corrected::missed_square`]). The model agrees with the products themselves, so its prediction of the photo of `u` has an error of
/// about `δ ‖(I − VVᵀ)u‖`. The method minimizes the expected square of the residual, which includes this error:
///
/// ```text
/// ‖D^½ M̂ u − b‖² + δ² ‖(I − VVᵀ) u‖²
/// ```
pub(super) struct SecantModel {
    /// `D^½`.
    pub(super) root: Vec<f64>,
    pub(super) patterns: Basis,
    pub(super) products: Basis,
    /// `H`, by columns, made symmetric.
    projected: Vec<Vec<f64>>,
    /// Inner products; only for a symmetric model.
    pub(super) gram: InnerProducts,
    pub(super) theta: f64,
    pub(super) symmetric: bool,
    pub(super) surrogate: Option<Corrected>,
    /// `δ²`: the expected square of the difference between the true product and the model's product, for a vector of norm 1 outside the
    /// span of the patterns. It is measured by the error of the surrogate on the products taken, and is 0 without a surrogate.
    pub(super) doubt: f64,
    pub(super) work: WorkVectors,
}

#[derive(Default)]
pub(super) struct WorkVectors {
    pub(super) u: Vec<f64>,
    pub(super) y: Vec<f64>,
    pub(super) g: Vec<f64>,
    /// The dominant eigenvector of `(D^½ M̂)ᵀ D^½ M̂`, approximately, for a symmetric model; zero before the first box problem. Empty for
    /// other models.
    pub(super) dominant: Vec<f64>,
    /// Empty for a symmetric model.
    pub(super) next: Vec<f64>,
    /// Empty for a symmetric model.
    pub(super) image: Vec<f64>,
}

impl WorkVectors {
    fn new(n: usize, symmetric: bool) -> Self {
        let zero = || vec![0.0; n];
        let only = |needed: bool| if needed { zero() } else { Vec::new() };
        let [next, image] = [only(!symmetric), only(!symmetric)];
        Self { u: zero(), y: zero(), g: zero(), dominant: only(symmetric), next, image }
    }
}

/// If the part of a direction outside the span is below this share of its norm, it is rounding error, and the direction is not added.
const NEW: f64 = 1e-8;

impl SecantModel {
    /// Makes the model before any product is known, with memory for `products` products. A model with a surrogate is not symmetric.
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
        let symmetric = symmetric && surrogate.is_none();
        Self {
            root: diagonal.iter().map(|d| d.sqrt()).collect(),
            patterns,
            products: taken,
            projected: Vec::new(),
            gram: InnerProducts::default(),
            theta: 1.0,
            symmetric,
            surrogate: surrogate.map(Corrected::new),
            doubt: 0.0,
            work: WorkVectors::new(n, symmetric),
        }
    }

    /// Adds the product `A x = y`. Returns false if `x` is in the span of the known patterns.
    pub(super) fn learn(&mut self, x: &[f64], y: &[f64]) -> bool {
        let WorkVectors { u: v, y: w, .. } = &mut self.work;
        update2(v, x, &self.root, |_, x, s| x * s);
        update2(w, y, &self.root, |_, y, s| y / s);
        let before = norm(v);
        let removed = orthogonalize(&self.patterns, v);
        if removed.norm.is_nan() || removed.norm <= NEW * before {
            return false;
        }
        self.products.accumulate(0, &removed.coefficients, -1.0, w);
        self.patterns.push_scaled(v, removed.norm);
        self.products.push_scaled(w, removed.norm);
        let (Some(v), Some(w)) = (self.patterns.columns().last(), self.products.columns().last()) else {
            return false;
        };
        let (left, right) = if self.symmetric {
            let (of_v, of_w) = (self.coordinates(v), self.coordinates(w));
            let (left, right) = (of_w.c.clone(), of_v.d.clone());
            self.gram.extend(of_v, of_w);
            (left, right)
        } else {
            (self.patterns.dots(0, w), self.products.dots(0, v))
        };
        let last = left.len() - 1;
        let column: Vec<f64> = left.iter().zip(&right).map(|(a, b)| 0.5 * (a + b)).collect();
        for (row, entry) in self.projected.iter_mut().zip(&column) {
            row.push(*entry);
        }
        self.projected.push(column);
        if let Some(surrogate) = &mut self.surrogate {
            surrogate.learn(x, y);
        }
        if last > 0 {
            self.theta = left[last].clamp(0.0, 1.0);
        }
        true
    }

    /// `out ← M̂ u`, or `M̂ᵀ u`, in scaled coordinates.
    pub(super) fn apply(&self, transposed: bool, u: &[f64], out: &mut [f64]) {
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

    /// The coefficients `e = d − (H + θ) c` of `M̂ u` on the patterns, for `c = Vᵀu` and `d = Wᵀu`.
    pub(super) fn along_patterns(&self, c: &[f64], d: &[f64]) -> Vec<f64> {
        (0..c.len()).map(|i| d[i] - self.theta * c[i] - dot(&self.projected[i], c)).collect()
    }

    /// `g ← (D^½M̂)ᵀ (D^½ M̂ u − b) + δ² (I − VVᵀ) u`, the gradient of half of the objective with respect to `u = D^½ x`. `None` means
    /// `b = 0`.
    pub(super) fn gradient(&self, u: &[f64], b: Option<&[f64]>, image: &mut [f64], g: &mut [f64]) {
        self.residual(u, b, image);
        update(image, &self.root, |r, s| r * s);
        self.apply(true, image, g);
        if self.doubt > 0.0 {
            // g ← g + δ² (I − VVᵀ) u
            let shares: Vec<f64> = self.patterns.dots(0, u).iter().map(|share| -self.doubt * share).collect();
            axpy(self.doubt, u, g);
            self.patterns.accumulate(0, &shares, 1.0, g);
        }
    }

    /// `image ← D^½ M̂ u − b`, which is `M x − b` for `u = D^½ x`.
    pub(super) fn residual(&self, u: &[f64], b: Option<&[f64]>, image: &mut [f64]) {
        self.apply(false, u, image);
        match b {
            Some(b) => update2(image, &self.root, b, |y, s, b| s * y - b),
            None => update(image, &self.root, |y, s| s * y),
        }
    }
}

/// A family of `n × n` operators that cost no product. One member of the family approximates `A`. A preconditioner approximates the inverse
/// of `A`; a surrogate approximates `A` itself, and provides a transpose to methods that take no products with `Aᵀ`.
pub trait Surrogate: Send + Sync {
    /// The dimension `n`.
    fn size(&self) -> usize;
    /// Returns the member of the family that best fits `A patterns[i] = products[i]`.
    fn fitted(&self, patterns: &[Vec<f64>], products: &[Vec<f64>]) -> Arc<dyn Surrogate>;
    /// `y ← P x`; every entry of `y` is overwritten.
    fn apply(&self, x: &[f64], y: &mut [f64]);
    /// `x ← Pᵀ y`; every entry of `x` is overwritten.
    fn apply_adjoint(&self, y: &[f64], x: &mut [f64]);
}

impl fmt::Debug for dyn Surrogate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Surrogate({})", self.size())
    }
}

/// The number of products to which a surrogate is fitted. Later products only correct it.
const FITTED: usize = 16;

/// A surrogate in scaled coordinates, `P̂ = D^-½ P D^-½`, and its correction `P̂ + (W − P̂ V) Vᵀ`, which agrees with all products.
pub(super) struct Corrected {
    surrogate: Arc<dyn Surrogate>,
    patterns: Vec<Vec<f64>>,
    products: Vec<Vec<f64>>,
    /// `W − P̂ V`. It has fewer columns than `V` until it is updated.
    excess: Basis,
}

impl Corrected {
    pub(super) fn new(surrogate: Arc<dyn Surrogate>) -> Self {
        let excess = Basis::new(surrogate.size());
        Self { surrogate, patterns: Vec::new(), products: Vec::new(), excess }
    }

    /// Fits the surrogate to one more product `A x = y`.
    pub(super) fn learn(&mut self, x: &[f64], y: &[f64]) {
        if self.patterns.len() == FITTED {
            return;
        }
        self.patterns.push(x.to_vec());
        self.products.push(y.to_vec());
        self.surrogate = self.surrogate.fitted(&self.patterns, &self.products);
        self.excess.clear();
    }

    /// Updates the correction for all of `V` and `W`.
    pub(super) fn catch_up(&mut self, root: &[f64], v: &Basis, w: &Basis) {
        let mut column = vec![0.0; root.len()];
        for (v, w) in v.columns().iter().zip(w.columns()).skip(self.excess.len()) {
            self.plain(false, root, v, &mut column);
            column.iter_mut().zip(w).for_each(|(column, w)| *column = w - *column);
            self.excess.push_scaled(&column, 1.0);
        }
    }

    /// The mean square of `D^½ (W − P̂ V)` per direction of `V`. It measures the error of the fitted surrogate for a product with a vector
    /// of norm 1. The first direction is white and shows no details, so it is left out.
    pub(super) fn missed_square(&self, root: &[f64]) -> f64 {
        let details = self.excess.columns().get(1..).unwrap_or_default();
        let square = |column: &Vec<f64>| column.iter().zip(root).map(|(e, s)| (e * s).powi(2)).sum::<f64>();
        details.iter().map(square).sum::<f64>() / details.len().max(1) as f64
    }

    /// `out ← P̂ u`, or `P̂ᵀ u`.
    fn plain(&self, transposed: bool, root: &[f64], u: &[f64], out: &mut [f64]) {
        let scaled: Vec<f64> = u.iter().zip(root).map(|(u, s)| u / s).collect();
        let mut image = vec![0.0; u.len()];
        match transposed {
            true => self.surrogate.apply_adjoint(&scaled, &mut image),
            false => self.surrogate.apply(&scaled, &mut image),
        }
        update2(out, &image, root, |_, image, s| image / s);
    }

    /// `out ← (P̂ + (W − P̂ V) Vᵀ) u`, or its transpose.
    pub(super) fn apply(&self, transposed: bool, root: &[f64], v: &Basis, u: &[f64], out: &mut [f64]) {
        self.plain(transposed, root, u, out);
        let (from, to) = if transposed { (&self.excess, v) } else { (v, &self.excess) };
        let shares = from.dots(0, u);
        to.accumulate(0, &shares, 1.0, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The objective is quadratic, so central differences equal its slopes up to rounding.
    #[test]
    fn the_gradient_is_the_slope_of_what_is_minimized_with_and_without_doubt() {
        let entry = |i: usize, j: usize| 0.1 * ((3 * i + 5 * j) % 7) as f64 + if i == j { 1.0 } else { 0.0 };
        let b = [0.5, -0.25, 1.0, 0.75];
        for (symmetric, doubt) in [(true, 0.0), (false, 0.0), (false, 0.3)] {
            let mut model = SecantModel::new(&[1.0, 0.5, 2.0, 0.8], symmetric, None, 4);
            for x in [[1.0, 0.5, 0.2, 0.7], [0.1, 0.9, 0.4, 0.3]] {
                let a = |i, j| if symmetric { entry(i, j) + entry(j, i) } else { entry(i, j) };
                let y: Vec<f64> = (0..4).map(|i| (0..4).map(|j| a(i, j) * x[j]).sum()).collect();
                assert!(model.learn(&x, &y));
            }
            model.doubt = doubt;
            let half = |u: &[f64]| {
                let mut image = vec![0.0; 4];
                model.residual(u, Some(&b), &mut image);
                let seen = model.patterns.dots(0, u);
                0.5 * dot(&image, &image) + 0.5 * doubt * (dot(u, u) - dot(&seen, &seen))
            };
            let u = [0.3, -0.6, 0.2, 0.9];
            let (mut image, mut gradient) = (vec![0.0; 4], vec![0.0; 4]);
            model.gradient(&u, Some(&b), &mut image, &mut gradient);
            for pixel in 0..4 {
                let moved = |by: f64| {
                    let mut moved = u;
                    moved[pixel] += by;
                    half(&moved)
                };
                let slope = moved(0.5) - moved(-0.5);
                assert!(
                    (gradient[pixel] - slope).abs() < 1e-12,
                    "{symmetric} {doubt}: {gradient:?}, {slope}"
                );
            }
        }
    }
}
