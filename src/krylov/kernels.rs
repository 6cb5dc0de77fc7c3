//! Kernels over one block of rows, which stays in the cache while the columns are read from memory.
//!
//! Columns are taken in groups of eight, then of four, then singly. With groups of eight, the block is read an eighth as often, and the
//! latencies of eight streams from memory overlap. The order of additions depends only on the length and the number of columns.
//!
//! Each kernel is compiled twice: for all processors, and for processors with registers of four numbers (AVX2). The version is chosen at
//! run time. Both versions round products and sums separately, so their results are bitwise equal. With AVX2, the work on a column in the
//! cache takes half the time and overlaps with the memory access.

#![allow(
    unsafe_code,
    reason = "instructions that not every processor has are called where this one has them"
)]

/// The number of columns that are read at the same time.
const TOGETHER: usize = 8;

/// The number of columns in a group if fewer than [`TOGETHER`] columns remain.
const HALF: usize = 4;

/// The number of partial sums of each column. With partial sums, the compiler can use vector registers; it may not reorder a single sum.
const LANES: usize = 4;

/// Calls the version of a kernel for the widest registers of this processor.
macro_rules! widest {
    ($kernel:ident($($argument:ident: $type:ty),*) -> $result:ty) => {{
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2")]
            fn wide($($argument: $type),*) -> $result {
                $kernel($($argument),*)
            }
            if is_x86_feature_detected!("avx2") {
                // SAFETY: the processor has the instructions.
                return unsafe { wide($($argument),*) };
            }
        }
        $kernel($($argument),*)
    }};
}

/// Evaluates a call for each group of columns, cut to the rows of a block. The call also receives the index of the group's first column.
macro_rules! in_groups {
    ($columns:ident, $start:expr, $rows:expr, |$first:ident, $group:ident| $call:expr) => {{
        let (eights, rest) = $columns.as_chunks::<TOGETHER>();
        let (fours, ones) = rest.as_chunks::<HALF>();
        let mut $first = 0;
        for columns in eights {
            let $group = columns.each_ref().map(|column| &column[$start..$start + $rows]);
            $call;
            $first += TOGETHER;
        }
        for columns in fours {
            let $group = columns.each_ref().map(|column| &column[$start..$start + $rows]);
            $call;
            $first += HALF;
        }
        for column in ones {
            let $group = [&column[$start..$start + $rows]];
            $call;
            $first += 1;
        }
    }};
}

pub(super) fn dot_block(a: &[f64], b: &[f64]) -> f64 {
    widest!(dot(a: &[f64], b: &[f64]) -> f64)
}

#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a_chunks, a_tail) = a.as_chunks::<8>();
    let (b_chunks, b_tail) = b.as_chunks::<8>();
    for (x, y) in a_chunks.iter().zip(b_chunks) {
        for lane in 0..8 {
            sums[lane] += x[lane] * y[lane];
        }
    }
    let tail: f64 = a_tail.iter().zip(b_tail).map(|(x, y)| x * y).sum();
    ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7])) + tail
}

/// `Vᵀ w` for the rows of one block, which begins at `start`.
pub(super) fn dots_block(columns: &[Vec<f64>], start: usize, w: &[f64], sums: &mut [f64]) {
    widest!(dots(columns: &[Vec<f64>], start: usize, w: &[f64], sums: &mut [f64]) -> ());
}

#[inline(always)]
fn dots(columns: &[Vec<f64>], start: usize, w: &[f64], sums: &mut [f64]) {
    in_groups!(columns, start, w.len(), |first, group| {
        let [of_group] = dots_of(group, [w]);
        sums[first..first + of_group.len()].copy_from_slice(&of_group);
    });
}

/// Two vectors, for example for inner products as in [`dots_block`].
pub(super) type Pair<'a> = (&'a [f64], &'a [f64]);

pub(super) type PairMut<'a> = (&'a mut [f64], &'a mut [f64]);

/// `Vᵀ x` and `Vᵀ z` for the rows of one block, which begins at `start`.
pub(super) fn dots_pair_block(columns: &[Vec<f64>], start: usize, of: Pair<'_>, sums: PairMut<'_>) {
    widest!(dots_pair(columns: &[Vec<f64>], start: usize, of: Pair<'_>, sums: PairMut<'_>) -> ());
}

#[inline(always)]
fn dots_pair(columns: &[Vec<f64>], start: usize, (x, z): Pair<'_>, (of_x, of_z): PairMut<'_>) {
    in_groups!(columns, start, x.len(), |first, group| {
        let [with_x, with_z] = dots_of(group, [x, z]);
        of_x[first..first + with_x.len()].copy_from_slice(&with_x);
        of_z[first..first + with_z.len()].copy_from_slice(&with_z);
    });
}

