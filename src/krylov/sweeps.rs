//! Sweeps over a whole basis. A sweep does all its work on one block of rows after the other, while the block is in the cache.
//!
//! A basis of fifty vectors of 512×512 pixels takes 100 MiB. Each sweep reads the basis from memory, and this dominates the time. Further
//! work on a block of rows is almost free.
//!
//! Blocks have a fixed number of rows, and their sums are added in the order of the rows, as in [`Basis`].

use rayon::prelude::*;

use super::basis::{Basis, norm_of_square, summed};
use super::kernels::{add_block, dot_block, dots_block, settle_block};
use crate::operator::Settling;

/// The rows of a block. Blocks of eight columns (32 KiB) stay in the first-level cache, blocks of a hundred columns in the second-level
/// cache.
pub(super) const ROWS: usize = 512;

/// Below this length, threads cost more time than they save.
pub(super) const PARALLEL: usize = 2048;

impl Basis {
    /// `Vᵀ w` over the columns from `first`, and `‖w‖`.
    pub(super) fn dots_and_norm(&self, first: usize, w: &[f64]) -> (Vec<f64>, f64) {
        let columns = self.columns().get(first..).unwrap_or_default();
        let sums = summed(columns.len() + 1, w.len() > PARALLEL, w.chunks(ROWS), |index, w, sums| {
            let (square, dots) = last_and_others(sums);
            dots_block(columns, index * ROWS, w, dots);
            *square = dot_block(w, w);
        });
        with_norm(sums, w)
    }

    /// `w ← w − V h`; returns `Vᵀ w` and `‖w‖` of the new `w`. Reads the basis once.
    pub(super) fn remove_and_dot(&self, h: &[f64], w: &mut [f64]) -> (Vec<f64>, f64) {
        let columns = self.columns();
        debug_assert_eq!(columns.len(), h.len());
        let sums = summed(columns.len() + 1, w.len() > PARALLEL, w.chunks_mut(ROWS), |index, w, sums| {
            let (square, dots) = last_and_others(sums);
            add_block(columns, h, -1.0, index * ROWS, w);
            dots_block(columns, index * ROWS, w, dots);
            *square = dot_block(w, w);
        });
        with_norm(sums, w)
    }

    /// Removes from the last column `u` its late parts, `u ← u − V s`, and from `w` its known parts. Returns `Vᵀ w` over all columns,
    /// including the new last column, and `‖w‖`. The inner products still include the coefficients `ahead`. Reads the basis once.
    pub(super) fn settle_and_dot(&mut self, settling: &Settling<'_>, w: &mut [f64]) -> (Vec<f64>, f64) {
        let Some((u, columns)) = self.columns_mut().split_last_mut() else {
            return self.dots_and_norm(0, w);
        };
        let is_long = u.len() > PARALLEL;
        let blocks = u.chunks_mut(ROWS).zip(w.chunks_mut(ROWS));
        let sums = summed(columns.len() + 2, is_long, blocks, |index, rows, sums| {
            settle_rows(columns, settling, index * ROWS, rows, sums);
        });
        with_norm(sums, w)
    }

    /// Removes the late parts of the last column. The result is bitwise equal to the result of [`Basis::settle_and_dot`].
    pub(super) fn settle_last(&mut self, late: &[f64]) {
        if let Some((u, columns)) = self.columns_mut().split_last_mut() {
            settle(columns, late, u);
        }
    }

    /// Returns the last column as [`Basis::settle_last`] would leave it.
    pub(super) fn settled_last(&self, late: &[f64]) -> Vec<f64> {
        let Some((u, columns)) = self.columns().split_last() else { return Vec::new() };
        let mut settled = u.clone();
        settle(columns, late, &mut settled);
        settled
    }
}

/// `u ← u − V s`, one column after the other.
fn settle(columns: &[Vec<f64>], late: &[f64], u: &mut [f64]) {
    let block = |(index, u): (usize, &mut [f64])| {
        for (column, s) in columns.iter().zip(late) {
            let column = &column[index * ROWS..index * ROWS + u.len()];
            u.iter_mut().zip(column).for_each(|(u, entry)| *u -= s * entry);
        }
    };
    if u.len() <= PARALLEL {
        u.chunks_mut(ROWS).enumerate().for_each(block);
    } else {
        u.par_chunks_mut(ROWS).enumerate().for_each(block);
    }
}

/// Processes one block of [`Basis::settle_and_dot`], which begins at row `start`.
fn settle_rows(
    columns: &[Vec<f64>],
    settling: &Settling<'_>,
    start: usize,
    (u, w): (&mut [f64], &mut [f64]),
    sums: &mut [f64],
) {
    if let Some((of_last, of_others)) = settling.along.split_last() {
        let first = columns.len() - of_others.len();
        add_block(&columns[first..], of_others, -1.0, start, w);
        w.iter_mut().zip(u.iter()).for_each(|(w, u)| *w -= of_last * u);
    }
    let (square, dots) = last_and_others(sums);
    let (dot_of_last, dots) = last_and_others(dots);
    if settling.late.is_empty() {
        dots_block(columns, start, w, dots);
    } else {
        settle_block(columns, (settling.late, settling.ahead), start, (u, w), dots);
    }
    *dot_of_last = dot_block(u, w);
    *square = dot_block(w, w);
}

