//! A band, which is a row of tiles, and the transpose of its entries. In a symmetric matrix, the transpose is the part below the diagonal.

use std::ops::Range;

use rayon::prelude::*;

use super::build::{WINDOW, Window};
use super::kernels::{LANES, Slice};
use super::rows::{CompressedRows, Pieces};
use super::{Pages, Shape, take};

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Start {
    pub(super) slice: usize,
    pub(super) step: usize,
}

/// The parts of a tile's arrays into which one window writes its entries.
pub(super) struct Filled<'a> {
    pub(super) slices: &'a mut [Slice],
    pub(super) columns: &'a mut [[u16; LANES]],
    pub(super) weights: Vec<&'a mut [[f32; LANES]]>,
}

#[derive(Clone, Debug)]
pub(super) struct Band {
    /// The number of rows. The last band of a matrix may have fewer than the others.
    pub(super) rows: usize,
    /// The start of each tile, from left to right, and the end of the last tile.
    pub(super) tiles: Vec<Start>,
    pub(super) slices: Vec<Slice>,
    /// Columns relative to the tile, ascending in each row. A repeated column is padding of the slice, and has weight 0.
    pub(super) columns: Pages<[u16; LANES]>,
    /// The weights, indexed by `[channel][step][lane]`.
    pub(super) weights: Vec<Pages<[f32; LANES]>>,
}

impl Band {
    pub(super) fn new(rows: usize, windows: &[Window], channels: usize, shape: Shape, cols: usize) -> Self {
        // Within a tile, the entries of one window follow those of the previous window.
        let across = cols.div_ceil(shape.columns);
        let mut tiles = vec![Start::default()];
        let mut end = Start::default();
        for tile in 0..across {
            for size in windows.iter().map(|window| window.sizes[tile]) {
                end = Start { slice: end.slice + size.slice, step: end.step + size.step };
            }
            tiles.push(end);
        }
        let mut slices = vec![Slice::default(); end.slice];
        let mut columns = Pages::zeros(end.step);
        let mut weights: Vec<Pages<[f32; LANES]>> = (0..channels).map(|_| Pages::zeros(end.step)).collect();
        let (mut slices_left, mut columns_left) = (slices.as_mut_slice(), &mut columns[..]);
        let mut weights_left: Vec<&mut [[f32; LANES]]> =
            weights.iter_mut().map(|plane| &mut plane[..]).collect();
        let mut to: Vec<Vec<Filled<'_>>> = windows.iter().map(|_| Vec::with_capacity(across)).collect();
        for tile in 0..across {
            for (to, window) in to.iter_mut().zip(windows) {
                let Start { slice, step } = window.sizes[tile];
                to.push(Filled {
                    slices: take(&mut slices_left, slice),
                    columns: take(&mut columns_left, step),
                    weights: weights_left.iter_mut().map(|plane| take(plane, step)).collect(),
                });
            }
        }
        windows.par_iter().zip(to).for_each(|(window, to)| window.fill(shape, cols, rows as u16, to));
        Self { rows, tiles, slices, columns, weights }
    }

    pub(super) fn bytes(&self) -> usize {
        let weights: usize = self.weights.iter().map(|plane| size_of_val(&plane[..])).sum();
        size_of_val(self.tiles.as_slice())
            + size_of_val(self.slices.as_slice())
            + size_of_val(&self.columns[..])
            + weights
    }

    /// The location of each row's entries in a tile; `None` for an empty tile.
    pub(super) fn places(&self, tile: usize) -> Option<Vec<Place>> {
        let [start, end] = [self.tiles[tile], self.tiles[tile + 1]];
        let mut step = start.step;
        let mut places = vec![Place::default(); self.rows + 1];
        for slice in &self.slices[start.slice..end.slice] {
            for (lane, &row) in slice.rows.iter().enumerate() {
                places[usize::from(row)] = Place { step, steps: slice.steps, lane: lane as u8 };
            }
            step += slice.steps as usize;
        }
        // The last location is that of lanes without a row.
        places.truncate(self.rows);
        (end.slice > start.slice).then_some(places)
    }
}

