//! A sparse matrix that is divided into tiles. The vectors of a product therefore stay in the processor's caches, and entries are read at
//! the speed of memory.
//!
//! Within a tile, eight rows of about equal numbers of entries form a *slice* (the format is known as sliced ELLPACK). The sums of the
//! eight rows are computed together, and each sum adds the entries of its row from left to right. The bits of a product therefore do not
//! depend on the shape of the tiles, the number of threads or the instructions.
//!
//! Rows are added in groups, from the first to the last ([`Builder`]). A symmetric matrix is built from its triangle on and above the
//! diagonal. The entries below the diagonal are read from the tiles of earlier groups.

mod band;
mod build;
#[cfg(target_arch = "x86_64")]
mod gather;
mod kernels;
mod pages;
mod rows;
#[cfg(test)]
mod tests;

use std::ops::Range;

use rayon::prelude::*;

use band::Band;
pub(super) use band::Fragment;
pub(super) use build::{Before, Builder, groups, take};
pub(super) use kernels::{BLOCK_WIDTH, Interleaved, Summable};
pub(super) use pages::Pages;
pub(crate) use rows::CompressedRows;
pub(super) use rows::Pieces;

#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Entries {
    All,
    /// Only the entries on and above the diagonal.
    Upper,
}

/// A sparse matrix in tiles. An entry has one `f32` weight for each channel.
#[derive(Clone, Debug)]
pub(crate) struct Tiles {
    rows: usize,
    cols: usize,
    channels: usize,
    entries: usize,
    shape: Shape,
    /// The rows of tiles, from top to bottom.
    bands: Vec<Band>,
}

impl Tiles {
    /// The matrix of `cols` columns whose rows are the concatenated rows of `pieces`. Each piece is freed as soon as its rows are in tiles.
    pub(super) fn new(cols: usize, pieces: Vec<CompressedRows>) -> Self {
        Self::of_pieces(cols, pieces, false)
    }

    /// The symmetric matrix whose triangle, on and above the diagonal, has these rows.
    pub(super) fn symmetric(pieces: Vec<CompressedRows>) -> Self {
        let rows = pieces.iter().map(CompressedRows::rows).sum();
        Self::of_pieces(rows, pieces, true)
    }

    fn of_pieces(cols: usize, pieces: Vec<CompressedRows>, symmetric: bool) -> Self {
        let channels = pieces.first().map_or(0, |piece| piece.weights.len());
        let mut pieces = Pieces::new(0, pieces);
        let entries = if symmetric { 2 * pieces.entries() } else { pieces.entries() };
        let mut builder = Builder::new([pieces.rows(), cols], channels, entries, symmetric);
        while let Some(rows) = builder.next_rows() {
            builder.push(&pieces);
            pieces.release_before(rows.end);
        }
        builder.finish()
    }

    pub(super) fn cols(&self) -> usize {
        self.cols
    }

    pub(super) fn nonzeros(&self) -> usize {
        self.entries
    }

    pub(super) fn bytes(&self) -> usize {
        self.bands.iter().map(Band::bytes).sum()
    }

    /// The number of rows of a band of tiles. The last band may have fewer.
    pub(super) fn band_rows(&self) -> usize {
        self.shape.rows
    }

    pub(super) fn product<V: Summable>(&self, channel: usize, band: usize, from: &[V]) -> Vec<V> {
        let band = &self.bands[band];
        let (slices, columns, weights) = (&band.slices[..], &band.columns[..], &band.weights[channel][..]);
        let sums = V::sums();
        // The additional sum receives the products of lanes without a row.
        let mut product = vec![V::default(); band.rows + 1];
        for (ends, from) in band.tiles.windows(2).zip(from.chunks(self.shape.columns)) {
            let [start, end] = [ends[0], ends[1]];
            sums.add(
                &slices[start.slice..end.slice],
                &columns[start.step..end.step],
                &weights[start.step..end.step],
                from,
                &mut product,
            );
        }
        product.truncate(band.rows);
        product
    }

    /// Returns `sum` plus the squares of all entries. The squares of each row are summed from left to right, and then the sums of rows are
    /// added to `sum` one by one. The bits do not depend on the shape, on the number of threads, or on a division of the matrix between
    /// rows.
    pub(super) fn squares(&self, channel: usize, sum: f64) -> f64 {
        let of_band = |band: &Band| {
            let mut sums = vec![0.0_f64; band.rows + 1];
            let mut step = 0;
            for slice in &band.slices {
                let steps = step..step + slice.steps as usize;
                step = steps.end;
                let mut of_lanes = slice.rows.map(|row| sums[usize::from(row)]);
                for weights in &band.weights[channel][steps] {
                    of_lanes
                        .iter_mut()
                        .zip(weights)
                        .for_each(|(sum, &weight)| *sum += f64::from(weight).powi(2));
                }
                slice.rows.iter().zip(of_lanes).for_each(|(&row, sum)| sums[usize::from(row)] = sum);
            }
            sums.truncate(band.rows);
            sums
        };
        let bands: Vec<Vec<f64>> = self.bands.par_iter().map(of_band).collect();
        bands.iter().flatten().fold(sum, |sum, row| sum + row)
    }
}

/// Conversion from tiles back to rows.
impl Tiles {
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

