//! Light of some number of bounces as a sparse matrix.

use std::sync::OnceLock;

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

/// A part of the transport matrix in compressed sparse rows, columns ascending: one set of `f32` weights per channel on a
/// common sparsity pattern.
#[derive(Clone, Debug)]
pub struct Layer {
    pub(crate) bounces: Bounces,
    pub(crate) cols: usize,
    /// One offset into `columns` for each row, and their number last.
    pub(crate) row_start: Vec<usize>,
    pub(crate) columns: Vec<u32>,
    /// `[channel][entry]`
    pub(crate) weights: Vec<Vec<f32>>,
    /// Made when first asked for.
    transpose: OnceLock<Box<Layer>>,
}

/// Equal to the last bit; whether the transpose has been asked for does not count.
impl PartialEq for Layer {
    fn eq(&self, other: &Self) -> bool {
        (self.bounces, self.cols) == (other.bounces, other.cols)
            && self.row_start == other.row_start
            && self.columns == other.columns
            && self.weights == other.weights
    }
}

impl Layer {
    pub(crate) fn new(
        bounces: Bounces,
        cols: usize,
        row_start: Vec<usize>,
        columns: Vec<u32>,
        weights: Vec<Vec<f32>>,
    ) -> Self {
        Self { bounces, cols, row_start, columns, weights, transpose: OnceLock::new() }
    }

    /// Which light this is.
    pub fn bounces(&self) -> Bounces {
        self.bounces
    }

    /// Stored entries.
    pub fn nonzeros(&self) -> usize {
        self.columns.len()
    }

    /// Bytes in memory, without the transpose.
    pub fn bytes(&self) -> usize {
        let weights = self.weights.iter().map(|plane| 4 * plane.len()).sum::<usize>();
        size_of::<usize>() * self.row_start.len() + 4 * self.columns.len() + weights
    }

    /// One channel as a matrix of its own.
    ///
    /// # Errors
    /// None that a layer can cause; the constructor of [`Csr`] checks its arrays.
    pub fn to_csr(&self, channel: usize) -> Result<Csr> {
        let weights = self.weights[channel].iter().map(|&weight| f64::from(weight)).collect();
        Csr::new(self.cols, self.row_start.clone(), self.columns.clone(), weights)
    }

    /// Columns and weights of one row.
    pub(super) fn row(&self, channel: usize, row: usize) -> (&[u32], &[f32]) {
        let entries = self.row_start[row]..self.row_start[row + 1];
        (&self.columns[entries.clone()], &self.weights[channel][entries])
    }

    /// `Σ weight · x[column]` over a row. Four accumulators, added in a fixed order, hide the latency of the additions.
    pub(super) fn gather(&self, channel: usize, row: usize, x: &[f64]) -> f64 {
        let (columns, weights) = self.row(channel, row);
        let mut sums = [0.0; 4];
        let (column_blocks, weight_blocks) = (columns.chunks_exact(4), weights.chunks_exact(4));
        let rest = column_blocks.remainder().iter().zip(weight_blocks.remainder());
        for (columns, weights) in column_blocks.zip(weight_blocks) {
            for lane in 0..4 {
                sums[lane] += f64::from(weights[lane]) * x[columns[lane] as usize];
            }
        }
        let tail: f64 = rest.map(|(&column, &weight)| f64::from(weight) * x[column as usize]).sum();
        (sums[0] + sums[1]) + (sums[2] + sums[3]) + tail
    }

    /// The transpose; made once, and kept beside the layer.
    pub(super) fn transpose(&self) -> &Self {
        self.transpose.get_or_init(|| Box::new(self.transposed()))
    }

    fn transposed(&self) -> Self {
        let rows = self.row_start.len() - 1;
        let mut row_start = vec![0; self.cols + 1];
        self.columns.iter().for_each(|&column| row_start[column as usize + 1] += 1);
        (0..self.cols).for_each(|row| row_start[row + 1] += row_start[row]);
        let mut next = row_start.clone();
        let mut columns = vec![0; self.columns.len()];
        let mut weights = vec![vec![0.0; self.columns.len()]; self.weights.len()];
        // Rows come in order, so that each row of the transpose is filled from left to right.
        for row in 0..rows {
            for entry in self.row_start[row]..self.row_start[row + 1] {
                let at = &mut next[self.columns[entry] as usize];
                columns[*at] = row as u32;
                for (to, from) in weights.iter_mut().zip(&self.weights) {
                    to[*at] = from[entry];
                }
                *at += 1;
            }
        }
        Self::new(self.bounces, rows, row_start, columns, weights)
    }
}
