//! From rows to tiles, and back.

use std::cmp::Reverse;

use rayon::prelude::*;

use super::slice::{LANES, Slice};
use super::{CompressedRows, Pages, Shape, Start, Tiles};

/// Rows of a window. Within it, rows are sorted by length, so that a slice has rows of about equally many
/// entries.
const WINDOW: usize = 512;

impl Tiles {
    pub(in crate::transport) fn new(cols: usize, from: &CompressedRows) -> Self {
        let (rows, entries) = (from.row_start.len() - 1, from.columns.len());
        Self::of_shape(Shape::new(rows, cols, entries, rayon::current_num_threads()), cols, from)
    }

    pub(super) fn of_shape(shape: Shape, cols: usize, from: &CompressedRows) -> Self {
        let rows = from.row_start.len() - 1;
        let bands: Vec<usize> = (0..rows).step_by(shape.rows).collect();
        let band = |&first: &usize| Band { shape, cols, from, first, end: (first + shape.rows).min(rows) };
        // A first pass counts, so that memory is allocated once; a second pass fills it.
        let sizes: Vec<Vec<Start>> = bands.par_iter().map(|first| band(first).sizes()).collect();
        let mut tiles = vec![Start::default()];
        let mut end = Start::default();
        for size in sizes.iter().flatten() {
            end = Start { slice: end.slice + size.slice, step: end.step + size.step };
            tiles.push(end);
        }
        let mut slices = vec![Slice::default(); end.slice];
        let mut columns = Pages::zeros(end.step);
        let mut weights: Vec<Pages<[f32; LANES]>> =
            from.weights.iter().map(|_| Pages::zeros(end.step)).collect();
        let mut to = Vec::new();
        let (mut slices_left, mut columns_left) = (slices.as_mut_slice(), &mut columns[..]);
        let mut weights_left: Vec<&mut [[f32; LANES]]> =
            weights.iter_mut().map(|plane| &mut plane[..]).collect();
        for size in &sizes {
            let steps = size.iter().map(|size| size.step).sum();
            to.push(Filled {
                slices: take(&mut slices_left, size.iter().map(|size| size.slice).sum()),
                columns: take(&mut columns_left, steps),
                weights: weights_left.iter_mut().map(|plane| take(plane, steps)).collect(),
            });
        }
        bands.par_iter().zip(to).for_each(|(first, to)| band(first).fill(to));
        Self { rows, cols, entries: from.columns.len(), shape, tiles, slices, columns, weights }
    }

    pub(in crate::transport) fn to_rows(&self) -> CompressedRows {
        let mut row_start = vec![0; self.rows + 1];
        self.each(|row, _, _, _| row_start[row + 1] += 1);
        for row in 0..self.rows {
            row_start[row + 1] += row_start[row];
        }
        let mut next = row_start.clone();
        let mut columns = vec![0; self.entries];
        let mut weights = vec![vec![0.0; self.entries]; self.weights.len()];
        // The tiles of a row come from left to right, and so do the entries within each.
        self.each(|row, column, step, lane| {
            let at = next[row];
            next[row] += 1;
            columns[at] = column as u32;
            for (to, from) in weights.iter_mut().zip(&self.weights) {
                to[at] = from[step][lane];
            }
        });
        CompressedRows { row_start, columns, weights }
    }

    /// Calls `visit` with row, column, step and lane of each entry, tile by tile.
    fn each(&self, mut visit: impl FnMut(usize, usize, usize, usize)) {
        let across = self.cols.div_ceil(self.shape.columns);
        for (tile, ends) in self.tiles.windows(2).enumerate() {
            let first_row = tile / across * self.shape.rows;
            let end_row = (first_row + self.shape.rows).min(self.rows);
            let first_column = tile % across * self.shape.columns;
            let mut step = ends[0].step;
            for slice in &self.slices[ends[0].slice..ends[1].slice] {
                let steps = step..step + slice.steps as usize;
                step = steps.end;
                for (lane, row) in slice.rows.iter().map(|&row| first_row + usize::from(row)).enumerate() {
                    let mut before = None;
                    for step in steps.clone() {
                        let column = self.columns[step][lane];
                        // The remaining steps of this lane are padding.
                        if row == end_row || before >= Some(column) {
                            break;
                        }
                        visit(row, first_column + usize::from(column), step, lane);
                        before = Some(column);
                    }
                }
            }
        }
    }
}

