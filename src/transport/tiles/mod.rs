//! A sparse matrix cut into tiles, so that the vectors of a product stay in the processor's caches and the
//! entries are read at the speed of memory.
//!
//! Within a tile, eight rows of about equally many entries form a *slice* (the format is known as sliced
//! ELLPACK). The eight sums are computed at the same time, each with the entries of one row from left to
//! right. So a product has the same bits whatever the tiles' shape, the number of threads and the
//! instructions used.
//!
//! Rows come in groups, from the first to the last ([`Builder`]). Of a symmetric matrix only the triangle on and above the
//! diagonal is given; what is below it is read from the tiles of the groups before.

mod band;
mod build;
#[cfg(target_arch = "x86_64")]
mod gather;
mod mirror;
mod pages;
mod read;
mod rows;
mod shape;
mod slice;
mod sums;
#[cfg(test)]
mod tests;
mod value;
mod window;

use rayon::prelude::*;

use band::Band;
pub(super) use build::{Before, Builder, groups, take};
pub(super) use mirror::Fragment;
pub(super) use pages::Pages;
pub(crate) use read::Entries;
pub(crate) use rows::CompressedRows;
pub(super) use rows::Pieces;
use shape::Shape;

pub(super) use sums::Summable;
pub(super) use value::{BLOCK_WIDTH, Interleaved};

/// A sparse matrix in tiles, with one set of `f32` weights per channel on a common sparsity pattern.
#[derive(Clone, Debug)]
pub(super) struct Tiles {
    rows: usize,
    cols: usize,
    channels: usize,
    entries: usize,
    shape: Shape,
    /// The rows of tiles, from the first to the last.
    bands: Vec<Band>,
}

impl Tiles {
    /// The matrix of `cols` columns whose rows are those of `pieces`, one after the other. The memory of the pieces is
    /// given back as soon as their rows are in tiles.
    pub(super) fn new(cols: usize, pieces: Vec<CompressedRows>) -> Self {
        Self::of_pieces(cols, pieces, false)
    }

    /// The symmetric matrix whose triangle on and above the diagonal has the rows of `pieces`.
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

    /// Rows of a band of tiles; the last band may have fewer.
    pub(super) fn band_rows(&self) -> usize {
        self.shape.rows
    }

    /// The product of one band's rows with `from`.
    pub(super) fn product<V: Summable>(&self, channel: usize, band: usize, from: &[V]) -> Vec<V> {
        let rows = self.shape.rows.min(self.rows - band * self.shape.rows);
        let band = &self.bands[band];
        let (slices, columns, weights) = (&band.slices[..], &band.columns[..], &band.weights[channel][..]);
        let sums = V::sums();
        // One entry more, for lanes without a row.
        let mut product = vec![V::default(); rows + 1];
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
        product.truncate(rows);
        product
    }

    /// `sum` with the squares of all entries added. Each row is summed from left to right, and then the rows are added
    /// to `sum` one by one, so that neither the shape, nor the number of threads, nor a cut between rows changes the bits.
    pub(super) fn squares(&self, channel: usize, sum: f64) -> f64 {
        let of_band = |(number, band): (usize, &Band)| {
            let mut sums = vec![0.0; self.shape.rows + 1];
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
            sums.truncate(self.shape.rows.min(self.rows - number * self.shape.rows));
            sums
        };
        let bands: Vec<Vec<f64>> = self.bands.par_iter().enumerate().map(of_band).collect();
        bands.iter().flatten().fold(sum, |sum, row| sum + row)
    }
}

/// Two matrices are equal when their entries are; the shape of the tiles does not count.
impl PartialEq for Tiles {
    fn eq(&self, other: &Self) -> bool {
        (self.rows, self.cols, self.entries) == (other.rows, other.cols, other.entries)
            && self.to_rows() == other.to_rows()
    }
}
