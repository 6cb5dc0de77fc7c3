//! Sweeps over a symmetric model: each iteration of the box problem reads its patterns and products once.
//!
//! A gradient of `½‖M x − b‖²` needs inner products with all patterns `V` and products `W`, and linear combinations of `V` and `W`.
//! Computed separately, they read `V` and `W` twice. But inner products are linear, and the next gradient belongs to a combination of the
//! last two iterates. The sweep that makes an iterate therefore also takes the inner products with this iterate, while the rows of `V` and
//! `W` are in the cache. The inner products with the combination follow from the inner products with the iterates. Apart from the two
//! iterates, an iteration needs no vector as long as an image.

use super::model::SecantModel;
use crate::krylov::basis::{dot, norm, norm_of_square, summed, update2};
use crate::krylov::kernels::{add_pair_block, dots_pair_block};
use crate::krylov::sweeps::{PARALLEL, ROWS};

/// The coefficients of `M̂ y` and of `M̂ D M̂ y` on products and patterns.
pub(super) struct Coefficients {
    pub(super) c: Vec<f64>,
    pub(super) e: Vec<f64>,
    pub(super) c_next: Vec<f64>,
    pub(super) e_next: Vec<f64>,
}

/// A row of a sweep: its index, and the entries of `y` and `M̂ D M̂ y` in this row.
pub(super) struct SweptRow {
    pub(super) index: usize,
    pub(super) y: f64,
    pub(super) product: f64,
}

/// The sums that a sweep computes in addition to the vector `z`.
pub(super) struct Swept {
    /// The coordinates of `z`.
    pub(super) coordinates: Coordinates,
    /// `gᵀ(z − u)`, with the gradient `g` and the previous vector `u`.
    pub(super) slope: f64,
    /// `‖z − u‖`.
    pub(super) step: f64,
    /// `‖z‖`.
    pub(super) norm: f64,
}

impl SecantModel {
    /// Computes the inner products with `u`, with one reading of patterns and products.
    pub(super) fn coordinates(&self, u: &[f64]) -> Coordinates {
        let k = self.patterns.len();
        let sums = summed(4 * k, u.len() > PARALLEL, u.chunks(ROWS), |index, u, sums| {
            self.coordinates_of_rows(index * ROWS, u, sums);
        });
        Coordinates::split(sums, k)
    }

    fn coordinates_of_rows(&self, start: usize, u: &[f64], sums: &mut [f64]) {
        let k = self.patterns.len();
        let mut weighted = [0.0; ROWS];
        let weighted = &mut weighted[..u.len()];
        for ((weighted, u), s) in weighted.iter_mut().zip(u).zip(&self.root[start..]) {
            *weighted = s * s * u;
        }
        let (c, rest) = sums.split_at_mut(k);
        let (d, rest) = rest.split_at_mut(k);
        let (c_weighted, d_weighted) = rest.split_at_mut(k);
        for (basis, plain, of_weighted) in [(&self.patterns, c, c_weighted), (&self.products, d, d_weighted)]
        {
            dots_pair_block(basis.columns(), start, (u, weighted), (plain, of_weighted));
        }
    }

    pub(super) fn coefficients(&self, y: &Coordinates) -> Coefficients {
        let theta = self.theta;
        let e = self.along_patterns(&y.c, &y.d);
        let (mut c_next, mut d_next) = self.gram.apply(&y.c, &e);
        // M̂ y = θ y + W c + V e, and likewise for D M̂ y.
        c_next.iter_mut().zip(&y.c_weighted).for_each(|(next, weighted)| *next += theta * weighted);
        d_next.iter_mut().zip(&y.d_weighted).for_each(|(next, weighted)| *next += theta * weighted);
        let e_next = self.along_patterns(&c_next, &d_next);
        Coefficients { c: y.c.clone(), e, c_next, e_next }
    }