/// The location of the entries of a row within a tile: one lane of consecutive steps.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place {
    step: usize,
    /// The number of steps. Steps beyond the entries of the row are padding.
    steps: u32,
    pub(super) lane: u8,
}

impl Place {
    /// Calls `visit` with the column and the step of each entry of the row in the tile's columns `from..to`. `columns` is the array of the
    /// band.
    pub(super) fn each(
        self,
        columns: &[[u16; LANES]],
        from: usize,
        to: usize,
        mut visit: impl FnMut(u16, usize),
    ) {
        let of_row = &columns[self.step..self.step + self.steps as usize];
        let column = |step: &[u16; LANES]| step[usize::from(self.lane)];
        let first =
            if from == 0 { 0 } else { of_row.partition_point(|step| usize::from(column(step)) < from) };
        let mut before = None;
        for (at, step) in of_row.iter().enumerate().skip(first) {
            let column = column(step);
            // A repeated column is padding, and all later columns are padding too.
            if usize::from(column) >= to || before >= Some(column) {
                break;
            }
            visit(column, self.step + at);
            before = Some(column);
        }
    }
}

/// Entries of consecutive rows. Their columns are close together, so 16 bits hold a column relative to `base`.
pub(in crate::transport) struct Fragment {
    pub(in crate::transport) first: usize,
    /// The number that is added to each of `columns`.
    pub(in crate::transport) base: u32,
    /// The offset of each row into `columns`. The last element is the number of entries.
    pub(in crate::transport) row_start: Vec<u32>,
    pub(in crate::transport) columns: Vec<u16>,
    /// The weights, indexed by `[channel][entry]`.
    pub(in crate::transport) weights: Vec<Vec<f32>>,
}

impl Fragment {
    fn rows(&self) -> usize {
        self.row_start.len() - 1
    }

    pub(super) fn overlaps(&self, rows: &Range<usize>) -> bool {
        self.first < rows.end && rows.start < self.first + self.rows()
    }

    /// Appends the fragment's entries of this row to the last row of `to`.
    pub(super) fn append(&self, row: usize, to: &mut CompressedRows) {
        let entries = self.row(row);
        to.columns.extend(self.columns[entries.clone()].iter().map(|&column| self.base + u32::from(column)));
        for (to, from) in to.weights.iter_mut().zip(&self.weights) {
            to.extend_from_slice(&from[entries.clone()]);
        }
    }

    pub(super) fn entries_of(&self, row: usize) -> usize {
        self.row(row).len()
    }

    /// The entries of a row, as a range. It is empty if the fragment does not have the row.
    fn row(&self, row: usize) -> Range<usize> {
        let row = row.checked_sub(self.first).filter(|&row| row < self.rows());
        row.map_or(0..0, |row| self.row_start[row] as usize..self.row_start[row + 1] as usize)
    }

    /// The transpose of `of`, as a fragment with these `rows`. `base` is the number of the first row of `of`.
    fn transposed(of: &impl Above, rows: Range<usize>, base: usize, channels: usize) -> Self {
        let mut row_start = vec![0; rows.len() + 1];
        of.each(|_, column, _| row_start[column - rows.start + 1] += 1);
        (0..rows.len()).for_each(|row| row_start[row + 1] += row_start[row]);
        let mut next = row_start.clone();
        let mut columns = vec![0; row_start[rows.len()] as usize];
        let mut weights = vec![vec![0.0; columns.len()]; channels];
        of.each(|row, column, at| {
            let next = &mut next[column - rows.start];
            let to = *next as usize;
            columns[to] = row as u16;
            weights.iter_mut().enumerate().for_each(|(channel, plane)| plane[to] = of.weight(channel, at));
            *next += 1;
        });
        Self { first: rows.start, base: base as u32, row_start, columns, weights }
    }
}

