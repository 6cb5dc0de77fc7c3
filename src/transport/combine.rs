//! The rows of the matrix, combined from the contributions of each pixel's paths and their transpose, block
//! by block.
//!
//! Let `F` be the matrix of contributions with a row for each start pixel. A coaxial rig has `A = F + Fᵀ`.
//! Where the projector stands apart, the rows of the camera's pixels are rows of `A`, and those of the
//! projector's pixels are columns of `A`. The entries of a row ascend, so that a cursor in each row yields
//! the transpose one block at a time, without a second copy of `F`.

use std::ops::Range;

use rayon::prelude::*;

use super::RigShape;
use super::chunk::{Chunk, Key};
use super::tiles::CompressedRows;

/// Approximate number of contributions in one block.
const BLOCK: usize = 1 << 21;

/// Number of rows that one task merges.
const ROWS_PER_TASK: usize = 64;

/// The sparse part of the matrix, with the sums from which its noise follows.
pub(super) struct Combined<const C: usize> {
    /// One layer for each class: one bounce, then the others.
    pub(super) layers: Vec<CompressedRows>,
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

/// One contribution to a row, with its error.
#[derive(Clone, Copy)]
struct Term<const C: usize> {
    key: Key,
    mean: [f32; C],
    error: [f32; C],
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
    let terms = count_terms(chunks, rig, &rows);
    let total: usize = terms.iter().sum();
    let nothing = CompressedRows { row_start: vec![0], columns: Vec::new(), weights: vec![Vec::new(); C] };
    let mut layers = vec![nothing; classes];
    // The last layer holds nearly all entries. It never has more than this, and the system does not commit
    // memory that is not written.
    if let Some(main) = layers.last_mut() {
        main.columns.reserve_exact(total);
        main.weights.iter_mut().for_each(|plane| plane.reserve_exact(total));
    }
    // The first entry of each row of a chunk that counts, mirrored, for one of the rows.
    let begin = |chunk: &Chunk<C>, span: Range<usize>| {
        span.start + chunk.keys[span].partition_point(|key| (key.other() as usize) < rows.start)
    };
    let mut cursors: Vec<Vec<usize>> =
        chunks.iter().map(|chunk| chunk.spans().map(|(_, span)| begin(chunk, span)).collect()).collect();
    let mut sums = Vec::with_capacity(rows.len());
    let mut first = 0;
    while first < rows.len() {
        let mut last = first + 1;
        let mut held = terms[first];
        while last < rows.len() && held + terms[last] <= BLOCK {
            held += terms[last];
            last += 1;
        }
        let of_block = rows.start + first..rows.start + last;
        let mut block = gather(chunks, rig, of_block.clone(), &terms[first..last], &mut cursors);
        let direct = direct.get(first..last).unwrap_or_default();
        merge(&mut block, of_block.start, &terms[first..last], direct, &mut layers, &mut sums);
        first = last;
    }
    Combined { layers, rows: sums }
}

/// The number of terms of each of these rows of the matrix.
fn count_terms<const C: usize>(chunks: &[Chunk<C>], rig: RigShape, rows: &Range<usize>) -> Vec<usize> {
    let mut terms = vec![0_usize; rows.len()];
    let mut count = |row: u32, more: usize| {
        if let Some(terms) = (row as usize).checked_sub(rows.start).and_then(|row| terms.get_mut(row)) {
            *terms += more;
        }
    };
    for chunk in chunks {
        for (row, span) in chunk.spans() {
            if rig.symmetric || row.from_camera {
                count(row.pixel, span.len());
            }
            if rig.symmetric || !row.from_camera {
                chunk.keys[span].iter().for_each(|key| count(key.other(), 1));
            }
        }
    }
    terms
}

/// The terms of the rows `block` of the matrix, row after row. The terms of a row are ordered by start pixel.
/// This is the same order for an entry and its mirror image, so that their sums agree to the last bit.
fn gather<const C: usize>(
    chunks: &[Chunk<C>],
    rig: RigShape,
    block: Range<usize>,
    terms: &[usize],
    cursors: &mut [Vec<usize>],
) -> Vec<Term<C>> {
    let mut next = Vec::with_capacity(terms.len());
    let mut count = 0;
    for terms in terms {
        next.push(count);
        count += terms;
    }
    let nothing = Term { key: Key::new(0, 0), mean: [0.0; C], error: [0.0; C] };
    let mut gathered = vec![nothing; count];
    let mut put = |row: usize, term: Term<C>| {
        let at = &mut next[row - block.start];
        gathered[*at] = term;
        *at += 1;
    };
    for (chunk, cursors) in chunks.iter().zip(cursors) {
        for ((row, span), cursor) in chunk.spans().zip(cursors) {
            let term = |at: usize, key: Key| Term { key, mean: chunk.means[at], error: chunk.errors[at] };
            if (rig.symmetric || row.from_camera) && block.contains(&(row.pixel as usize)) {
                span.clone().for_each(|at| put(row.pixel as usize, term(at, chunk.keys[at])));
            }
            if rig.symmetric || !row.from_camera {
                while *cursor < span.end && (chunk.keys[*cursor].other() as usize) < block.end {
                    let key = chunk.keys[*cursor];
                    let mirrored = Key::new(row.pixel, key.class() as u32);
                    put(key.other() as usize, term(*cursor, mirrored));
                    *cursor += 1;
                }
            }
        }
    }
    gathered
}

/// Merges the terms of a block: it sorts the terms of each row, sums those of equal column and class, and
/// appends the rows to the layers and to `sums`. `first` is the first row of the block; `counts` has the number
/// of terms of each row of the block, and `direct` its part of the diagonal.
fn merge<const C: usize>(
    terms: &mut [Term<C>],
    first: usize,
    counts: &[usize],
    direct: &[[[f64; 2]; C]],
    layers: &mut [CompressedRows],
    sums: &mut Vec<RowSums<C>>,
) {
    let block = first;
    let mut tasks = Vec::new();
    let mut rest = terms;
    for (task, counts) in counts.chunks(ROWS_PER_TASK).enumerate() {
        let (mine, tail) = rest.split_at_mut(counts.iter().sum());
        tasks.push((first + task * ROWS_PER_TASK, counts, mine));
        rest = tail;
    }
    let merged: Vec<Merged<C>> = tasks
        .into_par_iter()
        .map(|(first, counts, terms)| {
            let mut merged = Merged { layers: vec![Default::default(); layers.len()], sums: Vec::new() };
            let mut rest = terms;
            for (row, &count) in (first..).zip(counts) {
                let (mine, tail) = rest.split_at_mut(count);
                merged.row(row as u32, mine, direct.get(row - block));
                rest = tail;
            }
            merged
        })
        .collect();
    for task in merged {
        sums.extend(task.sums);
        for (layer, part) in layers.iter_mut().zip(task.layers) {
            let before = layer.columns.len();
            layer.row_start.extend(part.ends.iter().map(|end| before + end));
            layer.columns.extend(part.columns);
            for (channel, plane) in layer.weights.iter_mut().enumerate() {
                plane.extend(part.weights.iter().map(|weight| weight[channel]));
            }
        }
    }
}

/// The merged rows of one task.
struct Merged<const C: usize> {
    layers: Vec<LayerRows<C>>,
    sums: Vec<RowSums<C>>,
}

/// The rows of one layer: the end of each row, and its entries.
#[derive(Clone)]
struct LayerRows<const C: usize> {
    ends: Vec<usize>,
    columns: Vec<u32>,
    weights: Vec<[f32; C]>,
}

impl<const C: usize> Default for LayerRows<C> {
    fn default() -> Self {
        Self { ends: Vec::new(), columns: Vec::new(), weights: Vec::new() }
    }
}

impl<const C: usize> Merged<C> {
    /// Merges the terms of one row: terms of equal column and class are summed in `f64`.
    fn row(&mut self, row: u32, terms: &mut [Term<C>], direct: Option<&[[f64; 2]; C]>) {
        terms.sort_by_key(|term| term.key);
        let mut sums = RowSums {
            mean: [0.0; C],
            error: [0.0; C],
            mean_squares: 0.0,
            error_squares: 0.0,
            global: [0.0; 2],
        };
        let none = [[0.0; 2]; C];
        let mut direct = direct;
        for column in terms.chunk_by(|a, b| a.key.other() == b.key.other()) {
            let at = column[0].key.other();
            let diagonal = if at == row { direct.take().unwrap_or(&none) } else { &none };
            let mut whole = *diagonal;
            let mut global = none;
            for run in column.chunk_by(|a, b| a.key == b.key) {
                let mut sum = none;
                for term in run {
                    for (channel, sum) in sum.iter_mut().enumerate() {
                        sum[0] += f64::from(term.mean[channel]);
                        sum[1] += f64::from(term.error[channel]);
                    }
                }
                let class = run[0].key.class();
                add(&mut whole, &sum);
                if class > 0 {
                    add(&mut global, &sum);
                }
                let layer = &mut self.layers[class];
                layer.columns.push(at);
                layer.weights.push(sum.map(|[mean, _]| mean as f32));
            }
            sums.add(&whole, &global);
        }
        // The diagonal entry of this row has direct light only.
        if let Some(direct) = direct {
            sums.add(direct, &none);
        }
        self.sums.push(sums);
        for layer in &mut self.layers {
            layer.ends.push(layer.columns.len());
        }
    }
}

/// `to += more`.
fn add<const C: usize>(to: &mut [[f64; 2]; C], more: &[[f64; 2]; C]) {
    for (to, more) in to.iter_mut().flatten().zip(more.iter().flatten()) {
        *to += more;
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