/// Computes each inner product with the same order of additions, for any number of columns and vectors.
#[inline(always)]
fn dots_of<const K: usize, const M: usize>(columns: [&[f64]; K], vectors: [&[f64]; M]) -> [[f64; K]; M] {
    let chunks = vectors.map(|vector| vector.as_chunks::<LANES>().0);
    let columns_chunks = columns.map(|column| column.as_chunks::<LANES>().0);
    let count = chunks[0].len();
    let mut sums = [[[0.0; LANES]; K]; M];
    for index in 0..count {
        let x = chunks.map(|chunks| chunks[index]);
        for k in 0..K {
            let y = columns_chunks[k][index];
            for (x, sums) in x.iter().zip(&mut sums) {
                for lane in 0..LANES {
                    sums[k][lane] += x[lane] * y[lane];
                }
            }
        }
    }
    let first = LANES * count;
    std::array::from_fn(|m| {
        std::array::from_fn(|k| {
            let tail = vectors[m][first..].iter().zip(&columns[k][first..]);
            let rest: f64 = tail.map(|(x, y)| x * y).sum();
            let [a, b, c, d] = sums[m][k];
            (a + b) + (c + d) + rest
        })
    })
}

/// `w ← w + sign · V h` for the rows of one block, which begins at `start`, one column after the other.
pub(super) fn add_block(columns: &[Vec<f64>], h: &[f64], sign: f64, start: usize, w: &mut [f64]) {
    widest!(add(columns: &[Vec<f64>], h: &[f64], sign: f64, start: usize, w: &mut [f64]) -> ());
}

#[inline(always)]
fn add(columns: &[Vec<f64>], h: &[f64], sign: f64, start: usize, w: &mut [f64]) {
    in_groups!(columns, start, w.len(), |first, group| add_of(group, [&h[first..]], sign, [&mut *w]));
}

/// `w ← w + V h` for two pairs `(h, w)` and the rows of one block, which begins at `start`.
pub(super) fn add_pair_block(columns: &[Vec<f64>], h: Pair<'_>, start: usize, to: PairMut<'_>) {
    widest!(add_pair(columns: &[Vec<f64>], h: Pair<'_>, start: usize, to: PairMut<'_>) -> ());
}

#[inline(always)]
fn add_pair(columns: &[Vec<f64>], (f, h): Pair<'_>, start: usize, (u, w): PairMut<'_>) {
    in_groups!(columns, start, u.len(), |first, group| {
        add_of(group, [&f[first..], &h[first..]], 1.0, [&mut *u, &mut *w]);
    });
}

#[inline(always)]
fn add_of<const K: usize, const M: usize>(
    columns: [&[f64]; K],
    h: [&[f64]; M],
    sign: f64,
    mut to: [&mut [f64]; M],
) {
    let factors: [[f64; K]; M] = h.map(|h| std::array::from_fn(|k| sign * h[k]));
    let columns_chunks = columns.map(|column| column.as_chunks::<LANES>().0);
    let count = columns_chunks[0].len();
    for index in 0..count {
        let y = columns_chunks.map(|chunks| chunks[index]);
        for (to, factors) in to.iter_mut().zip(&factors) {
            let to = &mut to.as_chunks_mut::<LANES>().0[index];
            // The values stay in registers.
            let mut values = *to;
            for k in 0..K {
                for lane in 0..LANES {
                    values[lane] += factors[k] * y[k][lane];
                }
            }
            *to = values;
        }
    }
    for (to, factors) in to.iter_mut().zip(&factors) {
        for (row, value) in to.iter_mut().enumerate().skip(LANES * count) {
            for (column, factor) in columns.iter().zip(factors) {
                *value += factor * column[row];
            }
        }
    }
}

/// For the rows of one block, which begins at `start`, computes `Vᵀ w`, then `u ← u − V s` and `w ← w − V q`, for the coefficients
/// `(s, q)`. The inner products with a group of columns are taken while `w` still contains the parts along this group and later groups.
pub(super) fn settle_block(
    columns: &[Vec<f64>],
    by: Pair<'_>,
    start: usize,
    of: PairMut<'_>,
    sums: &mut [f64],
) {
    widest!(settle(columns: &[Vec<f64>], by: Pair<'_>, start: usize, of: PairMut<'_>, sums: &mut [f64]) -> ());
}

#[inline(always)]
fn settle(columns: &[Vec<f64>], (s, q): Pair<'_>, start: usize, (u, w): PairMut<'_>, sums: &mut [f64]) {
    in_groups!(columns, start, w.len(), |first, group| {
        let of_group = settle_of(group, (&s[first..], &q[first..]), u, w);
        sums[first..first + of_group.len()].copy_from_slice(&of_group);
    });
}