/// The rows of one row of tiles.
struct Band<'a> {
    shape: Shape,
    cols: usize,
    from: &'a CompressedRows,
    first: usize,
    end: usize,
}

/// The arrays that its entries are written to.
struct Filled<'a> {
    slices: &'a mut [Slice],
    columns: &'a mut [[u16; LANES]],
    weights: Vec<&'a mut [[f32; LANES]]>,
}

/// A row's entries within a tile.
#[derive(Clone, Copy)]
struct Segment {
    /// Row within the band.
    row: usize,
    first: usize,
    length: usize,
}

impl Band<'_> {
    /// The number of slices and steps of each tile.
    fn sizes(&self) -> Vec<Start> {
        let mut sizes = Vec::new();
        self.each_tile(|_, segments| {
            let slices = || segments.chunk_by(in_one_window).flat_map(|window| window.chunks(LANES));
            sizes.push(Start { slice: slices().count(), step: slices().map(|slice| slice[0].length).sum() });
        });
        sizes
    }

    fn fill(&self, mut to: Filled<'_>) {
        // Lanes without a row.
        let nowhere = (self.end - self.first) as u16;
        self.each_tile(|first_column, segments| {
            for segments in segments.chunk_by(in_one_window).flat_map(|window| window.chunks(LANES)) {
                let longest = segments[0].length;
                let columns = take(&mut to.columns, longest);
                let rows = std::array::from_fn(|lane| segments.get(lane).map_or(nowhere, |s| s.row as u16));
                take(&mut to.slices, 1)[0] = Slice { rows, steps: longest as u32 };
                for (lane, segment) in segments.iter().enumerate() {
                    let entries = segment.first..segment.first + segment.length;
                    // Columns within a tile fit 16 bits.
                    let place = |column: &u32| (*column as usize - first_column) as u16;
                    let mut last = 0;
                    for (columns, place) in
                        columns.iter_mut().zip(self.from.columns[entries].iter().map(place))
                    {
                        columns[lane] = place;
                        last = place;
                    }
                    columns[segment.length..].iter_mut().for_each(|columns| columns[lane] = last);
                }
                for (to, from) in to.weights.iter_mut().zip(&self.from.weights) {
                    let to = take(to, longest);
                    for (lane, segment) in segments.iter().enumerate() {
                        let entries = segment.first..segment.first + segment.length;
                        to.iter_mut().zip(&from[entries]).for_each(|(to, &weight)| to[lane] = weight);
                    }
                }
            }
        });
    }

    /// Calls `visit` with each tile's first column and its non-empty rows, window by window, the longest row
    /// of a window first.
    fn each_tile(&self, mut visit: impl FnMut(usize, &[Segment])) {
        let mut next = self.from.row_start[self.first..self.end].to_vec();
        let ends = &self.from.row_start[self.first + 1..=self.end];
        let mut segments = Vec::new();
        for first_column in (0..self.cols).step_by(self.shape.columns) {
            let end_column = first_column + self.shape.columns;
            segments.clear();
            for (row, (next, &end)) in next.iter_mut().zip(ends).enumerate() {
                let first = *next;
                let in_tile = |column: &&u32| (**column as usize) < end_column;
                *next += self.from.columns[first..end].iter().take_while(in_tile).count();
                if *next > first {
                    segments.push(Segment { row, first, length: *next - first });
                }
            }
            for window in segments.chunk_by_mut(in_one_window) {
                // The sort is stable: rows of equal length keep their order.
                window.sort_by_key(|segment| Reverse(segment.length));
            }
            visit(first_column, &segments);
        }
    }
}

/// Whether two rows are in the same window. Its sums are close enough in memory to share cache lines.
fn in_one_window(a: &Segment, b: &Segment) -> bool {
    a.row / WINDOW == b.row / WINDOW
}

/// Splits off the first `count` elements of `rest`.
fn take<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    let (mine, others) = std::mem::take(rest).split_at_mut(count);
    *rest = others;
    mine
}
