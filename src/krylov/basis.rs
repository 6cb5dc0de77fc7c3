//! Long vectors: a growing basis, orthogonalization, and the sums and updates that take most of the time.
//!
//! All kernels process fixed blocks of rows in parallel and add the sums of the blocks in the order of the rows. Results therefore depend
//! neither on the number of threads nor on scheduling.

use std::convert::Infallible;

use rayon::prelude::*;

use super::kernels::{add_block, dot_block, dots_block};
pub(super) use crate::operator::vectors::norm_of_square;

/// The rows of a block. A block of the long vector (8 KiB) stays in the first-level cache while the columns are read from memory.
const BLOCK: usize = 1024;

/// The columns of a tall matrix `V` of `rows × len`. Each column is contiguous in memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Basis {
    rows: usize,
    columns: Vec<Vec<f64>>,
    /// Allocated vectors for later columns, so that a step does not allocate.
    spare: Vec<Vec<f64>>,
}

impl Basis {
    pub(super) fn new(rows: usize) -> Self {
        Self { rows, columns: Vec::new(), spare: Vec::new() }
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    pub(super) fn len(&self) -> usize {
        self.columns.len()
    }

    pub(super) fn columns(&self) -> &[Vec<f64>] {
        &self.columns
    }

    pub(super) fn columns_mut(&mut self) -> &mut [Vec<f64>] {
        &mut self.columns
    }

    pub(super) fn push_scaled(&mut self, w: &[f64], divisor: f64) {
        debug_assert_eq!(w.len(), self.rows);
        let mut column = self.spare.pop().unwrap_or_default();
        // A true division: the reciprocal of a subnormal norm would overflow.
        let divided = |value: &f64| value / divisor;
        if w.len() < PARALLEL {
            column.clear();
            column.extend(w.iter().map(divided));
        } else {
            // The first write to new pages takes longer than the division.
            w.par_iter().map(divided).collect_into_vec(&mut column);
        }
        self.columns.push(column);
    }

    /// Removes the columns from `len` on, and keeps their memory for later columns.
    pub(super) fn truncate(&mut self, len: usize) {
        self.spare.extend(self.columns.drain(len..));
    }

    /// Removes all columns, and keeps their memory for later columns.
    pub(super) fn clear(&mut self) {
        self.spare.append(&mut self.columns);
    }

    /// Allocates memory for `total` columns. Pages that are not yet written cost nothing on common systems.
    pub(super) fn reserve(&mut self, total: usize) {
        self.columns.reserve(total.saturating_sub(self.columns.len()));
        while self.columns.len() + self.spare.len() < total {
            self.spare.push(vec![0.0; self.rows]);
        }
    }

    /// Replaces the columns `first..last` by `V S`, where `V` holds these columns and `S` the coefficients. Each column of coefficients
    /// makes one new column. Freed memory is kept for later columns.
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

    /// `Vᵀ w` over the columns from `first`.
    pub(super) fn dots(&self, first: usize, w: &[f64]) -> Vec<f64> {
        let columns = self.columns.get(first..).unwrap_or_default();
        let is_long = w.len() > 2 * BLOCK;
        summed(columns.len(), is_long, w.chunks(BLOCK), |index, rows, sums| {
            dots_block(columns, index * BLOCK, rows, sums);
        })
    }

    /// `w ← w + sign · V h` over the columns from `first`.
    pub(super) fn accumulate(&self, first: usize, coefficients: &[f64], sign: f64, w: &mut [f64]) {
        debug_assert_eq!(self.columns.len(), first + coefficients.len());
        accumulate(self.columns.get(first..).unwrap_or_default(), coefficients, sign, w);
    }

    /// `w ← w + sign · V h` over the first columns, one for each coefficient.
    pub(super) fn accumulate_first(&self, coefficients: &[f64], sign: f64, w: &mut [f64]) {
        accumulate(&self.columns[..coefficients.len()], coefficients, sign, w);
    }
}

/// Computes `count` sums over blocks of rows with `block`, and adds them in the order of the rows. Long vectors use several threads.
pub(super) fn summed<T: Send>(
    count: usize,
    is_long: bool,
    blocks: impl Iterator<Item = T>,
    block: impl Fn(usize, T, &mut [f64]) + Sync,
) -> Vec<f64> {
    let of_block = |(index, rows): (usize, T)| {
        let mut sums = vec![0.0; count];
        block(index, rows, &mut sums);
        sums
    };
    let blocks: Vec<(usize, T)> = blocks.enumerate().collect();
    let partial: Vec<Vec<f64>> = if is_long {
        blocks.into_par_iter().map(of_block).collect()
    } else {
        blocks.into_iter().map(of_block).collect()
    };
    let mut sums = vec![0.0; count];
    for block in partial {
        sums.iter_mut().zip(block).for_each(|(sum, part)| *sum += part);
    }
    sums
}

/// `w ← w + sign · V h` over these columns.
fn accumulate(columns: &[Vec<f64>], coefficients: &[f64], sign: f64, w: &mut [f64]) {
    let add = |(index, rows): (usize, &mut [f64])| {
        add_block(columns, coefficients, sign, index * BLOCK, rows);
    };
    if w.len() <= 2 * BLOCK {
        w.chunks_mut(BLOCK).enumerate().for_each(add);
    } else {
        w.par_chunks_mut(BLOCK).enumerate().for_each(add);
    }
}

/// `aᵀ b` of two vectors of equal length, summed in an order that does not depend on the number of threads.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    debug_assert_eq!(a.len(), b.len());
    if a.len() <= 2 * BLOCK {
        return a.chunks(BLOCK).zip(b.chunks(BLOCK)).map(|(x, y)| dot_block(x, y)).sum();
    }
    let partial: Vec<f64> =
        a.par_chunks(BLOCK).zip(b.par_chunks(BLOCK)).map(|(x, y)| dot_block(x, y)).collect();
    partial.iter().sum()
}