    /// The offset of the entries of each row. The last element is the number of entries.
    pub(crate) fn row_start(&self, which: Entries) -> Vec<usize> {
        let counts = |band: usize| {
            let mut counts = vec![0; self.bands[band].rows];
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

    /// The columns of the entries, row by row, as several pieces. `row_start` must have the offsets of the same entries.
    pub(crate) fn columns<'a>(
        &'a self,
        which: Entries,
        row_start: &'a [usize],
    ) -> impl Iterator<Item = Vec<u32>> + 'a {
        self.pieces(which, row_start, |_, column, _, _| column as u32)
    }

    /// The weights of one channel, in pieces like [`Tiles::columns`].
    pub(crate) fn weights<'a>(
        &'a self,
        which: Entries,
        channel: usize,
        row_start: &'a [usize],
    ) -> impl Iterator<Item = Vec<f32>> + 'a {
        self.pieces(which, row_start, move |band, _, step, lane| {
            self.bands[band].weights[channel][step][lane]
        })
    }

    /// Calls `value` with the band, column, step and lane of each entry. Returns the results row by row, one piece per band. At any time,
    /// at most one piece per thread is computed.
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
            // The tiles of a row are visited from left to right, and so are the entries within each tile.
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

    fn rows_of(&self, band: usize) -> Range<usize> {
        band * self.shape.rows..self.rows.min((band + 1) * self.shape.rows)
    }

    /// Calls `visit` for each entry of a band, tile by tile, with the entry's row within the band, column, step and lane.
    fn each(&self, number: usize, which: Entries, mut visit: impl FnMut(usize, usize, usize, usize)) {
        let (band, rows) = (&self.bands[number], self.rows_of(number));
        let columns = &band.columns[..];
        let is_upper = which == Entries::Upper;
        for (tile, first_column) in (0..self.cols).step_by(self.shape.columns).enumerate() {
            if is_upper && first_column + self.shape.columns <= rows.start {
                continue;
            }
            let Some(places) = band.places(tile) else { continue };
            for (row, place) in places.into_iter().enumerate() {
                let from = if is_upper { (rows.start + row).saturating_sub(first_column) } else { 0 };
                place.each(columns, from, self.shape.columns, |column, step| {
                    visit(row, first_column + usize::from(column), step, usize::from(place.lane));
                });
            }
        }
    }
}

/// Two matrices are equal if their entries are equal. The shapes of their tiles are not compared.
impl PartialEq for Tiles {
    fn eq(&self, other: &Self) -> bool {
        (self.rows, self.cols, self.entries) == (other.rows, other.cols, other.entries)
            && self.to_rows() == other.to_rows()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Shape {
    rows: usize,
    columns: usize,
}

/// The maximum number of rows of a band. Row numbers, and the number after the last row, fit into 16 bits. The sums of a band fit into the
/// second-level cache.
const MOST_ROWS: usize = 1 << 14;
/// The minimum number of rows of a band. With fewer rows, the work between tiles would dominate.
const LEAST_ROWS: usize = 1 << 8;
/// The minimum number of bands per thread, if there are enough rows. With several bands, all threads finish at about the same time.
const BANDS_A_THREAD: usize = 4;

/// A large matrix has at least this many bands, so that it can be built group by group. Each of these bands has at least
/// `ROWS_OF_MANY_BANDS` rows.
const BANDS: usize = 16;
const ROWS_OF_MANY_BANDS: usize = 1 << 12;

/// The minimum number of columns of a tile: 32 KiB of a vector, which fit into the first-level cache.
const LEAST_COLUMNS: usize = 1 << 12;
/// The maximum number of columns of a tile: 256 KiB of a vector, which fit into the second-level cache.
const MOST_COLUMNS: usize = 1 << 15;
/// The number of entries that a row should have in a tile. With fewer entries, the fixed cost of a row's sum would dominate.
const ENTRIES_OF_A_ROW: usize = 5;

impl Shape {
    /// The shape for a matrix of `rows × columns` with `entries` entries, if `threads` threads multiply. Sums do not depend on the shape.
    fn new(rows: usize, columns: usize, entries: usize, threads: usize) -> Self {
        let bands = (BANDS_A_THREAD * threads.max(1)).max(BANDS.min(rows / ROWS_OF_MANY_BANDS));
        // A band has as many rows as the largest power of two that leaves at least this number of bands.
        let of_band = (1 << rows.div_ceil(bands).max(1).ilog2()).clamp(LEAST_ROWS, MOST_ROWS);
        // The narrowest tile in which a row has enough entries has `least` columns.
        let least = (ENTRIES_OF_A_ROW * columns * rows).div_ceil(entries.max(1));
        Self { rows: of_band, columns: least.next_power_of_two().clamp(LEAST_COLUMNS, MOST_COLUMNS) }
    }
}

#[cfg(test)]
mod tests_of_shape {
    use super::*;

    #[test]
    fn full_matrices_have_narrow_tiles_and_enough_bands() {
        let shape = |side: usize, of_row, threads| {
            let pixels = side * side;
            let Shape { rows, columns } = Shape::new(pixels, pixels, of_row * pixels, threads);
            (rows, columns)
        };
        assert_eq!(shape(128, 320, 2), (2048, 4096));
        assert_eq!(shape(128, 37, 2), (2048, 4096));
        assert_eq!(shape(512, 330, 2), (16_384, 4096));
        assert_eq!(shape(512, 40, 2), (16_384, 32_768));
        assert_eq!(shape(512, 40, 16), (4096, 32_768));
        // One of four processes, each with a single thread, holds a matrix of this shape.
        let Shape { rows, .. } = Shape::new(512 * 512 / 4, 512 * 512, 330 * 512 * 512 / 4, 1);
        assert_eq!(rows, 4096);
        assert_eq!(shape(1, 0, 2), (256, 4096));
    }
}
