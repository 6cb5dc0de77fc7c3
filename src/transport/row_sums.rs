//! Sums over the rows of the matrix, from which its noise follows.

use std::ops::Range;

use rayon::prelude::*;

use super::RigShape;
use super::chunk::{CLASSES, Chunk, Row, Term, at};

/// Sums over one row of the whole matrix, including the diagonal: values, errors, and their squares.
///
/// Values and errors are those of all paths from the pixel of the row, followed by those of the paths that end there. In a symmetric
/// matrix, squares are those on and above the diagonal, where what is above it counts twice.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowSums<const C: usize> {
    pub(super) mean: [f64; C],
    pub(super) error: [f64; C],
    pub(super) mean_squares: f64,
    pub(super) error_squares: f64,
    /// Squares of values and errors for light of two or more bounces.
    pub(super) global: [f64; 2],
}

impl<const C: usize> Default for RowSums<C> {
    fn default() -> Self {
        Self { mean: [0.0; C], error: [0.0; C], mean_squares: 0.0, error_squares: 0.0, global: [0.0; 2] }
    }
}

impl<const C: usize> RowSums<C> {
    /// Adds a contribution to the sums of values and errors.
    fn add(&mut self, term: &Term<C>) {
        for channel in 0..C {
            self.mean[channel] += f64::from(term.mean[channel]);
            self.error[channel] += f64::from(term.error[channel]);
        }
    }

    /// Adds the diagonal's direct light to the sums of values and errors.
    pub(super) fn add_direct(&mut self, direct: &[[f64; 2]; C]) {
        for (channel, [mean, error]) in direct.iter().enumerate() {
            self.mean[channel] += mean;
            self.error[channel] += error;
        }
    }

    /// Adds the squares of one entry, as often as `times`: all its light, and its light of two or more bounces.
    pub(super) fn add_squares(&mut self, times: f64, whole: &[[f64; 2]; C], global: &[[f64; 2]; C]) {
        for channel in 0..C {
            let [mean, error] = whole[channel];
            self.mean_squares += times * mean * mean;
            self.error_squares += times * error * error;
            self.global[0] += times * global[channel][0].powi(2);
            self.global[1] += times * global[channel][1].powi(2);
        }
    }
}

/// What is known of the rows before they are merged.
pub(super) struct Outline<const C: usize> {
    /// Values and errors, without the diagonal's direct light.
    pub(super) sums: Vec<RowSums<C>>,
    /// The number of contributions to what is merged of each row.
    pub(super) terms: Vec<u32>,
    /// The number of those contributions in each class of bounces.
    pub(super) of_class: [usize; CLASSES],
}

/// The outline of these `rows`. The chunks have all contributions to them. With `triangle`, only what is on and above the diagonal is
/// merged.
pub(super) fn outline<const C: usize>(
    chunks: &[Chunk<C>],
    rig: RigShape,
    rows: &Range<usize>,
    triangle: bool,
) -> Outline<C> {
    let mut sums = vec![RowSums::default(); rows.len()];
    let mut terms = vec![0; rows.len()];
    let mut of_class = [0; CLASSES];
    let of_chunk = |chunk: &Chunk<C>| own(chunk, rig, rows, triangle);
    for (row, of_row, count) in chunks.par_iter().flat_map_iter(of_chunk).collect::<Vec<_>>() {
        sums[row] = of_row;
        terms[row] = count.iter().sum::<usize>() as u32;
        of_class.iter_mut().zip(count).for_each(|(all, count)| *all += count);
    }
    let stripe = rows.len().div_ceil(rayon::current_num_threads()).max(1);
    let tasks: Vec<(usize, &mut [RowSums<C>], &mut [u32])> = sums
        .chunks_mut(stripe)
        .zip(terms.chunks_mut(stripe))
        .enumerate()
        .map(|(number, (sums, terms))| (rows.start + number * stripe, sums, terms))
        .collect();
    let mirrored: Vec<[usize; CLASSES]> = tasks
        .into_par_iter()
        .map(|(first, sums, terms)| add_mirrored(chunks, rig, first, triangle, sums, terms))
        .collect();
    for count in mirrored {
        of_class.iter_mut().zip(count).for_each(|(all, count)| *all += count);
    }
    Outline { sums, terms, of_class }
}

/// The sums over the paths from each pixel that has one of the `rows`, counted from the first of them, and the number of
/// contributions of each class to what is merged.
fn own<const C: usize>(
    chunk: &Chunk<C>,
    rig: RigShape,
    rows: &Range<usize>,
    triangle: bool,
) -> Vec<(usize, RowSums<C>, [usize; CLASSES])> {
    let counts = |row: &Row| (rig.symmetric || row.from_camera) && rows.contains(&(row.pixel as usize));
    let of_row = |(row, terms): (Row, &[Term<C>])| {
        let (mut sums, mut count) = (RowSums::default(), [0; CLASSES]);
        for term in terms {
            sums.add(term);
            count[term.key.class()] += usize::from(!triangle || term.key.other() >= row.pixel);
        }
        (row.pixel as usize - rows.start, sums, count)
    };
    chunk.rows().filter(|(row, _)| counts(row)).map(of_row).collect()
}

/// Adds the sums over the paths that end at the pixels from `first` on, and the numbers of contributions to what is merged. Returns
/// these numbers for each class.
fn add_mirrored<const C: usize>(
    chunks: &[Chunk<C>],
    rig: RigShape,
    first: usize,
    triangle: bool,
    sums: &mut [RowSums<C>],
    terms: &mut [u32],
) -> [usize; CLASSES] {
    let mut count = [0; CLASSES];
    let mut mirrored = vec![RowSums::<C>::default(); sums.len()];
    let rows = chunks.iter().flat_map(Chunk::rows).filter(|(row, _)| rig.symmetric || !row.from_camera);
    for (row, of_row) in rows {
        for term in at(of_row, &(first..first + sums.len())) {
            let to = term.key.other() as usize - first;
            mirrored[to].add(term);
            let is_merged = !triangle || term.key.other() <= row.pixel;
            terms[to] += u32::from(is_merged);
            count[term.key.class()] += usize::from(is_merged);
        }
    }
    for (sums, mirrored) in sums.iter_mut().zip(&mirrored) {
        for channel in 0..C {
            sums.mean[channel] += mirrored.mean[channel];
            sums.error[channel] += mirrored.error[channel];
        }
    }
    count
}