    /// Sweeps with `y = a u + b v`, whose coordinates are `of_y`, and overwrites `v` with a new vector `z`. `finish` computes an entry of
    /// `z` and an entry of a gradient `g` from each row. Reads patterns and products once.
    pub(super) fn sweep(
        &self,
        (a, u): (f64, &[f64]),
        (b, v): (f64, &mut [f64]),
        of_y: &Coordinates,
        finish: impl Fn(SweptRow) -> (f64, f64) + Sync,
    ) -> Swept {
        let k = self.patterns.len();
        let coefficients = self.coefficients(of_y);
        let blocks = u.chunks(ROWS).zip(v.chunks_mut(ROWS));
        let mut sums = summed(4 * k + 3, u.len() > PARALLEL, blocks, |index, (u, v), sums| {
            let start = index * ROWS;
            let mut y = [0.0; ROWS];
            let mut image = [0.0; ROWS];
            let mut product = [0.0; ROWS];
            let (y, image) = (&mut y[..u.len()], &mut image[..u.len()]);
            let product = &mut product[..u.len()];
            for ((y, u), v) in y.iter_mut().zip(u).zip(v.iter()) {
                *y = a * u + b * v;
            }
            image.iter_mut().zip(y.iter()).for_each(|(image, y)| *image = self.theta * y);
            self.product_of_rows(&coefficients, start, image, product);
            sums[4 * k..].copy_from_slice(&finish_rows(start, (u, v), (y, product), &finish));
            self.coordinates_of_rows(start, v, &mut sums[..4 * k]);
        });
        let totals = sums.split_off(4 * k);
        Swept {
            coordinates: Coordinates::split(sums, k),
            slope: totals[0],
            step: totals[1].sqrt(),
            norm: norm_of_square(totals[2], v),
        }
    }

    /// Computes `product ← M̂ D M̂ y` and `image ← M̂ y` for the rows of one block from row `start`. `image` must hold `θ y` before the
    /// call.
    fn product_of_rows(&self, of: &Coefficients, start: usize, image: &mut [f64], product: &mut [f64]) {
        for (basis, once, twice) in [(&self.products, &of.c, &of.c_next), (&self.patterns, &of.e, &of.e_next)]
        {
            add_pair_block(basis.columns(), (once, twice), start, (image, product));
        }
        for ((product, image), s) in product.iter_mut().zip(image.iter()).zip(&self.root[start..]) {
            *product += self.theta * s * s * image;
        }
    }

    /// `‖M x − b‖` for `x = D^-½ u`, where `of_u` are the coordinates of `u`. Reads patterns and products once. `work` is overwritten.
    pub(super) fn misfit(&self, u: &[f64], of_u: &Coordinates, b: &[f64], work: &mut [f64]) -> f64 {
        let e = self.along_patterns(&of_u.c, &of_u.d);
        update2(work, u, b, |_, u, _| self.theta * u);
        self.products.accumulate(0, &of_u.c, 1.0, work);
        self.patterns.accumulate(0, &e, 1.0, work);
        update2(work, &self.root, b, |image, s, b| s * image - b);
        norm(work)
    }
}

/// Finishes the rows of one block, which begins at `start`: `v ← z`. Returns the block's contributions to the slope and to the squares of
/// the step and the norm.
fn finish_rows(
    start: usize,
    (u, v): (&[f64], &mut [f64]),
    (y, product): (&[f64], &[f64]),
    finish: &impl Fn(SweptRow) -> (f64, f64),
) -> [f64; 3] {
    // Each value has four independent sums, so that an addition does not wait for the addition before it.
    const LANES: usize = 4;
    let mut sums = [[0.0; LANES]; 3];
    for first in (0..u.len()).step_by(LANES) {
        for (lane, i) in (first..u.len().min(first + LANES)).enumerate() {
            let (z, g) = finish(SweptRow { index: start + i, y: y[i], product: product[i] });
            let step = z - u[i];
            sums[0][lane] += g * step;
            sums[1][lane] += step * step;
            sums[2][lane] += z * z;
            v[i] = z;
        }
    }
    sums.map(|[a, b, c, d]| (a + b) + (c + d))
}

/// The inner products of a vector `u` with the patterns `V` and the products `W` of a model.
#[derive(Clone, Default)]
pub(super) struct Coordinates {
    /// `Vᵀ u`.
    pub(super) c: Vec<f64>,
    /// `Wᵀ u`.
    pub(super) d: Vec<f64>,
    /// `Vᵀ D u`.
    pub(super) c_weighted: Vec<f64>,
    /// `Wᵀ D u`.
    pub(super) d_weighted: Vec<f64>,
}

impl Coordinates {
    /// The coordinates of `a u + b v`.
    pub(super) fn combined(&self, a: f64, other: &Self, b: f64) -> Self {
        let of = |u: &[f64], v: &[f64]| u.iter().zip(v).map(|(u, v)| a * u + b * v).collect();
        Self {
            c: of(&self.c, &other.c),
            d: of(&self.d, &other.d),
            c_weighted: of(&self.c_weighted, &other.c_weighted),
            d_weighted: of(&self.d_weighted, &other.d_weighted),
        }
    }

    pub(super) fn split(mut sums: Vec<f64>, k: usize) -> Self {
        let d_weighted = sums.split_off(3 * k);
        let c_weighted = sums.split_off(2 * k);
        let d = sums.split_off(k);
        Self { c: sums, d, c_weighted, d_weighted }
    }
}