/// The entries below the diagonal in `rows`, as fragments by ascending columns. `bands` contains the earlier rows. `above` contains the
/// entries of `rows` on and above the diagonal.
pub(super) fn below(
    bands: &[Band],
    above: &Pieces,
    rows: &Range<usize>,
    (shape, channels): (Shape, usize),
) -> Vec<Fragment> {
    let of_window = |&first: &usize| {
        let entries = OfRows { above, rows: first..rows.end.min(first + WINDOW), end: rows.end };
        Fragment::transposed(&entries, first..rows.end, first, channels)
    };
    let windows: Vec<usize> = rows.clone().step_by(WINDOW).collect();
    let mut fragments = of_bands(bands, rows, 0, (shape, channels));
    fragments.par_extend(windows.par_iter().map(of_window));
    fragments
}

/// The transpose of these columns of `bands`, as fragments by ascending columns. The first row of `bands` becomes the column `first_row`.
pub(super) fn of_bands(
    bands: &[Band],
    columns: &Range<usize>,
    first_row: usize,
    (shape, channels): (Shape, usize),
) -> Vec<Fragment> {
    if columns.is_empty() {
        return Vec::new();
    }
    let across = columns.start / shape.columns..columns.end.div_ceil(shape.columns);
    let tiles: Vec<(usize, usize)> =
        (0..bands.len()).flat_map(|band| across.clone().map(move |tile| (band, tile))).collect();
    let of_tile = |&(band, tile): &(usize, usize)| {
        let first = tile * shape.columns;
        let of_tile = first.max(columns.start)..columns.end.min(first + shape.columns);
        let places = bands[band].places(tile)?;
        let entries = OfTile { band: &bands[band], first_column: first, places, columns: of_tile.clone() };
        Some(Fragment::transposed(&entries, of_tile, first_row + band * shape.rows, channels))
    };
    tiles.par_iter().filter_map(of_tile).collect()
}

trait Above: Sync {
    /// The location of an entry's weights.
    type At: Copy;

    /// Calls `visit` with row, column and location of each entry, row by row. Row numbers start at 0 for the first row.
    fn each(&self, visit: impl FnMut(usize, usize, Self::At));

    fn weight(&self, channel: usize, at: Self::At) -> f32;
}

struct OfTile<'a> {
    band: &'a Band,
    first_column: usize,
    places: Vec<Place>,
    columns: Range<usize>,
}

impl Above for OfTile<'_> {
    /// The step and the lane of the entry.
    type At = (usize, u8);

    fn each(&self, mut visit: impl FnMut(usize, usize, Self::At)) {
        let first_column = self.first_column;
        let [from, to] = [self.columns.start, self.columns.end].map(|column| column - first_column);
        let columns = &self.band.columns[..];
        for (row, place) in self.places.iter().enumerate() {
            place.each(columns, from, to, |column, step| {
                visit(row, first_column + usize::from(column), (step, place.lane));
            });
        }
    }

    fn weight(&self, channel: usize, (step, lane): Self::At) -> f32 {
        self.band.weights[channel][step][usize::from(lane)]
    }
}

/// The entries of these `rows` above the diagonal, and before the column `end`.
struct OfRows<'a> {
    above: &'a Pieces,
    rows: Range<usize>,
    end: usize,
}

impl<'a> Above for OfRows<'a> {
    /// The piece that contains the entry, and the index of the entry in this piece.
    type At = (&'a CompressedRows, usize);

    fn each(&self, mut visit: impl FnMut(usize, usize, Self::At)) {
        for row in self.rows.clone() {
            let (piece, entries) = self.above.row(row);
            let columns = entries.map(|entry| (piece.columns[entry] as usize, entry));
            for (column, entry) in columns.take_while(|(column, _)| *column < self.end) {
                if column > row {
                    visit(row - self.rows.start, column, (piece, entry));
                }
            }
        }
    }

    fn weight(&self, channel: usize, (piece, entry): Self::At) -> f32 {
        piece.weights[channel][entry]
    }
}
