//! From rows to tiles, and back.

use std::cmp::Reverse;

use rayon::prelude::*;

use super::slice::{LANES, Slice};
use super::{CompressedRows, Pages, Pieces, Shape, Start, Tiles};

/// Rows of a window. Within it, rows are sorted by length, so that a slice has rows of about equally many
/// entries.
const WINDOW: usize = 512;

/// Bands for each thread that are filled before the rows' memory is given back.
const BANDS_AT_A_TIME: usize = 2;

impl Tiles {
    /// The matrix of `cols` columns whose rows are those of `pieces`, one after the other. The memory of the pieces is
    /// given back as soon as their rows are in tiles.
    pub(in crate::transport) fn new(cols: usize, pieces: Vec<CompressedRows>) -> Self {
        let from = Pieces::new(pieces);
        let shape = Shape::new(from.rows(), cols, from.entries(), rayon::current_num_threads());
        Self::of_shape(shape, cols, from)
    }

    pub(super) fn of_shape(shape: Shape, cols: usize, mut from: Pieces) -> Self {
        let (rows, entries) = (from.rows(), from.entries());
        let bands: Vec<usize> = (0..rows).step_by(shape.rows).collect();
        // A first pass counts, so that memory is allocated once; a second pass fills it.
        let sizes: Vec<Vec<Start>> =
            bands.par_iter().map(|&first| Band::new(shape, cols, &from, first).sizes()).collect();
        let mut tiles = vec![Start::default()];
        let mut end = Start::default();
        for size in sizes.iter().flatten() {
            end = Start { slice: end.slice + size.slice, step: end.step + size.step };
            tiles.push(end);
        }
        let mut slices = vec![Slice::default(); end.slice];
        let mut columns = Pages::zeros(end.step);
        let mut weights: Vec<Pages<[f32; LANES]>> =
            (0..from.channels()).map(|_| Pages::zeros(end.step)).collect();
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
        let mut to = to.into_iter();
        for bands in bands.chunks(BANDS_AT_A_TIME * rayon::current_num_threads()) {
            let to: Vec<Filled<'_>> = to.by_ref().take(bands.len()).collect();
            bands.par_iter().zip(to).for_each(|(&first, to)| Band::new(shape, cols, &from, first).fill(to));
            from.release_before(bands.last().map_or(0, |first| first + shape.rows));
        }
        Self { rows, cols, entries, shape, tiles, slices, columns, weights }
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
        let planes: Vec<&[[f32; LANES]]> = self.weights.iter().map(|plane| &plane[..]).collect();
        // The tiles of a row come from left to right, and so do the entries within each.
        self.each(|row, column, step, lane| {
            let at = next[row];
            next[row] += 1;
            columns[at] = column as u32;
            for (to, from) in weights.iter_mut().zip(&planes) {
                to[at] = from[step][lane];
            }
        });
        CompressedRows { row_start, columns, weights }
    }

    /// Calls `visit` with row, column, step and lane of each entry, tile by tile.
    fn each(&self, mut visit: impl FnMut(usize, usize, usize, usize)) {
        let across = self.cols.div_ceil(self.shape.columns);
        let columns = &self.columns[..];
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
                        let column = columns[step][lane];
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
    from: &'a Pieces,
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
    /// Index of the first entry in the row's piece.
    first: usize,
    length: usize,
}

impl<'a> Band<'a> {
    /// The band from the row `first` on.
    fn new(shape: Shape, cols: usize, from: &'a Pieces, first: usize) -> Self {
        Self { shape, cols, from, first, end: from.rows().min(first + shape.rows) }
    }

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
                    let (piece, _) = self.from.row(self.first + segment.row);
                    for (columns, place) in columns.iter_mut().zip(piece.columns[entries].iter().map(place)) {
                        columns[lane] = place;
                        last = place;
                    }
                    columns[segment.length..].iter_mut().for_each(|columns| columns[lane] = last);
                }
                for (channel, to) in to.weights.iter_mut().enumerate() {
                    let to = take(to, longest);
                    for (lane, segment) in segments.iter().enumerate() {
                        let entries = segment.first..segment.first + segment.length;
                        let from = &self.from.row(self.first + segment.row).0.weights[channel][entries];
                        to.iter_mut().zip(from).for_each(|(to, &weight)| to[lane] = weight);
                    }
                }
            }
        });
    }

    /// Calls `visit` with each tile's first column and its non-empty rows, window by window, the longest row
    /// of a window first.
    fn each_tile(&self, mut visit: impl FnMut(usize, &[Segment])) {
        let mut rows: Vec<_> = (self.first..self.end).map(|row| self.from.row(row)).collect();
        let mut segments = Vec::new();
        for first_column in (0..self.cols).step_by(self.shape.columns) {
            let end_column = first_column + self.shape.columns;
            segments.clear();
            for (row, (piece, left)) in rows.iter_mut().enumerate() {
                let first = left.start;
                let in_tile = |column: &&u32| (**column as usize) < end_column;
                left.start += piece.columns[left.clone()].iter().take_while(in_tile).count();
                if left.start > first {
                    segments.push(Segment { row, first, length: left.start - first });
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
pub(in crate::transport) fn take<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    let (mine, others) = std::mem::take(rest).split_at_mut(count);
    *rest = others;
    mine
}
