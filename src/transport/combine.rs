//! The rows of the matrix, combined from the contributions of each pixel's paths and their transpose, block
//! by block.
//!
//! Let `F` be the matrix of contributions with a row for each start pixel. A coaxial rig has `A = F + Fᵀ`.
//! Where the projector stands apart, the rows of the camera's pixels are rows of `A`, and those of the
//! projector's pixels are columns of `A`. The transpose comes one block at a time (`transpose`), without a second
//! copy of `F`. A row of `A` is then two rows merged, one of `F` and one of its transpose, which both ascend.

use std::ops::Range;

use rayon::prelude::*;

use super::RigShape;
use super::chunk::{Chunk, Key, Term};
use super::tiles::{CompressedRows, take};
use super::transpose::{Sources, Transposed};

/// Approximate number of contributions in one block, unless there were too many blocks.
const BLOCK: usize = 1 << 21;

/// The most blocks: each looks at all contributions once.
const MOST_BLOCKS: usize = 6;

/// Number of rows that one task merges.
const ROWS_PER_TASK: usize = 64;

/// The sparse part of the matrix, with the sums from which its noise follows.
pub(super) struct Combined<const C: usize> {
    /// One layer for each class: one bounce, then the others. A layer comes as pieces, a block of rows each.
    pub(super) layers: Vec<Vec<CompressedRows>>,
    /// Sums for each of the rows.
    pub(super) rows: Vec<RowSums<C>>,
}

/// Sums over one row of the whole matrix, including the diagonal: values, errors, and their squares.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowSums<const C: usize> {
    pub(super) mean: [f64; C],
    pub(super) error: [f64; C],
    pub(super) mean_squares: f64,
    pub(super) error_squares: f64,
    /// Squares of values and errors for light of two or more bounces.
    pub(super) global: [f64; 2],
}

/// Merges the chunks into these `rows` of `classes` layers. `direct` is the diagonal, with mean and error for each of the rows and
/// channel, or empty. The chunks have all contributions to these rows, those of the camera's paths first, by ascending start pixel.
pub(super) fn combine<const C: usize>(
    chunks: &[Chunk<C>],
    rig: RigShape,
    rows: Range<usize>,
    classes: usize,
    direct: &[[[f64; 2]; C]],
) -> Combined<C> {
    let mut sources = Sources::new(chunks, rig, &rows);
    let terms = sources.terms();
    let total: usize = terms.iter().map(|&terms| terms as usize).sum();
    let most = BLOCK.max(total / MOST_BLOCKS);
    let mut combined = Combined { layers: vec![Vec::new(); classes], rows: Vec::with_capacity(rows.len()) };
    let mut last = 0;
    // One block at least, so that layers of no rows have their channels as well.
    while last < rows.len() || combined.layers.iter().any(Vec::is_empty) {
        let (first, mut held) = (last, 0);
        while last < rows.len() && (last == first || held + terms[last] as usize <= most) {
            held += terms[last] as usize;
            last += 1;
        }
        let block = Block { rows: first..last, pixel: rows.start, terms: &terms, direct };
        let transposed = sources.transposed(first..last);
        block.merge(&sources, &transposed, &mut combined);
    }
    combined
}

/// Rows that are merged at the same time.
struct Block<'a, const C: usize> {
    /// Counted from the first row that is made, whose pixel is `pixel`.
    rows: Range<usize>,
    pixel: usize,
    /// The number of terms of each row that is made, and the diagonal of [`combine`].
    terms: &'a [u32],
    direct: &'a [[[f64; 2]; C]],
}

impl<const C: usize> Block<'_, C> {
    /// Merges the rows of the matrix with those of the transpose, and appends them to the layers and to the sums.
    fn merge(&self, sources: &Sources<'_, C>, transposed: &[Transposed<C>], to: &mut Combined<C>) {
        let tasks: Vec<usize> = self.rows.clone().step_by(ROWS_PER_TASK).collect();
        let merged: Vec<Merged<C>> = tasks
            .into_par_iter()
            .map(|first| {
                let rows = first..self.rows.end.min(first + ROWS_PER_TASK);
                let mut merged = Merged::new(to.layers.len());
                // Nearly all entries are the last layer's.
                if let Some(main) = merged.layers.last_mut() {
                    let most = self.terms[rows.clone()].iter().sum::<u32>() as usize;
                    main.columns.reserve(most);
                    main.weights.iter_mut().for_each(|plane| plane.reserve(most));
                }
                let mut mirrored = Vec::new();
                for row in rows {
                    mirrored.clear();
                    transposed
                        .iter()
                        .for_each(|part| mirrored.extend_from_slice(part.row(row - self.rows.start)));
                    let pixel = (self.pixel + row) as u32;
                    merged.row(pixel, sources.own(row), &mirrored, self.direct.get(row));
                }
                merged
            })
            .collect();
        let mut parts: Vec<Vec<CompressedRows>> = to.layers.iter().map(|_| Vec::new()).collect();
        for task in merged {
            to.rows.extend(task.sums);
            parts.iter_mut().zip(task.layers).for_each(|(parts, part)| parts.push(part));
        }
        to.layers.iter_mut().zip(parts).for_each(|(pieces, parts)| pieces.push(joined::<C>(parts)));
    }
}