/// `VᵀDV`, `VᵀDW` and `WᵀDW`, row by row, for the patterns `V` and the products `W` of a [`SecantModel`]. They give the coordinates of
/// `M̂ D M̂ u` from the coordinates of `u`.
#[derive(Default)]
pub(super) struct InnerProducts {
    vv: Vec<Vec<f64>>,
    vw: Vec<Vec<f64>>,
    ww: Vec<Vec<f64>>,
}

impl InnerProducts {
    /// Adds the last pattern and the last product, whose coordinates are given.
    pub(super) fn extend(&mut self, of_v: Coordinates, of_w: Coordinates) {
        append(&mut self.vv, of_v.c_weighted, None);
        append(&mut self.ww, of_w.d_weighted, None);
        append(&mut self.vw, of_w.c_weighted, Some(of_v.d_weighted));
    }

    /// `(VᵀDW c + VᵀDV e, WᵀDW c + WᵀDV e)`.
    pub(super) fn apply(&self, c: &[f64], e: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let of_patterns = self.vw.iter().zip(&self.vv).map(|(vw, vv)| dot(vw, c) + dot(vv, e));
        let of_products = self.ww.iter().enumerate().map(|(j, ww)| {
            let transposed: f64 = self.vw.iter().zip(e).map(|(vw, e)| vw[j] * e).sum();
            dot(ww, c) + transposed
        });
        (of_patterns.collect(), of_products.collect())
    }
}

/// Appends a column at the right and a row below. The last entry of `row` is the corner. If `row` is `None`, the new row equals the column.
fn append(matrix: &mut Vec<Vec<f64>>, column: Vec<f64>, row: Option<Vec<f64>>) {
    for (row, entry) in matrix.iter_mut().zip(&column) {
        row.push(*entry);
    }
    matrix.push(row.unwrap_or(column));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(n: usize, step: f64) -> Vec<f64> {
        (0..n).map(|i| 1.0 + 0.5 * (i as f64 * step).sin()).collect()
    }

    /// Checks that two vectors are equal up to rounding errors of `n` terms of their size.
    fn near(a: &[f64], b: &[f64], what: &str) {
        let difference: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        assert!(norm(&difference) <= 1e-13 * norm(b), "{what}: {:e} of {:e}", norm(&difference), norm(b));
    }

    #[test]
    fn a_sweep_does_what_products_with_the_model_do() {
        // The cases cover one block and enough blocks for threads, with fewer and more vectors than a group.
        for (n, count) in [(300, 3), (5 * ROWS + 9, 11)] {
            let (diagonal, smooth) = (wave(n, 0.3), wave(n, 0.01));
            let mut model = SecantModel::new(&diagonal, true, None, count);
            for k in 0..count {
                let x = wave(n, 0.2 + k as f64);
                let share = dot(&smooth, &x) / n as f64;
                let y: Vec<f64> = (0..n).map(|i| 0.3 * diagonal[i] * x[i] + share * smooth[i]).collect();
                assert!(model.learn(&x, &y));
            }
            let (u, mut v) = (wave(n, 0.07), wave(n, 0.9));
            let of_y = model.coordinates(&u).combined(1.5, &model.coordinates(&v), -0.5);
            let y: Vec<f64> = u.iter().zip(&v).map(|(u, v)| 1.5 * u - 0.5 * v).collect();
            let direct = model.coordinates(&y);
            near(&of_y.c, &direct.c, "Vᵀy");
            near(&of_y.d, &direct.d, "Wᵀy");
            near(&of_y.c_weighted, &direct.c_weighted, "VᵀDy");
            near(&of_y.d_weighted, &direct.d_weighted, "WᵀDy");

            let (mut image, mut expected) = (vec![0.0; n], vec![0.0; n]);
            model.gradient(&y, None, &mut image, &mut expected);
            let swept =
                model.sweep((1.5, &u), (-0.5, &mut v), &of_y, |row| (row.y - row.product, row.product));
            let product: Vec<f64> = y.iter().zip(&v).map(|(y, z)| y - z).collect();
            near(&product, &expected, "M̂ D M̂ y");
            near(&swept.coordinates.d, &model.coordinates(&v).d, "Wᵀz");
            let step: Vec<f64> = v.iter().zip(&u).map(|(z, u)| z - u).collect();
            near(
                &[swept.slope, swept.step, swept.norm],
                &[dot(&product, &step), norm(&step), norm(&v)],
                "sums",
            );

            let b = wave(n, 0.4);
            model.residual(&v, Some(&b), &mut image);
            let misfit = model.misfit(&v, &swept.coordinates, &b, &mut expected);
            near(&[misfit], &[norm(&image)], "‖M x − b‖");
        }
    }
}
