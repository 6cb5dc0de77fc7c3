//! Light of some number of bounces as a sparse matrix.

use std::sync::OnceLock;

use super::tiles::{CompressedRows, Tiles};
use crate::error::Result;
use crate::sparse::Csr;

/// How many surfaces the light of a [`Layer`] met.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Bounces {
    /// One.
    One,
    /// Two.
    Two,
    /// Three and more.
    Rest,
    /// Two and more.
    Global,
}

/// A part of the transport matrix: a sparse matrix with one set of `f32` weights per channel on a common sparsity pattern.
#[derive(Clone, Debug)]
pub struct Layer {
    bounces: Bounces,
    tiles: Tiles,
    /// Made when first asked for.
    transpose: OnceLock<Box<Layer>>,
}

/// Equal to the last bit; whether the transpose has been asked for does not count.
impl PartialEq for Layer {
    fn eq(&self, other: &Self) -> bool {
        (self.bounces, &self.tiles) == (other.bounces, &other.tiles)
    }
}

impl Layer {
    /// A layer of `cols` columns.
    pub(crate) fn new(bounces: Bounces, cols: usize, rows: &CompressedRows) -> Self {
        Self { bounces, tiles: Tiles::new(cols, rows), transpose: OnceLock::new() }
    }

    /// Which light this is.
    pub fn bounces(&self) -> Bounces {
        self.bounces
    }

    /// Stored entries.
    pub fn nonzeros(&self) -> usize {
        self.tiles.nonzeros()
    }

    /// Bytes in memory, without the transpose.
    pub fn bytes(&self) -> usize {
        self.tiles.bytes()
    }

    /// One channel as a matrix of its own.
    ///
    /// # Errors
    /// None that a layer can cause; the constructor of [`Csr`] checks its arrays.
    pub fn to_csr(&self, channel: usize) -> Result<Csr> {
        let CompressedRows { row_start, columns, weights } = self.to_rows();
        let weights = weights[channel].iter().map(|&weight| f64::from(weight)).collect();
        Csr::new(self.tiles.cols(), row_start, columns, weights)
    }

    /// All channels in compressed rows.
    pub(crate) fn to_rows(&self) -> CompressedRows {
        self.tiles.to_rows()
    }

    /// Its entries by tiles.
    pub(super) fn tiles(&self) -> &Tiles {
        &self.tiles
    }

    /// The transpose; made once, and kept beside the layer.
    pub(super) fn transpose(&self) -> &Self {
        self.transpose.get_or_init(|| Box::new(self.transposed()))
    }

    fn transposed(&self) -> Self {
        let (rows, transpose) = self.transposed_rows();
        Self::new(self.bounces, rows, &transpose)
    }

    /// How many rows there are, and all channels of the transpose in compressed rows.
    pub(super) fn transposed_rows(&self) -> (usize, CompressedRows) {
        let CompressedRows { row_start: from_start, columns: from_columns, weights: from_weights } =
            self.to_rows();
        let (rows, cols) = (from_start.len() - 1, self.tiles.cols());
        let mut row_start = vec![0; cols + 1];
        from_columns.iter().for_each(|&column| row_start[column as usize + 1] += 1);
        (0..cols).for_each(|row| row_start[row + 1] += row_start[row]);
        let mut next = row_start.clone();
        let mut columns = vec![0; from_columns.len()];
        let mut weights = vec![vec![0.0; from_columns.len()]; from_weights.len()];
        // Rows come in order, so that each row of the transpose is filled from left to right.
        for row in 0..rows {
            for entry in from_start[row]..from_start[row + 1] {
                let at = &mut next[from_columns[entry] as usize];
                columns[*at] = row as u32;
                for (to, from) in weights.iter_mut().zip(&from_weights) {
                    to[*at] = from[entry];
                }
                *at += 1;
            }
        }
        (rows, CompressedRows { row_start, columns, weights })
    }
}
