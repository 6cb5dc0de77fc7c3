//! The part of a symmetric matrix below its diagonal: the transpose of what is above.

use std::ops::Range;

use rayon::prelude::*;

use super::band::{Band, Place};
use super::rows::{CompressedRows, Pieces};
use super::shape::Shape;
use super::window::WINDOW;

/// Some entries of consecutive rows, whose columns are near each other.
pub(in crate::transport) struct Fragment {
    pub(in crate::transport) first: usize,
    /// The column that `columns` count from.
    pub(in crate::transport) base: u32,
    /// The offset into `columns` for each row, then the number of entries.
    pub(in crate::transport) row_start: Vec<u32>,
    pub(in crate::transport) columns: Vec<u16>,
    /// `[channel][entry]`
    pub(in crate::transport) weights: Vec<Vec<f32>>,
}

impl Fragment {
    /// The number of rows.
    fn rows(&self) -> usize {
        self.row_start.len() - 1
    }

    /// Whether it has some of these rows.
    pub(super) fn overlaps(&self, rows: &Range<usize>) -> bool {
        self.first < rows.end && rows.start < self.first + self.rows()
    }

    /// Appends its entries of a row to the last row of `to`.
    pub(super) fn append(&self, row: usize, to: &mut CompressedRows) {
        let entries = self.row(row);
        to.columns.extend(self.columns[entries.clone()].iter().map(|&column| self.base + u32::from(column)));
        for (to, from) in to.weights.iter_mut().zip(&self.weights) {
            to.extend_from_slice(&from[entries.clone()]);
        }
    }

    /// The number of its entries of a row.
    pub(super) fn entries_of(&self, row: usize) -> usize {
        self.row(row).len()
    }

    /// Its entries of a row; none where it does not have the row.
    fn row(&self, row: usize) -> Range<usize> {
        let row = row.checked_sub(self.first).filter(|&row| row < self.rows());
        row.map_or(0..0, |row| self.row_start[row] as usize..self.row_start[row + 1] as usize)
    }

    /// The fragment of these `rows`, which has the transpose of `of`. Rows of the latter are counted from its first one, which has number `base`.
    fn transposed(of: &impl Entries, rows: Range<usize>, base: usize, channels: usize) -> Self {
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

/// What is below the diagonal in `rows`, as fragments by ascending columns. The rows before are in `bands`; these come from
/// `above`, which has what is on and above the diagonal.
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

/// The transpose of these columns of `bands`, as fragments by ascending columns of the transpose. The first row of the bands has number `first_row`
/// there.
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
        let places = bands[band].places(tile, shape.rows)?;
        let entries = OfTile { band: &bands[band], first_column: first, places, columns: of_tile.clone() };
        Some(Fragment::transposed(&entries, of_tile, first_row + band * shape.rows, channels))
    };
    tiles.par_iter().filter_map(of_tile).collect()
}

/// Entries above the diagonal.
trait Entries: Sync {
    /// Where the weights of an entry are.
    type At: Copy;

    /// Calls `visit` with row, counted from the first one, column and place of each entry, row by row.
    fn each(&self, visit: impl FnMut(usize, usize, Self::At));

    fn weight(&self, channel: usize, at: Self::At) -> f32;
}

/// The entries of a tile in some columns.
struct OfTile<'a> {
    band: &'a Band,
    /// The first column of the tile.
    first_column: usize,
    /// Where each row of the tile is.
    places: Vec<Place>,
    columns: Range<usize>,
}

impl Entries for OfTile<'_> {
    /// Step and lane.
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

impl<'a> Entries for OfRows<'a> {
    /// The piece, and the place there.
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
