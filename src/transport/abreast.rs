//! Products with several vectors at once, side by side four at a time.

use rayon::prelude::*;

use super::matrix::{Direction, Part, TransportMatrix};
use super::tiles::{ABREAST, Abreast};

/// Pixels that a thread rearranges at a time.
const TASK: usize = 4096;

/// The vectors side by side, with zeros where there are fewer: one entry for each of theirs, which are equally many.
pub(super) fn side_by_side(vectors: &[&[f64]]) -> Vec<Abreast> {
    let mut values = vec![Abreast::default(); vectors.first().map_or(0, |vector| vector.len())];
    values.par_chunks_mut(TASK).enumerate().for_each(|(task, values)| {
        for (place, vector) in vectors.iter().enumerate() {
            let vector = &vector[task * TASK..];
            values.iter_mut().zip(vector).for_each(|(value, &entry)| value.0[place] = entry);
        }
    });
    values
}

/// And back to one after the other.
pub(super) fn apart(values: &[Abreast], to: &mut [&mut [f64]]) {
    to.par_iter_mut().enumerate().for_each(|(place, vector)| {
        vector.iter_mut().zip(values).for_each(|(entry, value)| *entry = value.0[place]);
    });
}

impl TransportMatrix {
    /// `y_k ← P x_k` for each of `xs`, to the bits of [`TransportMatrix::apply`]: the entries are read once for four of them. There
    /// are as many `ys`, of an entry for each camera pixel.
    pub fn apply_block(&self, part: Part, channel: usize, xs: &[&[f64]], ys: &mut [&mut [f64]]) {
        self.multiply_block(Direction::Forward, part, channel, xs, ys);
    }

    /// The same in either direction.
    pub(super) fn multiply_block(
        &self,
        direction: Direction,
        part: Part,
        channel: usize,
        from: &[&[f64]],
        to: &mut [&mut [f64]],
    ) {
        assert_eq!(from.len(), to.len(), "a product for each vector");
        for (from, to) in from.chunks(ABREAST).zip(to.chunks_mut(ABREAST)) {
            if let ([from], [to]) = (from, &mut *to) {
                self.multiply(direction, part, channel, from, to);
                continue;
            }
            let mut values = vec![Abreast::default(); to[0].len()];
            self.multiply(direction, part, channel, &side_by_side(from), &mut values);
            apart(&values, to);
        }
    }
}
