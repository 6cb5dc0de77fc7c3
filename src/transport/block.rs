//! Products with a block of vectors: four at a time are interleaved, so that the matrix is read once for four
//! products.

use rayon::prelude::*;

use super::matrix::{Direction, Part, TransportMatrix};
use super::tiles::{BLOCK_WIDTH, Interleaved};

/// Entries that one task interleaves.
const TASK: usize = 4096;

/// Interleaves at most four vectors of equal length: element `i` holds entry `i` of each, and zeros in the
/// places of missing vectors.
pub(super) fn interleave(vectors: &[&[f64]]) -> Vec<Interleaved> {
    let mut values = vec![Interleaved::default(); vectors.first().map_or(0, |vector| vector.len())];
    values.par_chunks_mut(TASK).enumerate().for_each(|(task, values)| {
        for (place, vector) in vectors.iter().enumerate() {
            let vector = &vector[task * TASK..];
            values.iter_mut().zip(vector).for_each(|(value, &entry)| value.0[place] = entry);
        }
    });
    values
}

/// The reverse of [`interleave`]: writes each vector to its own slice.
pub(super) fn deinterleave(values: &[Interleaved], to: &mut [&mut [f64]]) {
    to.par_iter_mut().enumerate().for_each(|(place, vector)| {
        vector.iter_mut().zip(values).for_each(|(entry, value)| *entry = value.0[place]);
    });
}

impl TransportMatrix {
    /// `y_k ← P x_k` for each of `xs`, with the same bits as [`TransportMatrix::apply`]. The matrix is read
    /// once for four products. There are as many `ys` as `xs`; each has an entry for each camera pixel.
    pub fn apply_block(&self, part: Part, channel: usize, xs: &[&[f64]], ys: &mut [&mut [f64]]) {
        self.multiply_block(Direction::Forward, part, channel, xs, ys);
    }

    /// As [`TransportMatrix::apply_block`], in either direction.
    pub(super) fn multiply_block(
        &self,
        direction: Direction,
        part: Part,
        channel: usize,
        from: &[&[f64]],
        to: &mut [&mut [f64]],
    ) {
        assert_eq!(from.len(), to.len(), "a product for each vector");
        for (from, to) in from.chunks(BLOCK_WIDTH).zip(to.chunks_mut(BLOCK_WIDTH)) {
            if let ([from], [to]) = (from, &mut *to) {
                self.multiply(direction, part, channel, from, to);
                continue;
            }
            let mut values = vec![Interleaved::default(); to[0].len()];
            self.multiply(direction, part, channel, &interleave(from), &mut values);
            deinterleave(&values, to);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// More entries than two tasks take, and three vectors for four places.
    #[test]
    fn vectors_of_several_tasks_are_interleaved_in_their_order() {
        let length = 2 * TASK + 7;
        let vectors: Vec<Vec<f64>> =
            (0..3).map(|place| (0..length).map(|entry| (10 * entry + place) as f64).collect()).collect();
        let values = interleave(&vectors.iter().map(Vec::as_slice).collect::<Vec<_>>());
        assert_eq!(values.len(), length);
        for (entry, value) in values.iter().enumerate() {
            let first = (10 * entry) as f64;
            assert_eq!(value.0, [first, first + 1.0, first + 2.0, 0.0]);
        }
        let mut back = vec![vec![f64::NAN; length]; 3];
        deinterleave(&values, &mut back.iter_mut().map(Vec::as_mut_slice).collect::<Vec<_>>());
        assert!(back == vectors);
    }
}
