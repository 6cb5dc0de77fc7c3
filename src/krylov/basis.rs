//! A growing set of long vectors, and the kernels with it that take most of the time.
//!
//! All kernels walk fixed blocks of rows in parallel and add the blocks' sums in the order of the rows, so
//! that their results depend neither on the number of threads nor on scheduling.

use rayon::prelude::*;

use super::kernels::{add_block, dot_block, dots_block};

/// Rows in a block: a block of the long vector (8 KiB) stays in the first-level cache while the columns
/// stream past it.
const BLOCK: usize = 1024;

/// The columns of a tall matrix `V` of `rows × len`, each contiguous.
#[derive(Clone, Debug)]
pub(super) struct Basis {
    rows: usize,
    columns: Vec<Vec<f64>>,
    /// Allocated vectors for later columns, so that a step need not allocate.
    spare: Vec<Vec<f64>>,
}

impl Basis {
    /// No columns yet.
    pub(super) fn new(rows: usize) -> Self {
        Self { rows, columns: Vec::new(), spare: Vec::new() }
    }

    /// The length of each column.
    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// The number of columns.
    pub(super) fn len(&self) -> usize {
        self.columns.len()
    }

    /// The columns, in the order in which they were appended.
    pub(super) fn columns(&self) -> &[Vec<f64>] {
        &self.columns
    }

    /// Appends `w / divisor`.
    pub(super) fn push_scaled(&mut self, w: &[f64], divisor: f64) {
        debug_assert_eq!(w.len(), self.rows);
        let mut column = self.spare.pop().unwrap_or_default();
        column.clear();
        // A true division: the reciprocal of a subnormal norm would overflow.
        column.extend(w.iter().map(|&value| value / divisor));
        self.columns.push(column);
    }

    /// Removes all columns; their memory is kept for later columns.
    pub(super) fn clear(&mut self) {
        self.spare.append(&mut self.columns);
    }

    /// Allocates memory for `total` columns in all. Untouched pages cost nothing on common systems.
    pub(super) fn reserve(&mut self, total: usize) {
        self.columns.reserve(total.saturating_sub(self.columns.len()));
        while self.columns.len() + self.spare.len() < total {
            self.spare.push(vec![0.0; self.rows]);
        }
    }

    /// Replaces the columns `first..last` by `V S` over just these columns: one new column for each column of
    /// coefficients. Memory that becomes free is kept for later columns.
    pub(super) fn rotate(&mut self, first: usize, last: usize, coefficients: &[&[f64]]) {
        let mut rotated = Vec::with_capacity(coefficients.len());
        let tail = self.columns.split_off(last);
        for s in coefficients {
            let mut column = self.spare.pop().unwrap_or_default();
            column.clear();
            column.resize(self.rows, 0.0);
            self.accumulate(first, s, 1.0, &mut column);
            rotated.push(column);
        }
        self.spare.extend(self.columns.drain(first..));
        self.columns.extend(rotated);
        self.columns.extend(tail);
    }

    /// `Vᵀ w` over the columns from `first` on.
    pub(super) fn dots(&self, first: usize, w: &[f64]) -> Vec<f64> {
        let columns = self.columns.get(first..).unwrap_or_default();
        let block_sums = |(index, rows): (usize, &[f64])| -> Vec<f64> {
            let mut sums = vec![0.0; columns.len()];
            dots_block(columns, index * BLOCK, rows, &mut sums);
            sums
        };
        let partial: Vec<Vec<f64>> = if w.len() <= 2 * BLOCK {
            w.chunks(BLOCK).enumerate().map(block_sums).collect()
        } else {
            w.par_chunks(BLOCK).enumerate().map(block_sums).collect()
        };
        let mut sums = vec![0.0; columns.len()];
        for block in &partial {
            for (sum, part) in sums.iter_mut().zip(block) {
                *sum += part;
            }
        }
        sums
    }