/// Splits `sums`, which is not empty, into the last entry and the entries before it.
fn last_and_others(sums: &mut [f64]) -> (&mut f64, &mut [f64]) {
    let (others, last) = sums.split_at_mut(sums.len() - 1);
    (&mut last[0], others)
}

/// Splits off `‖w‖²`, the last entry of `sums`, from the inner products. Returns the inner products and the norm of `w`.
fn with_norm(mut sums: Vec<f64>, w: &[f64]) -> (Vec<f64>, f64) {
    let square = sums.pop().unwrap_or(0.0);
    (sums, norm_of_square(square, w))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::krylov::basis::norm;

    fn ramp(length: usize, step: f64) -> Vec<f64> {
        (0..length).map(|i| ((i as f64) * step).sin()).collect()
    }

    /// Makes columns of norm about 1, so that rounding errors are of the size of ε.
    fn basis(rows: usize, columns: usize) -> Basis {
        let mut basis = Basis::new(rows);
        for k in 0..columns {
            basis.push_scaled(&ramp(rows, 0.1 + k as f64), (rows as f64 / 2.0).sqrt());
        }
        basis
    }

    /// Bounds the rounding errors of sums of `rows` products of two vectors, whose norms are about 1 and `size`.
    fn rounding(rows: usize, size: f64) -> f64 {
        rows as f64 * f64::EPSILON * size
    }

    #[test]
    fn sweeps_equal_the_steps_that_they_join() {
        // The cases have fewer and more columns than a group, and lengths below and above the threshold for threads.
        for (rows, columns) in [(37, 3), (37, 12), (5 * ROWS + 9, 11), (5 * ROWS + 8, 17)] {
            let size = (rows as f64).sqrt();
            let start = basis(rows, columns);
            let w = ramp(rows, 0.37);
            let late: Vec<f64> = ramp(columns - 1, 0.9).iter().map(|s| 1e-3 * s).collect();
            let mut ahead: Vec<f64> = ramp(columns - 1, 0.7).iter().map(|q| 1e-3 * q).collect();
            ahead[columns - 2] = 0.0;
            let along = [0.5, -0.25];

            let mut expected = w.clone();
            start.accumulate(columns - 2, &along, -1.0, &mut expected);
            let mut settled = start.clone();
            let last = start.settled_last(&late);
            settled.columns_mut()[columns - 1].copy_from_slice(&last);
            let dots_before = settled.dots(0, &expected);
            let padded: Vec<f64> = ahead.iter().copied().chain([0.0]).collect();
            settled.accumulate(0, &padded, -1.0, &mut expected);

            let (mut one, mut found) = (start.clone(), w.clone());
            let settling = Settling { late: &late, along: &along, ahead: &ahead };
            let (dots, length) = one.settle_and_dot(&settling, &mut found);
            assert_eq!(one.columns(), settled.columns(), "the column is settled to the same bits");
            assert!((length - norm(&found)).abs() <= rounding(rows, size));
            for (found, expected) in found.iter().zip(&expected) {
                assert!((found - expected).abs() < 1e-15, "a dozen terms of at most 1e-3 on numbers below 2");
            }
            // The columns are not orthogonal here: earlier groups have already removed up to 1e-3 each.
            for (found, expected) in dots.iter().zip(&dots_before) {
                assert!((found - expected).abs() < 1e-3 * columns as f64, "{found} {expected}");
            }
        }
    }

    #[test]
    fn removal_and_inner_products_come_in_one_sweep() {
        for (rows, columns) in [(37, 3), (5 * ROWS + 9, 11)] {
            let (basis, w) = (basis(rows, columns), ramp(rows, 0.37));
            let (dots, length) = basis.dots_and_norm(1, &w);
            let bound = rounding(rows, norm(&w));
            assert!((length - norm(&w)).abs() <= bound);
            assert!(dots.iter().zip(basis.dots(1, &w)).all(|(a, b)| (a - b).abs() <= bound));
            let h = basis.dots(0, &w);
            let (mut one, mut other) = (w.clone(), w);
            let (dots, length) = basis.remove_and_dot(&h, &mut one);
            basis.accumulate(0, &h, -1.0, &mut other);
            assert_eq!(one, other);
            let bound = rounding(rows, norm(&other));
            assert!((length - norm(&other)).abs() <= bound);
            assert!(dots.iter().zip(basis.dots(0, &other)).all(|(a, b)| (a - b).abs() <= bound));
        }
    }

    #[test]
    fn norms_beyond_the_squares_of_floats_are_found() {
        let w = vec![3e200, 4e200];
        let (_, length) = Basis::new(2).dots_and_norm(0, &w);
        // The quotient, the square, the sum, the root and the product are each rounded once.
        assert!((length / 5e200 - 1.0).abs() < 5.0 * f64::EPSILON);
    }
}
