//! From tiles back to rows.

use std::ops::Range;

use rayon::prelude::*;

use super::Tiles;
use super::rows::CompressedRows;

/// Which entries are read.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Entries {
    All,
    /// Only those on and above the diagonal.
    Upper,
}

impl Tiles {
    /// All rows.
    pub(in crate::transport) fn to_rows(&self) -> CompressedRows {
        let row_start = self.row_start(Entries::All);
        let mut columns = Vec::with_capacity(self.entries);
        self.columns(Entries::All, &row_start).for_each(|some| columns.extend(some));
        let weights = (0..self.channels).map(|channel| {
            let mut weights = Vec::with_capacity(self.entries);
            self.weights(Entries::All, channel, &row_start).for_each(|some| weights.extend(some));
            weights
        });
        let weights = weights.collect();
        CompressedRows { row_start, columns, weights }
    }

    /// The offset of each row, then the number of entries.
    pub(in crate::transport) fn row_start(&self, which: Entries) -> Vec<usize> {
        let counts = |band| {
            let mut counts = vec![0; self.rows_of(band).len()];
            self.each(band, which, |row, _, _, _| counts[row] += 1);
            counts
        };
        let counts: Vec<Vec<usize>> = (0..self.bands.len()).into_par_iter().map(counts).collect();
        let mut end = 0;
        let ends = counts.iter().flatten().map(|count| {
            end += count;
            end
        });
        std::iter::once(0).chain(ends).collect()
    }

    /// The columns of the entries, row by row, as several pieces. `row_start` is that of these entries.
    pub(in crate::transport) fn columns<'a>(
        &'a self,
        which: Entries,
        row_start: &'a [usize],
    ) -> impl Iterator<Item = Vec<u32>> + 'a {
        self.pieces(which, row_start, |_, column, _, _| column as u32)
    }

    /// The weights of one channel, as [`Tiles::columns`].
    pub(in crate::transport) fn weights<'a>(
        &'a self,
        which: Entries,
        channel: usize,
        row_start: &'a [usize],
    ) -> impl Iterator<Item = Vec<f32>> + 'a {
        self.pieces(which, row_start, move |band, _, step, lane| {
            self.bands[band].weights[channel][step][lane]
        })
    }

    /// What `value` says of band, column, step and lane of each entry, row by row. A piece is a band, and as many are made at the same
    /// time as there are threads.
    fn pieces<'a, T: Default + Clone + Send + 'a>(
        &'a self,
        which: Entries,
        row_start: &'a [usize],
        value: impl Fn(usize, usize, usize, usize) -> T + Sync + 'a,
    ) -> impl Iterator<Item = Vec<T>> + 'a {
        let piece = move |band: usize| {
            let rows = self.rows_of(band);
            let first = row_start[rows.start];
            let mut next: Vec<usize> = row_start[rows.clone()].iter().map(|start| start - first).collect();
            let mut values = vec![T::default(); row_start[rows.end] - first];
            // The tiles of a row come from left to right, and so do the entries within each.
            self.each(band, which, |row, column, step, lane| {
                values[next[row]] = value(band, column, step, lane);
                next[row] += 1;
            });
            values
        };
        let together = rayon::current_num_threads();
        (0..self.bands.len()).step_by(together).flat_map(move |first| {
            let bands = first..self.bands.len().min(first + together);
            bands.into_par_iter().map(&piece).collect::<Vec<_>>()
        })
    }

    /// The rows of a band.
    fn rows_of(&self, band: usize) -> Range<usize> {
        band * self.shape.rows..self.rows.min((band + 1) * self.shape.rows)
    }

    /// Calls `visit` with row within the band, column, step and lane of each entry of a band, tile by tile.
    fn each(&self, number: usize, which: Entries, mut visit: impl FnMut(usize, usize, usize, usize)) {
        let (band, rows) = (&self.bands[number], self.rows_of(number));
        let columns = &band.columns[..];
        let is_upper = which == Entries::Upper;
        for (tile, first_column) in (0..self.cols).step_by(self.shape.columns).enumerate() {
            if is_upper && first_column + self.shape.columns <= rows.start {
                continue;
            }
            let Some(places) = band.places(tile, rows.len()) else { continue };
            for (row, place) in places.into_iter().enumerate() {
                let from = if is_upper { (rows.start + row).saturating_sub(first_column) } else { 0 };
                place.each(columns, from, self.shape.columns, |column, step| {
                    visit(row, first_column + usize::from(column), step, usize::from(place.lane));
                });
            }
        }
    }
}