    /// `Vᵀ w` and `Vᵀ S² w` with `S = diag(s)`, in one pass over the columns.
    pub(super) fn dots_twice(&self, w: &[f64], s: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let count = self.columns.len();
        let block_sums = |(index, (rows, s)): (usize, (&[f64], &[f64]))| -> Vec<f64> {
            let mut weighted = [0.0; BLOCK];
            let weighted = &mut weighted[..rows.len()];
            for ((weighted, row), s) in weighted.iter_mut().zip(rows).zip(s) {
                *weighted = s * s * row;
            }
            let mut sums = vec![0.0; 2 * count];
            let (plain, of_weighted) = sums.split_at_mut(count);
            for ((columns, plain), of_weighted) in
                self.columns.chunks(8).zip(plain.chunks_mut(8)).zip(of_weighted.chunks_mut(8))
            {
                dots_block(columns, index * BLOCK, rows, plain);
                dots_block(columns, index * BLOCK, weighted, of_weighted);
            }
            sums
        };
        let partial: Vec<Vec<f64>> = if w.len() <= 2 * BLOCK {
            w.chunks(BLOCK).zip(s.chunks(BLOCK)).enumerate().map(block_sums).collect()
        } else {
            w.par_chunks(BLOCK).zip(s.par_chunks(BLOCK)).enumerate().map(block_sums).collect()
        };
        let mut plain = vec![0.0; 2 * count];
        for block in &partial {
            for (sum, part) in plain.iter_mut().zip(block) {
                *sum += part;
            }
        }
        let weighted = plain.split_off(count);
        (plain, weighted)
    }

    /// `w ← w + V h` for two pairs `(h, w)`, in one pass over the columns.
    pub(super) fn accumulate_twice(&self, first: (&[f64], &mut [f64]), second: (&[f64], &mut [f64])) {
        let ((a, w), (b, z)) = (first, second);
        debug_assert!(a.len() == self.columns.len() && b.len() == self.columns.len());
        let add = |(index, (w, z)): (usize, (&mut [f64], &mut [f64]))| {
            // Few enough columns at a time that their blocks are still in the cache for the second vector.
            for ((columns, a), b) in self.columns.chunks(8).zip(a.chunks(8)).zip(b.chunks(8)) {
                add_block(columns, a, 1.0, index * BLOCK, w);
                add_block(columns, b, 1.0, index * BLOCK, z);
            }
        };
        if w.len() <= 2 * BLOCK {
            w.chunks_mut(BLOCK).zip(z.chunks_mut(BLOCK)).enumerate().for_each(add);
        } else {
            w.par_chunks_mut(BLOCK).zip(z.par_chunks_mut(BLOCK)).enumerate().for_each(add);
        }
    }

    /// `w ← w + sign · V h` over the columns from `first` on.
    pub(super) fn accumulate(&self, first: usize, coefficients: &[f64], sign: f64, w: &mut [f64]) {
        let columns = self.columns.get(first..).unwrap_or_default();
        debug_assert_eq!(columns.len(), coefficients.len());
        let add = |(index, rows): (usize, &mut [f64])| {
            add_block(columns, coefficients, sign, index * BLOCK, rows);
        };
        if w.len() <= 2 * BLOCK {
            w.chunks_mut(BLOCK).enumerate().for_each(add);
        } else {
            w.par_chunks_mut(BLOCK).enumerate().for_each(add);
        }
    }
}

/// `aᵀ b` of two vectors of one length, summed in an order that does not depend on the number of threads.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    debug_assert_eq!(a.len(), b.len());
    if a.len() <= 2 * BLOCK {
        return a.chunks(BLOCK).zip(b.chunks(BLOCK)).map(|(x, y)| dot_block(x, y)).sum();
    }
    let partial: Vec<f64> =
        a.par_chunks(BLOCK).zip(b.par_chunks(BLOCK)).map(|(x, y)| dot_block(x, y)).collect();
    partial.iter().sum()
}

