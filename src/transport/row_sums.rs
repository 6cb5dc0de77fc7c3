//! Sums over the rows of the matrix, from which its noise follows, and how much is merged of each row.

use std::ops::Range;

use rayon::prelude::*;

use super::RigShape;
use super::chunk::{CLASSES, Chunk, Row, Term, at};
use super::fixed::{FixedSums, RowSums, Scale};

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
    scale: Scale,
) -> Outline<C> {
    let mut sums = vec![[[0; C]; 2]; rows.len()];
    let mut terms = vec![0; rows.len()];
    let mut of_class = [0; CLASSES];
    let of_chunk = |chunk: &Chunk<C>| own(chunk, rig, rows, (triangle, scale));
    for (row, of_row, count) in chunks.par_iter().flat_map_iter(of_chunk).collect::<Vec<_>>() {
        sums[row] = of_row;
        terms[row] = count.iter().sum::<usize>() as u32;
        of_class.iter_mut().zip(count).for_each(|(all, count)| *all += count);
    }
    let stripe = rows.len().div_ceil(rayon::current_num_threads()).max(1);
    let tasks: Vec<(usize, &mut [FixedSums<C>], &mut [u32])> = sums
        .chunks_mut(stripe)
        .zip(terms.chunks_mut(stripe))
        .enumerate()
        .map(|(number, (sums, terms))| (rows.start + number * stripe, sums, terms))
        .collect();
    let mirrored: Vec<[usize; CLASSES]> = tasks
        .into_par_iter()
        .map(|(first, sums, terms)| add_mirrored(chunks, rig, first, (triangle, scale), sums, terms))
        .collect();
    for count in mirrored {
        of_class.iter_mut().zip(count).for_each(|(all, count)| *all += count);
    }
    Outline { sums: sums.iter().map(|sums| scale.sums(sums)).collect(), terms, of_class }
}

/// The sums over the paths from each pixel that has one of the `rows`, counted from the first of them, and the number of
/// contributions of each class to what is merged.
fn own<const C: usize>(
    chunk: &Chunk<C>,
    rig: RigShape,
    rows: &Range<usize>,
    (triangle, scale): (bool, Scale),
) -> Vec<(usize, FixedSums<C>, [usize; CLASSES])> {
    let counts = |row: &Row| (rig.symmetric || row.from_camera) && rows.contains(&(row.pixel as usize));
    let of_row = |(row, terms): (Row, &[Term<C>])| {
        let (mut sums, mut count) = ([[0; C]; 2], [0; CLASSES]);
        for term in terms {
            scale.add(&mut sums, term);
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
    (triangle, scale): (bool, Scale),
    sums: &mut [FixedSums<C>],
    terms: &mut [u32],
) -> [usize; CLASSES] {
    let mut count = [0; CLASSES];
    let rows = chunks.iter().flat_map(Chunk::rows).filter(|(row, _)| rig.symmetric || !row.from_camera);
    for (row, of_row) in rows {
        for term in at(of_row, &(first..first + sums.len())) {
            let to = term.key.other() as usize - first;
            scale.add(&mut sums[to], term);
            let is_merged = !triangle || term.key.other() <= row.pixel;
            terms[to] += u32::from(is_merged);
            count[term.key.class()] += usize::from(is_merged);
        }
    }
    count
}