/// The rows of several tasks as one piece. Its arrays are long, so that the system gets their memory back with them.
fn joined<const C: usize>(parts: Vec<CompressedRows>) -> CompressedRows {
    let count = parts.iter().map(|part| part.columns.len()).sum();
    let mut joined =
        CompressedRows { row_start: vec![0], columns: vec![0; count], weights: vec![vec![0.0; count]; C] };
    let mut columns = joined.columns.as_mut_slice();
    let mut planes: Vec<&mut [f32]> = joined.weights.iter_mut().map(Vec::as_mut_slice).collect();
    let (mut to, mut before) = (Vec::new(), 0);
    for part in &parts {
        joined.row_start.extend(part.row_start.iter().skip(1).map(|end| before + end));
        let count = part.columns.len();
        before += count;
        let planes: Vec<&mut [f32]> = planes.iter_mut().map(|plane| take(plane, count)).collect();
        to.push((take(&mut columns, count), planes));
    }
    parts.into_par_iter().zip(to).for_each(|(part, (columns, planes))| {
        columns.copy_from_slice(&part.columns);
        planes.into_iter().zip(&part.weights).for_each(|(to, from)| to.copy_from_slice(from));
    });
    joined
}

/// The merged rows of one task.
struct Merged<const C: usize> {
    layers: Vec<CompressedRows>,
    sums: Vec<RowSums<C>>,
}

impl<const C: usize> Merged<C> {
    /// No rows yet, of so many layers.
    fn new(layers: usize) -> Self {
        let nothing =
            CompressedRows { row_start: vec![0], columns: Vec::new(), weights: vec![Vec::new(); C] };
        Self { layers: vec![nothing; layers], sums: Vec::new() }
    }

    /// Merges one row: terms of equal column and class are summed in `f64`.
    fn row(&mut self, row: u32, own: &[Term<C>], mirrored: &[Term<C>], mut direct: Option<&[[f64; 2]; C]>) {
        let mut sums = RowSums::default();
        let none = [[0.0; 2]; C];
        let mut column = u32::MAX;
        let (mut whole, mut global) = (none, none);
        each_key(own, mirrored, |key, sum| {
            if key.other() != column {
                sums.add(&whole, &global);
                column = key.other();
                whole = if column == row { *direct.take().unwrap_or(&none) } else { none };
                global = none;
            }
            let class = key.class();
            add(&mut whole, &sum);
            if class > 0 {
                add(&mut global, &sum);
            }
            let layer = &mut self.layers[class];
            layer.columns.push(column);
            layer.weights.iter_mut().zip(sum).for_each(|(plane, [mean, _])| plane.push(mean as f32));
        });
        sums.add(&whole, &global);
        // The diagonal entry of this row has direct light only.
        if let Some(direct) = direct {
            sums.add(direct, &none);
        }
        self.sums.push(sums);
        for layer in &mut self.layers {
            layer.row_start.push(layer.columns.len());
        }
    }
}

/// Calls `visit` with each key of a row and of its mirror image, ascending, and the sums of its one or two entries. An
/// entry of the matrix and its own mirror image are the sum of the same two numbers, so that they agree to the last bit.
fn each_key<const C: usize>(
    own: &[Term<C>],
    mirrored: &[Term<C>],
    mut visit: impl FnMut(Key, [[f64; 2]; C]),
) {
    let nothing = Term::none(Key::END);
    let (mut first, mut second) = (0, 0);
    loop {
        let next = [own.get(first).unwrap_or(&nothing), mirrored.get(second).unwrap_or(&nothing)];
        let key = next[0].key.min(next[1].key);
        if key == Key::END {
            return;
        }
        // Which of the two comes next is a matter of chance: a branch would often be predicted wrongly.
        let has = next.map(|term| term.key == key);
        let [a, b] = [0, 1].map(|which| if has[which] { next[which] } else { &nothing });
        visit(
            key,
            std::array::from_fn(|channel| {
                let sum = |a: f32, b: f32| f64::from(a) + f64::from(b);
                [sum(a.mean[channel], b.mean[channel]), sum(a.error[channel], b.error[channel])]
            }),
        );
        first += usize::from(has[0]);
        second += usize::from(has[1]);
    }
}

/// `to += more`.
fn add<const C: usize>(to: &mut [[f64; 2]; C], more: &[[f64; 2]; C]) {
    for (to, more) in to.iter_mut().flatten().zip(more.iter().flatten()) {
        *to += more;
    }
}

impl<const C: usize> Default for RowSums<C> {
    fn default() -> Self {
        Self { mean: [0.0; C], error: [0.0; C], mean_squares: 0.0, error_squares: 0.0, global: [0.0; 2] }
    }
}

impl<const C: usize> RowSums<C> {
    /// Adds one entry of the row: all its light, and its light of two or more bounces.
    fn add(&mut self, whole: &[[f64; 2]; C], global: &[[f64; 2]; C]) {
        for channel in 0..C {
            let [mean, error] = whole[channel];
            self.mean[channel] += mean;
            self.error[channel] += error;
            self.mean_squares += mean * mean;
            self.error_squares += error * error;
            self.global[0] += global[channel][0].powi(2);
            self.global[1] += global[channel][1].powi(2);
        }
    }
}