/// `‖w‖₂`, without intermediate overflow or underflow. It is infinite or NaN only if `w` holds an infinity or NaN, or if the norm exceeds
/// the largest `f64`.
pub fn norm(w: &[f64]) -> f64 {
    norm_of_square(dot(w, w), w)
}

/// Below this length, threads cost more time than they save.
const PARALLEL: usize = 16_384;
const CHUNK: usize = 4096;

/// `wᵢ ← f(wᵢ, aᵢ)`.
pub(super) fn update(w: &mut [f64], a: &[f64], f: impl Fn(f64, f64) -> f64 + Sync) {
    update2(w, a, a, |w, a, _| f(w, a));
}

/// `wᵢ ← f(wᵢ, aᵢ, bᵢ)`.
pub(super) fn update2(w: &mut [f64], a: &[f64], b: &[f64], f: impl Fn(f64, f64, f64) -> f64 + Sync) {
    debug_assert!(w.len() == a.len() && w.len() == b.len());
    in_blocks(w, a, b, &|w, a, b| {
        for ((w, &a), &b) in w.iter_mut().zip(a).zip(b) {
            *w = f(*w, a, b);
        }
    });
}

// The loops over entries are compiled for every `f`, but the distribution over threads is compiled only once, for a dynamic `Update`. The
// distribution is by far the larger part of the code, and one indirect call per block has no measurable cost.

type Update<'a> = dyn Fn(&mut [f64], &[f64], &[f64]) + Sync + 'a;

fn in_blocks(w: &mut [f64], a: &[f64], b: &[f64], block: &Update<'_>) {
    if w.len() < PARALLEL {
        block(w, a, b);
    } else {
        let parts = w.par_chunks_mut(CHUNK).zip(a.par_chunks(CHUNK)).zip(b.par_chunks(CHUNK));
        parts.for_each(|((w, a), b)| block(w, a, b));
    }
}

pub(super) fn axpy(alpha: f64, x: &[f64], y: &mut [f64]) {
    update(y, x, |y, x| y + alpha * x);
}

/// If the remainder of a pass has more than this share of the norm before the pass, the remainder is orthogonal to working precision.
/// Otherwise cancellation has amplified the rounding errors, and another pass may be needed. 1/√2 is the choice of Daniel, Gragg, Kaufman
/// and Stewart, *Reorthogonalization and stable algorithms for updating the Gram–Schmidt QR factorization*, Math. Comp. 30 (1976),
/// doi:10.1090/S0025-5718-1976-0431641-8.
pub(super) const ENOUGH_LEFT: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Inner products of at most this share of the norm are rounding errors, so another pass would not reduce them.
const NEGLIGIBLE: f64 = 8.0 * f64::EPSILON;

