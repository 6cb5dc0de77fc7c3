//! A sparse matrix cut into tiles, so that the vectors of a product stay in the processor's caches and the
//! entries are read at the speed of memory.
//!
//! Within a tile, eight rows of about equally many entries form a *slice* (the format is known as sliced
//! ELLPACK). The eight sums are computed at the same time, each with the entries of one row from left to
//! right. So a product has the same bits whatever the tiles' shape, the number of threads and the
//! instructions used.

mod build;
#[cfg(target_arch = "x86_64")]
mod gather;
mod pages;
mod rows;
mod shape;
mod slice;
mod sums;
#[cfg(test)]
mod tests;
mod value;

use rayon::prelude::*;

pub(super) use build::take;
use pages::Pages;
pub(crate) use rows::CompressedRows;
use rows::Pieces;
use shape::Shape;
use slice::{LANES, Slice};
pub(super) use sums::Summable;
pub(super) use value::{BLOCK_WIDTH, Interleaved};

/// A sparse matrix in tiles, with one set of `f32` weights per channel on a common sparsity pattern.
#[derive(Clone, Debug)]
pub(super) struct Tiles {
    rows: usize,
    cols: usize,
    entries: usize,
    shape: Shape,
    /// Where each tile begins, from left to right and then downwards, and the end of the last.
    tiles: Vec<Start>,
    slices: Vec<Slice>,
    /// Columns within the tile, ascending in each row. A repeated column is padding of the slice and has
    /// weight 0.
    columns: Pages<[u16; LANES]>,
    /// `[channel][step][lane]`
    weights: Vec<Pages<[f32; LANES]>>,
}

/// Where a tile begins.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Start {
    slice: usize,
    step: usize,
}

impl Tiles {
    pub(super) fn cols(&self) -> usize {
        self.cols
    }

    pub(super) fn nonzeros(&self) -> usize {
        self.entries
    }

    pub(super) fn bytes(&self) -> usize {
        let weights: usize = self.weights.iter().map(|plane| size_of_val(&plane[..])).sum();
        size_of_val(self.tiles.as_slice())
            + size_of_val(self.slices.as_slice())
            + size_of_val(&self.columns[..])
            + weights
    }

    /// Rows of a band of tiles; the last band may have fewer.
    pub(super) fn band_rows(&self) -> usize {
        self.shape.rows
    }

    /// The product of one band's rows with `from`.
    pub(super) fn product<V: Summable>(&self, channel: usize, band: usize, from: &[V]) -> Vec<V> {
        let across = self.cols.div_ceil(self.shape.columns);
        let starts = &self.tiles[band * across..=(band + 1) * across];
        let weights = &self.weights[channel];
        let rows = self.shape.rows.min(self.rows - band * self.shape.rows);
        let sums = V::sums();
        // One entry more, for lanes without a row.
        let mut product = vec![V::default(); rows + 1];
        for (ends, from) in starts.windows(2).zip(from.chunks(self.shape.columns)) {
            let [start, end] = [ends[0], ends[1]];
            sums.add(
                &self.slices[start.slice..end.slice],
                &self.columns[start.step..end.step],
                &weights[start.step..end.step],
                from,
                &mut product,
            );
        }
        product.truncate(rows);
        product
    }
}

impl Tiles {
    /// `sum` with the squares of all entries added. Each row is summed from left to right, and then the rows are added
    /// to `sum` one by one, so that neither the shape, nor the number of threads, nor a cut between rows changes the bits.
    pub(super) fn squares(&self, channel: usize, sum: f64) -> f64 {
        let across = self.cols.div_ceil(self.shape.columns);
        let bands: Vec<Vec<f64>> = (0..self.rows.div_ceil(self.shape.rows))
            .into_par_iter()
            .map(|band| {
                let mut sums = vec![0.0; self.shape.rows + 1];
                let [start, end] = [self.tiles[band * across], self.tiles[(band + 1) * across]];
                let mut step = start.step;
                for slice in &self.slices[start.slice..end.slice] {
                    let steps = step..step + slice.steps as usize;
                    step = steps.end;
                    let mut of_lanes = slice.rows.map(|row| sums[usize::from(row)]);
                    for weights in &self.weights[channel][steps] {
                        of_lanes
                            .iter_mut()
                            .zip(weights)
                            .for_each(|(sum, &weight)| *sum += f64::from(weight).powi(2));
                    }
                    slice.rows.iter().zip(of_lanes).for_each(|(&row, sum)| sums[usize::from(row)] = sum);
                }
                sums.truncate(self.shape.rows.min(self.rows - band * self.shape.rows));
                sums
            })
            .collect();
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
