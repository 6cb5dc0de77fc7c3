//! The rows of a window, cut at the columns of the tiles.

use std::cmp::Reverse;

use super::rows::CompressedRows;
use super::shape::Shape;
use super::slice::{LANES, Slice};
use super::take;

/// Rows of a window. Within it, rows are sorted by length, so that a slice has rows of about equally many entries. Its
/// sums are close enough in memory to share cache lines.
pub(super) const WINDOW: usize = 512;

/// Where a tile begins.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Start {
    pub(super) slice: usize,
    pub(super) step: usize,
}

/// Consecutive rows of a band.
pub(super) struct Window {
    /// The first row, counted from the band's.
    first: usize,
    rows: CompressedRows,
    /// The number of slices and steps in each tile.
    pub(super) sizes: Vec<Start>,
}

/// The arrays of one tile that a window's entries are written to.
pub(super) struct Filled<'a> {
    pub(super) slices: &'a mut [Slice],
    pub(super) columns: &'a mut [[u16; LANES]],
    pub(super) weights: Vec<&'a mut [[f32; LANES]]>,
}

/// A row's entries within a tile.
#[derive(Clone, Copy)]
struct Segment {
    /// Row within the window.
    row: usize,
    /// Index of the first entry.
    first: usize,
    length: usize,
}

impl Window {
    /// The window of these rows, the first of which is the band's row number `first`.
    pub(super) fn new(first: usize, rows: CompressedRows, shape: Shape, cols: usize) -> Self {
        let mut window = Self { first, rows, sizes: Vec::with_capacity(cols.div_ceil(shape.columns)) };
        let mut sizes = std::mem::take(&mut window.sizes);
        window.each_tile(shape, cols, |_, segments| {
            let slices = segments.chunks(LANES);
            sizes.push(Start { slice: slices.len(), step: slices.map(|slice| slice[0].length).sum() });
        });
        window.sizes = sizes;
        window
    }

    /// The number of entries.
    pub(super) fn entries(&self) -> usize {
        self.rows.columns.len()
    }

    /// Writes the entries to the arrays of each tile. `nowhere` is the row of lanes that have none.
    pub(super) fn fill(&self, shape: Shape, cols: usize, nowhere: u16, to: Vec<Filled<'_>>) {
        let mut to = to.into_iter();
        self.each_tile(shape, cols, |first_column, segments| {
            if let Some(to) = to.next() {
                self.fill_tile(first_column, segments, nowhere, to);
            }
        });
    }

    fn fill_tile(&self, first_column: usize, segments: &[Segment], nowhere: u16, mut to: Filled<'_>) {
        for segments in segments.chunks(LANES) {
            let longest = segments[0].length;
            let columns = take(&mut to.columns, longest);
            let row = |segment: &Segment| (self.first + segment.row) as u16;
            let rows = std::array::from_fn(|lane| segments.get(lane).map_or(nowhere, row));
            take(&mut to.slices, 1)[0] = Slice { rows, steps: longest as u32 };
            for (lane, segment) in segments.iter().enumerate() {
                let entries = segment.first..segment.first + segment.length;
                // Columns within a tile fit 16 bits.
                let place = |column: &u32| (*column as usize - first_column) as u16;
                let mut last = 0;
                for (columns, place) in columns.iter_mut().zip(self.rows.columns[entries].iter().map(place)) {
                    columns[lane] = place;
                    last = place;
                }
                columns[segment.length..].iter_mut().for_each(|columns| columns[lane] = last);
            }
            for (to, from) in to.weights.iter_mut().zip(&self.rows.weights) {
                let to = take(to, longest);
                for (lane, segment) in segments.iter().enumerate() {
                    let from = &from[segment.first..segment.first + segment.length];
                    to.iter_mut().zip(from).for_each(|(to, &weight)| to[lane] = weight);
                }
            }
        }
    }

    /// Calls `visit` with each tile's first column and its non-empty rows, the longest row first.
    fn each_tile(&self, shape: Shape, cols: usize, mut visit: impl FnMut(usize, &[Segment])) {
        let mut next: Vec<usize> = self.rows.row_start[..self.rows.rows()].to_vec();
        let mut segments = Vec::new();
        for first_column in (0..cols).step_by(shape.columns) {
            let end_column = first_column + shape.columns;
            segments.clear();
            for (row, (next, &end)) in next.iter_mut().zip(&self.rows.row_start[1..]).enumerate() {
                let first = *next;
                let in_tile = |column: &&u32| (**column as usize) < end_column;
                *next += self.rows.columns[first..end].iter().take_while(in_tile).count();
                if *next > first {
                    segments.push(Segment { row, first, length: *next - first });
                }
            }
            // The sort is stable: rows of equal length keep their order.
            segments.sort_by_key(|segment| Reverse(segment.length));
            visit(first_column, &segments);
        }
    }
}