/// Returns true if the norm `left` of a remainder exceeds the rounding errors of sums of `n` terms of norm `size`.
pub(super) fn exceeds_rounding(left: f64, size: f64, n: usize) -> bool {
    left > size * f64::EPSILON * (10.0 + (n as f64).sqrt())
}

/// The largest number of passes. Two passes suffice (Giraud, Langou, Rozložník and van den Eshof, doi:10.1007/s00211-005-0615-4) unless `w`
/// lies in the span to working precision. Such a vector shrinks to rounding errors, and its small norm reveals it.
pub(super) const PASSES: usize = 3;

pub(super) struct Removed {
    /// `h`, so that `w_before = V h + w_after`.
    pub(super) coefficients: Vec<f64>,
    /// `‖w_after‖`.
    pub(super) norm: f64,
}

/// `w ← (I − V Vᵀ) w` by blocked classical Gram–Schmidt with a selective second pass, for `V` with orthonormal columns.
///
/// A pass takes all inner products and then removes all components. While it removes them, the same sweep takes the inner products for the
/// next pass. `p` passes therefore read the basis `p + 1` times instead of `2p` times.
///
/// # Bound
/// For `m` columns of `n` rows let `γ = (r + 2m + 12) ε/2`, with `r = 128 + n/512`. Inner products are summed within blocks of 512 rows in
/// four lanes, then over the blocks, and over a few remaining rows. Their relative error is `(r + 10) ε/2`. A removal rounds `m + 1` times.
/// One pass leaves `‖Vᵀw‖ ≤ √k γ ‖w_before‖` for `k` columns that are orthonormal to working precision. Another pass is skipped in two
/// cases only:
///
/// * The remainder `w` has more than `1/√2` of the norm (Daniel, Gragg, Kaufman and Stewart): `‖Vᵀw‖ ≤ √(2k) γ ‖w‖`.
/// * The inner products with the remainder, which are already known, are at most `8ε ‖w‖`: `‖Vᵀw‖ ≤ (8ε + √k γ) ‖w‖`.
///
/// In both cases, `m` columns satisfy `‖I − VᵀV‖_F ≤ √(2 Σ_k ‖V_kᵀv_{k+1}‖²) ≤ m (√2 γ + 8ε)`, because the sum of `2k` over the columns is
/// at most `m²`. A test checks this bound on difficult cases.
pub(super) fn orthogonalize(basis: &Basis, w: &mut [f64]) -> Removed {
    let start = basis.dots_and_norm(0, w);
    let Ok(removed) = orthogonalized(start, |h| Ok::<_, Infallible>(basis.remove_and_dot(h, w)));
    removed
}

