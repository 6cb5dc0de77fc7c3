//! Kernels over one block of rows, which stays in the cache while the columns are read from memory.
//!
//! Columns are taken eight at a time: the block is then read an eighth as often, and eight streams from
//! memory hide one another's latency. The order of additions depends only on the length.

/// Columns that are read at the same time.
const TOGETHER: usize = 8;
/// Partial sums of each column, so that the compiler can use vector registers. It may not reorder a single
/// sum by itself.
const LANES: usize = 4;

/// The inner product of one block.
pub(super) fn dot_block(a: &[f64], b: &[f64]) -> f64 {
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
pub(super) fn dots_block(columns: &[Vec<f64>], start: usize, rows: &[f64], sums: &mut [f64]) {
    let range = start..start + rows.len();
    let (groups, rest) = columns.as_chunks::<TOGETHER>();
    let (group_sums, rest_sums) = sums.split_at_mut(TOGETHER * groups.len());
    for (group, sums) in groups.iter().zip(group_sums.chunks_exact_mut(TOGETHER)) {
        sums.copy_from_slice(&dots(group.each_ref().map(|column| &column[range.clone()]), rows));
    }
    for (column, sum) in rest.iter().zip(rest_sums) {
        [*sum] = dots([&column[range.clone()]], rows);
    }
}

/// The same sum for each column, whatever `K` is.
fn dots<const K: usize>(columns: [&[f64]; K], rows: &[f64]) -> [f64; K] {
    let (chunks, tail) = rows.as_chunks::<LANES>();
    let mut sums = [[0.0; LANES]; K];
    for (index, x) in chunks.iter().enumerate() {
        for (column, sums) in columns.iter().zip(&mut sums) {
            let y = &column[index * LANES..(index + 1) * LANES];
            for lane in 0..LANES {
                sums[lane] += x[lane] * y[lane];
            }
        }
    }
    let first = rows.len() - tail.len();
    std::array::from_fn(|k| {
        let rest: f64 = tail.iter().zip(&columns[k][first..]).map(|(x, y)| x * y).sum();
        (sums[k][0] + sums[k][1]) + (sums[k][2] + sums[k][3]) + rest
    })
}

/// `rows ← rows + sign · V h` for the rows of one block, which begins at `start`.
pub(super) fn add_block(
    columns: &[Vec<f64>],
    coefficients: &[f64],
    sign: f64,
    start: usize,
    rows: &mut [f64],
) {
    let range = start..start + rows.len();
    let (groups, rest) = columns.as_chunks::<TOGETHER>();
    let (group_factors, rest_factors) = coefficients.as_chunks::<TOGETHER>();
    for (group, factors) in groups.iter().zip(group_factors) {
        let columns = group.each_ref().map(|column| &column[range.clone()]);
        let f = factors.map(|factor| sign * factor);
        let sum = |entries: [f64; TOGETHER]| {
            let part = |k: usize| f[k] * entries[k];
            ((part(0) + part(1)) + (part(2) + part(3))) + ((part(4) + part(5)) + (part(6) + part(7)))
        };
        let (chunks, tail) = rows.as_chunks_mut::<LANES>();
        let first = LANES * chunks.len();
        for (index, values) in chunks.iter_mut().enumerate() {
            let entries = columns.map(|column| &column[index * LANES..(index + 1) * LANES]);
            for (lane, value) in values.iter_mut().enumerate() {
                *value += sum(entries.map(|entries| entries[lane]));
            }
        }
        for (row, value) in (first..).zip(tail) {
            *value += sum(columns.map(|column| column[row]));
        }
    }
    for (column, factor) in rest.iter().zip(rest_factors) {
        let factor = sign * factor;
        for (value, entry) in rows.iter_mut().zip(&column[range.clone()]) {
            *value += factor * entry;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_summed_equally_at_any_position() {
        let rows: Vec<f64> = (0..103).map(|i| (i as f64 * 0.7).sin()).collect();
        let column: Vec<f64> = (0..203).map(|i| (i as f64 * 1.3).cos()).collect();
        let columns = vec![column.clone(); 11];
        let mut sums = vec![0.0; 11];
        dots_block(&columns, 50, &rows, &mut sums);
        assert!(sums.iter().all(|sum| sum.to_bits() == sums[0].to_bits()), "{sums:?}");
        // Another order of the same 103 products, each below 1.
        assert!((sums[0] - dot_block(&column[50..153], &rows)).abs() < 103.0 * f64::EPSILON);
        let mut added = rows.clone();
        add_block(&columns, &[0.5; 11], -2.0, 50, &mut added);
        for ((added, row), entry) in added.iter().zip(&rows).zip(&column[50..]) {
            assert!((added - (row - 11.0 * entry)).abs() < 20.0 * f64::EPSILON, "eleven terms of size 1");
        }
    }
}