/// Reads each entry of a column once, and uses it three times.
#[inline(always)]
fn settle_of<const K: usize>(columns: [&[f64]; K], by: Pair<'_>, u: &mut [f64], w: &mut [f64]) -> [f64; K] {
    let [s, q]: [[f64; K]; 2] = [by.0, by.1].map(|h| std::array::from_fn(|k| h[k]));
    let columns_chunks = columns.map(|column| column.as_chunks::<LANES>().0);
    let (u_chunks, u_tail) = u.as_chunks_mut::<LANES>();
    let (w_chunks, w_tail) = w.as_chunks_mut::<LANES>();
    let mut sums = [[0.0; LANES]; K];
    for (index, (u, w)) in u_chunks.iter_mut().zip(w_chunks.iter_mut()).enumerate() {
        // The values stay in registers.
        let (before, mut of_u, mut of_w) = (*w, *u, *w);
        for k in 0..K {
            let y = columns_chunks[k][index];
            for lane in 0..LANES {
                sums[k][lane] += before[lane] * y[lane];
                of_u[lane] -= s[k] * y[lane];
                of_w[lane] -= q[k] * y[lane];
            }
        }
        (*u, *w) = (of_u, of_w);
    }
    let first = LANES * w_chunks.len();
    let mut rests = [0.0; K];
    for (row, (u, w)) in (first..).zip(u_tail.iter_mut().zip(w_tail)) {
        let before = *w;
        for (k, column) in columns.iter().enumerate() {
            rests[k] += before * column[row];
            *u -= s[k] * column[row];
            *w -= q[k] * column[row];
        }
    }
    std::array::from_fn(|k| (sums[k][0] + sums[k][1]) + (sums[k][2] + sums[k][3]) + rests[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_compilations_of_a_kernel_give_the_same_bits() {
        let wave = |n: usize, step: f64| -> Vec<f64> { (0..n).map(|i| (i as f64 * step).sin()).collect() };
        let columns: Vec<Vec<f64>> = (0..13).map(|k| wave(111, 0.3 + k as f64)).collect();
        let (s, q) = (wave(13, 0.9), wave(13, 1.7));
        // The functions without a suffix are compiled for every processor, and the `_block` functions for the processor that runs the test.
        let mut found = [const { Vec::new() }; 2];
        for (is_wide, found) in [false, true].into_iter().zip(&mut found) {
            let (mut u, mut w) = (wave(103, 0.2), wave(103, 0.7));
            let [mut a, mut b, mut c, mut d] = [const { [0.0; 13] }; 4];
            let block = if is_wide { dot_block(&u, &w) } else { dot(&u, &w) };
            (if is_wide { dots_block } else { dots })(&columns, 5, &w, &mut a);
            (if is_wide { dots_pair_block } else { dots_pair })(&columns, 5, (&u, &w), (&mut b, &mut c));
            assert_eq!(a, c, "one vector or two, the same sums");
            (if is_wide { add_block } else { add })(&columns, &s, -1.0, 5, &mut u);
            (if is_wide { add_pair_block } else { add_pair })(&columns, (&s, &q), 5, (&mut u, &mut w));
            (if is_wide { settle_block } else { settle })(&columns, (&s, &q), 5, (&mut u, &mut w), &mut d);
            *found = [&u[..], &w, &a, &b, &c, &d, &[block]].concat();
        }
        assert!(found[0].iter().zip(&found[1]).all(|(a, b)| a.to_bits() == b.to_bits()));
    }

    #[test]
    fn columns_are_summed_equally_at_any_position() {
        let rows: Vec<f64> = (0..103).map(|i| (i as f64 * 0.7).sin()).collect();
        let column: Vec<f64> = (0..203).map(|i| (i as f64 * 1.3).cos()).collect();
        let columns = vec![column.clone(); 11];
        let mut sums = vec![0.0; 11];
        dots_block(&columns, 50, &rows, &mut sums);
        assert!(sums.iter().all(|sum| sum.to_bits() == sums[0].to_bits()), "{sums:?}");
        // The same 103 products, each below 1, are added in another order.
        assert!((sums[0] - dot_block(&column[50..153], &rows)).abs() < 103.0 * f64::EPSILON);
        let mut added = rows.clone();
        add_block(&columns, &[0.5; 11], -2.0, 50, &mut added);
        for ((added, row), entry) in added.iter().zip(&rows).zip(&column[50..]) {
            assert!((added - (row - 11.0 * entry)).abs() < 20.0 * f64::EPSILON, "eleven terms of size 1");
        }
    }
}