/// The passes of [`orthogonalize`], from the first inner products and norm. `remove_and_dot` removes components, and returns the next ones.
pub(super) fn orthogonalized<E>(
    (mut next, mut length): (Vec<f64>, f64),
    mut remove_and_dot: impl FnMut(&[f64]) -> Result<(Vec<f64>, f64), E>,
) -> Result<Removed, E> {
    let mut coefficients = vec![0.0; next.len()];
    if next.is_empty() {
        return Ok(Removed { coefficients, norm: length });
    }
    for _ in 0..PASSES {
        let before = length;
        coefficients.iter_mut().zip(&next).for_each(|(sum, part)| *sum += part);
        (next, length) = remove_and_dot(&next)?;
        if length > ENOUGH_LEFT * before || norm(&next) <= NEGLIGIBLE * length {
            break;
        }
    }
    Ok(Removed { coefficients, norm: length })
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
            // Two summation orders of 5127 products of size below 1/2 differ by less than 5127² · ε/2 · 1/2.
            assert!((plain - dots[k]).abs() < 2e-9, "{plain} {}", dots[k]);
        }
        for row in [0, BLOCK - 1, BLOCK, rows - 1] {
            let expected: f64 = w[row]
                - basis.columns()[1..].iter().zip(&dots).map(|(column, h)| column[row] * h).sum::<f64>();
            // The coefficients reach 1300. Five products of this size are rounded.
            assert!((expected - sum[row]).abs() < 1e-11);
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
            // The quotient, the square, the sum, the root and the product are each rounded once.
            assert!((norm(&[3.0 * scale, 4.0 * scale]) / (5.0 * scale) - 1.0).abs() < 5.0 * f64::EPSILON);
        }
        assert_eq!(norm(&[0.0; 3]), 0.0);
        assert!(norm(&[1.0, f64::NAN, 2.0]).is_nan());
        assert_eq!(norm(&[1.0, f64::INFINITY]), f64::INFINITY);
    }

    #[test]
    fn long_and_short_vectors_are_updated_equally() {
        for n in [3, PARALLEL + 5] {
            let a: Vec<f64> = (0..n).map(|i| i as f64).collect();
            let b = vec![2.0; n];
            let mut w = vec![1.0; n];
            axpy(3.0, &a, &mut w);
            update2(&mut w, &a, &b, |w, a, b| w - b * a);
            assert!(w.iter().zip(&a).all(|(w, a)| *w == 1.0 + a), "1 + 3a − 2a, exact in small integers");
        }
    }

    type Entry<'a> = dyn Fn(usize, usize) -> f64 + 'a;

    fn bound(m: usize, n: usize) -> f64 {
        let gamma = (128.0 + n as f64 / 512.0 + 2.0 * m as f64 + 12.0) * f64::EPSILON / 2.0;
        m as f64 * (std::f64::consts::SQRT_2 * gamma + 8.0 * f64::EPSILON)
    }

    /// `‖I − VᵀV‖_F`.
    fn loss(basis: &Basis) -> f64 {
        let gram = basis.columns().iter().map(|column| basis.dots(0, column));
        let square = |(i, row): (usize, Vec<f64>)| -> f64 {
            row.iter().enumerate().map(|(j, dot)| (dot - f64::from(u8::from(i == j))).powi(2)).sum()
        };
        gram.enumerate().map(square).sum::<f64>().sqrt()
    }

    #[test]
    fn nearly_dependent_directions_stay_within_the_bound() {
        let n = 3000;
        let wave = |k: usize| move |i: usize| ((i * (k + 1)) as f64 * 0.01).sin();
        let cases: [(&str, &Entry<'_>); 4] = [
            // Läuchli's matrix: one pass of classical Gram–Schmidt loses orthogonality like ε/1e-8.
            ("Läuchli", &|i, k| if i == 0 { 1.0 } else { f64::from(u8::from(i == k + 1)) * 1e-8 }),
            // Powers of x: an extremely ill-conditioned basis.
            ("Vandermonde", &|i, k| (i as f64 / n as f64).powi(k as i32)),
            ("large dynamic range", &|i, k| wave(k)(i) * 10.0_f64.powi(((i * 7) % 25) as i32 - 12)),
            ("nearly equal", &|i, k| 1.0 + 1e-10 * wave(k)(i)),
        ];
        for (name, entry) in cases {
            let mut basis = Basis::new(n);
            for k in 0..64 {
                let mut w: Vec<f64> = (0..n).map(|i| entry(i, k)).collect();
                let before = norm(&w);
                let removed = orthogonalize(&basis, &mut w);
                // A vector with a smaller norm is in the span, to rounding.
                if removed.norm > before * f64::EPSILON * (10.0 + (n as f64).sqrt()) {
                    basis.push_scaled(&w, removed.norm);
                }
            }
            let loss = loss(&basis);
            assert!(basis.len() > 12, "{name}: {} columns", basis.len());
            assert!(loss <= bound(basis.len(), n), "{name}: {loss:e} with {} columns", basis.len());
        }
    }

    #[test]
    fn coefficients_and_rest_add_up_to_the_vector() {
        let mut basis = Basis::new(3);
        basis.push_scaled(&[3.0, 0.0, 4.0], 5.0);
        basis.push_scaled(&[0.0, 2.0, 0.0], 2.0);
        let mut w = vec![1.0, 2.0, 3.0];
        let removed = orthogonalize(&basis, &mut w);
        basis.accumulate(0, &removed.coefficients, 1.0, &mut w);
        for (value, expected) in w.iter().zip([1.0, 2.0, 3.0]) {
            assert!((value - expected).abs() < 1e-15, "rounding of three numbers of size 3");
        }
    }
}
