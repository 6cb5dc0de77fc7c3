//! The part of a symmetric matrix below its diagonal: the transpose of what is above.

use std::ops::Range;

use rayon::prelude::*;

use super::band::{Band, Place};
use super::rows::{CompressedRows, Pieces};
use super::shape::Shape;
use super::window::WINDOW;

/// Some entries of consecutive rows.
pub(super) struct Fragment {
    first: usize,
    entries: CompressedRows,
}

impl Fragment {
    /// Whether it has some of these rows.
    pub(super) fn overlaps(&self, rows: &Range<usize>) -> bool {
        self.first < rows.end && rows.start < self.first + self.entries.rows()
    }

    /// Appends its entries of a row to the last row of `to`.
    pub(super) fn append(&self, row: usize, to: &mut CompressedRows) {
        to.extend(&self.entries, self.row(row));
    }

    /// The number of its entries of a row.
    pub(super) fn entries_of(&self, row: usize) -> usize {
        self.row(row).len()
    }

    /// Its entries of a row; none where it does not have the row.
    fn row(&self, row: usize) -> Range<usize> {
        let row = row.checked_sub(self.first).filter(|&row| row < self.entries.rows());
        row.map_or(0..0, |row| self.entries.row(row))
    }

    /// The fragment of these `rows`, which has the transpose of `of`.
    fn transposed(of: &impl Entries, rows: Range<usize>, channels: usize) -> Self {
        let mut row_start = vec![0; rows.len() + 1];
        of.each(|_, column, _| row_start[column - rows.start + 1] += 1);
        (0..rows.len()).for_each(|row| row_start[row + 1] += row_start[row]);
        let mut next = row_start.clone();
        let mut columns = vec![0; row_start[rows.len()]];
        let mut weights = vec![vec![0.0; columns.len()]; channels];
        of.each(|row, column, at| {
            let to = &mut next[column - rows.start];
            columns[*to] = row as u32;
            weights.iter_mut().enumerate().for_each(|(channel, plane)| plane[*to] = of.weight(channel, at));
            *to += 1;
        });
        Self { first: rows.start, entries: CompressedRows { row_start, columns, weights } }
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
    let across = rows.start / shape.columns..rows.end.div_ceil(shape.columns);
    let tiles: Vec<(usize, usize)> =
        (0..bands.len()).flat_map(|band| across.clone().map(move |tile| (band, tile))).collect();
    let of_tile = |&(band, tile): &(usize, usize)| {
        let first = tile * shape.columns;
        let columns = first.max(rows.start)..rows.end.min(first + shape.columns);
        let places = bands[band].places(tile, shape.rows)?;
        let entries = OfTile {
            band: &bands[band],
            corner: [band * shape.rows, first],
            places,
            columns: columns.clone(),
        };
        Some(Fragment::transposed(&entries, columns, channels))
    };
    let of_window = |&first: &usize| {
        let entries = OfRows { above, rows: first..rows.end.min(first + WINDOW), end: rows.end };
        Fragment::transposed(&entries, first..rows.end, channels)
    };
    let windows: Vec<usize> = rows.clone().step_by(WINDOW).collect();
    let mut fragments: Vec<Fragment> = tiles.par_iter().filter_map(of_tile).collect();
    fragments.par_extend(windows.par_iter().map(of_window));
    fragments
}

/// Entries above the diagonal.
trait Entries: Sync {
    /// Where the weights of an entry are.
    type At: Copy;

    /// Calls `visit` with row, column and place of each entry, row by row.
    fn each(&self, visit: impl FnMut(usize, usize, Self::At));

    fn weight(&self, channel: usize, at: Self::At) -> f32;
}

/// The entries of a tile in some columns.
struct OfTile<'a> {
    band: &'a Band,
    /// The first row and column of the tile.
    corner: [usize; 2],
    /// Where each row of the tile is.
    places: Vec<Place>,
    columns: Range<usize>,
}

impl Entries for OfTile<'_> {
    /// Step and lane.
    type At = (usize, u8);

    fn each(&self, mut visit: impl FnMut(usize, usize, Self::At)) {
        let [first_row, first_column] = self.corner;
        let [from, to] = [self.columns.start, self.columns.end].map(|column| column - first_column);
        let columns = &self.band.columns[..];
        for (row, place) in self.places.iter().enumerate() {
            place.each(columns, from, to, |column, step| {
                visit(first_row + row, first_column + usize::from(column), (step, place.lane));
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
                    visit(row, column, (piece, entry));
                }
            }
        }
    }

    fn weight(&self, channel: usize, (piece, entry): Self::At) -> f32 {
        piece.weights[channel][entry]
    }
}