/// `‖w‖₂`, without overflow or underflow on the way. Infinite or NaN exactly if `w` holds such an entry (or
/// if the norm itself is beyond the largest `f64`).
pub fn norm(w: &[f64]) -> f64 {
    let square = dot(w, w);
    // Between these bounds, no significant square overflowed or underflowed.
    if (1e-280..1e300).contains(&square) {
        return square.sqrt();
    }
    let largest = w.iter().fold(0.0_f64, |largest, value| {
        if value.is_nan() || largest.is_nan() { f64::NAN } else { largest.max(value.abs()) }
    });
    if largest == 0.0 || !largest.is_finite() {
        return largest;
    }
    largest * w.iter().map(|value| (value / largest).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(length: usize, step: f64) -> Vec<f64> {
        (0..length).map(|i| ((i as f64) * step).sin()).collect()
    }

    #[test]
    fn kernels_are_right_across_block_borders() {
        let rows = 5 * BLOCK + 7;
        let mut basis = Basis::new(rows);
        for k in 0..6 {
            basis.push_scaled(&ramp(rows, 0.1 + k as f64), 2.0);
        }
        let w = ramp(rows, 0.37);
        let dots = basis.dots(1, &w);
        let mut sum = w.clone();
        basis.accumulate(1, &dots, -1.0, &mut sum);
        for (k, column) in basis.columns()[1..].iter().enumerate() {
            let plain: f64 = column.iter().zip(&w).map(|(a, b)| a * b).sum();
            // Two orders of summing 5127 products of size below 1/2 differ by less than 5127² · ε/2 · 1/2.
            assert!((plain - dots[k]).abs() < 2e-9, "{plain} {}", dots[k]);
        }
        for row in [0, BLOCK - 1, BLOCK, rows - 1] {
            let expected: f64 = w[row]
                - basis.columns()[1..].iter().zip(&dots).map(|(column, h)| column[row] * h).sum::<f64>();
            // Coefficients reach 1300; five rounded products of that size.
            assert!((expected - sum[row]).abs() < 1e-11);
        }
    }

    #[test]
    fn paired_kernels_equal_the_single_ones() {
        for rows in [37, 3 * BLOCK + 5] {
            let mut basis = Basis::new(rows);
            for k in 0..6 {
                basis.push_scaled(&ramp(rows, 0.2 + k as f64), 1.0);
            }
            let (w, s) = (ramp(rows, 0.31), ramp(rows, 0.07));
            let weighted: Vec<f64> = w.iter().zip(&s).map(|(w, s)| s * s * w).collect();
            assert_eq!(basis.dots_twice(&w, &s), (basis.dots(0, &w), basis.dots(0, &weighted)));
            let (a, b) = (ramp(6, 1.1), ramp(6, 0.3));
            let (mut x, mut y) = (w.clone(), s.clone());
            basis.accumulate_twice((&a, &mut x), (&b, &mut y));
            let (mut one, mut other) = (w, s);
            basis.accumulate(0, &a, 1.0, &mut one);
            basis.accumulate(0, &b, 1.0, &mut other);
            assert!(x == one && y == other, "the same sums in the same order");
        }
    }

    #[test]
    fn sums_are_the_same_to_the_bit_for_any_number_of_threads() {
        let w = ramp(40_000, 0.7);
        let with = |threads| {
            let pool =
                rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads");
            pool.install(|| dot(&w, &w).to_bits())
        };
        assert_eq!(with(1), with(2));
        assert_eq!(with(1), with(7));
    }

    #[test]
    fn norm_neither_overflows_nor_underflows() {
        for scale in [1e-200, 1e200] {
            // A rounding each in quotient, square, sum, root and product.
            assert!((norm(&[3.0 * scale, 4.0 * scale]) / (5.0 * scale) - 1.0).abs() < 5.0 * f64::EPSILON);
        }
        assert_eq!(norm(&[0.0; 3]), 0.0);
        assert!(norm(&[1.0, f64::NAN, 2.0]).is_nan());
        assert_eq!(norm(&[1.0, f64::INFINITY]), f64::INFINITY);
    }
}
