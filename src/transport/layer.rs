//! The light of a given number of bounces as a sparse matrix.

use std::sync::OnceLock;

use super::tiles::{CompressedRows, Entries, Tiles};
use crate::error::Result;
use crate::sparse::Csr;

/// How many times the light of a [`Layer`] was reflected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Bounces {
    /// One bounce.
    One,
    /// Two bounces.
    Two,
    /// Three and more bounces.
    Rest,
    /// Two and more bounces.
    Global,
}

/// A part of the transport matrix: a sparse matrix with one set of `f32` weights per channel on a common
/// sparsity pattern.
#[derive(Clone, Debug)]
pub struct Layer {
    bounces: Bounces,
    tiles: Tiles,
    /// Computed when first needed.
    transpose: OnceLock<Box<Layer>>,
}

/// Two layers are equal when their entries are, to the last bit; whether the transpose was computed does not
/// count.
impl PartialEq for Layer {
    fn eq(&self, other: &Self) -> bool {
        (self.bounces, &self.tiles) == (other.bounces, &other.tiles)
    }
}

/// The square of an entry.
pub(super) fn square(value: f32) -> f64 {
    f64::from(value) * f64::from(value)
}

impl Layer {
    /// A layer of `cols` columns. Its rows are those of `pieces`, one after the other.
    pub(crate) fn new(bounces: Bounces, cols: usize, pieces: Vec<CompressedRows>) -> Self {
        Self::of_tiles(bounces, Tiles::new(cols, pieces))
    }

    /// A symmetric layer. Its rows on and above the diagonal are those of `pieces`, one after the other.
    pub(crate) fn symmetric(bounces: Bounces, pieces: Vec<CompressedRows>) -> Self {
        Self::of_tiles(bounces, Tiles::symmetric(pieces))
    }

    pub(super) fn of_tiles(bounces: Bounces, tiles: Tiles) -> Self {
        Self { bounces, tiles, transpose: OnceLock::new() }
    }

    /// The bounces of this light.
    pub fn bounces(&self) -> Bounces {
        self.bounces
    }

    /// The number of stored entries.
    pub fn nonzeros(&self) -> usize {
        self.tiles.nonzeros()
    }

    /// Bytes in memory, without the transpose.
    pub fn bytes(&self) -> usize {
        self.tiles.bytes()
    }

    /// One channel as a compressed sparse matrix.
    ///
    /// # Errors
    /// None for a valid layer; the constructor of [`Csr`] checks its arrays.
    pub fn to_csr(&self, channel: usize) -> Result<Csr> {
        let CompressedRows { row_start, columns, weights } = self.to_rows();
        let weights = weights[channel].iter().map(|&weight| f64::from(weight)).collect();
        Csr::new(self.tiles.cols(), row_start, columns, weights)
    }

    /// All channels in compressed rows.
    pub(crate) fn to_rows(&self) -> CompressedRows {
        self.tiles.to_rows()
    }

    /// The offset of each row into these entries, then their number.
    pub(crate) fn row_start(&self, which: Entries) -> Vec<usize> {
        self.tiles.row_start(which)
    }

    /// The columns of these entries, row by row, as several pieces. `row_start` is theirs.
    pub(crate) fn columns<'a>(
        &'a self,
        which: Entries,
        row_start: &'a [usize],
    ) -> impl Iterator<Item = Vec<u32>> + 'a {
        self.tiles.columns(which, row_start)
    }

    /// The weights of one channel, as [`Layer::columns`].
    pub(crate) fn weights<'a>(
        &'a self,
        which: Entries,
        channel: usize,
        row_start: &'a [usize],
    ) -> impl Iterator<Item = Vec<f32>> + 'a {
        self.tiles.weights(which, channel, row_start)
    }

    /// `sum` with the squares of the entries of one channel added: each row is summed from left to right, and then the rows.
    pub(super) fn squares(&self, channel: usize, sum: f64) -> f64 {
        self.tiles.squares(channel, sum)
    }

    /// Its entries in tiles.
    pub(super) fn tiles(&self) -> &Tiles {
        &self.tiles
    }

    /// The transpose; computed once, and kept with the layer.
    pub(super) fn transpose(&self) -> &Self {
        self.transpose.get_or_init(|| {
            let rows = self.to_rows();
            let transpose = rows.transposed(&(0..self.tiles.cols()), 0);
            Box::new(Self::new(self.bounces, rows.rows(), vec![transpose]))
        })
    }

    /// Keeps the rows of the transpose that this process has, where a matrix is spread over several processes.
    pub(super) fn keep_transpose(&self, transpose: Self) {
        // Where there is one already, it is the same.
        let _ = self.transpose.set(Box::new(transpose));
    }
}
