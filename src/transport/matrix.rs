//! The frozen light transport matrix: a sparse symmetric global part, and the direct part as its diagonal.

use rayon::prelude::*;

use crate::error::Result;
use crate::image::Resolution;
use crate::sparse::Csr;

use super::Channels;

/// Rows that one task of a product takes.
const ROWS_PER_TASK: usize = 256;

/// Which light a product carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// All of it, `A`.
    Full,
    /// One bounce: a diagonal for a coaxial pinhole rig.
    Direct,
    /// Two bounces and more.
    Global,
}

/// `A = diag(direct) + global`, `n × n`, one set of weights per channel on a common sparsity pattern.
///
/// The global part is in compressed sparse rows with ascending columns. It is symmetric to the last bit; products
/// accumulate in `f64`, in a fixed order.
#[derive(Clone, Debug, PartialEq)]
pub struct TransportMatrix {
    pub(super) resolution: Resolution,
    pub(super) channels: Channels,
    /// `n + 1` offsets into `columns`.
    pub(super) row_start: Vec<usize>,
    pub(super) columns: Vec<u32>,
    /// `[channel][entry]`
    pub(super) weights: Vec<Vec<f32>>,
    /// `[channel][pixel]`
    pub(super) direct: Vec<Vec<f32>>,
}

impl TransportMatrix {
    /// Pixels of camera and projector; the matrix has as many rows and columns.
    pub fn resolution(&self) -> Resolution {
        self.resolution
    }

    /// One or three systems.
    pub fn channels(&self) -> Channels {
        self.channels
    }

    /// Stored entries of the global part.
    pub fn nonzeros(&self) -> usize {
        self.columns.len()
    }

    /// Bytes that the matrix takes in memory.
    pub fn bytes(&self) -> usize {
        let weights = self.weights.iter().chain(&self.direct).map(|plane| 4 * plane.len()).sum::<usize>();
        size_of::<usize>() * self.row_start.len() + 4 * self.columns.len() + weights
    }

    /// The direct part of `channel`: its diagonal, `n` values.
    pub fn direct(&self, channel: usize) -> &[f32] {
        &self.direct[channel]
    }

    /// `y ← P x` for the `part` `P` of one channel; `x` may be signed. Both have `n` entries.
    pub fn apply(&self, part: Part, channel: usize, x: &[f64], y: &mut [f64]) {
        let pixels = self.resolution.pixels();
        assert_eq!((x.len(), y.len()), (pixels, pixels), "a product needs vectors of n entries");
        let direct = &self.direct[channel];
        let weights = &self.weights[channel];
        y.par_chunks_mut(ROWS_PER_TASK).enumerate().for_each(|(task, rows)| {
            for (row, value) in (task * ROWS_PER_TASK..).zip(rows) {
                let entries = self.row_start[row]..self.row_start[row + 1];
                *value = match part {
                    Part::Direct => f64::from(direct[row]) * x[row],
                    Part::Global => gather(&self.columns[entries.clone()], &weights[entries], x),
                    Part::Full => {
                        f64::from(direct[row]) * x[row]
                            + gather(&self.columns[entries.clone()], &weights[entries], x)
                    }
                };
            }
        });
    }

    /// The `part` of one channel as a matrix of its own, e.g. to be written to a file. The diagonal of the full matrix
    /// is the rounded sum of both parts'.
    ///
    /// # Errors
    /// None that this matrix can cause; the constructor of [`Csr`] checks its arrays.
    pub fn to_csr(&self, part: Part, channel: usize) -> Result<Csr> {
        let pixels = self.resolution.pixels();
        let (direct, weights) = (&self.direct[channel], &self.weights[channel]);
        let mut row_start = vec![0];
        let mut entries: Vec<(u32, f32)> = Vec::new();
        for (row, &diagonal) in direct.iter().enumerate() {
            if part != Part::Direct {
                let global = self.row_start[row]..self.row_start[row + 1];
                entries.extend(
                    self.columns[global.clone()].iter().copied().zip(weights[global].iter().copied()),
                );
            }
            if part != Part::Global && diagonal != 0.0 {
                let own = *row_start.last().unwrap_or(&0);
                // The global part may have an entry there as well: light that comes back to where it was sent.
                match entries[own..].binary_search_by_key(&(row as u32), |entry| entry.0) {
                    Ok(at) => entries[own + at].1 += diagonal,
                    Err(at) => entries.insert(own + at, (row as u32, diagonal)),
                }
            }
            row_start.push(entries.len());
        }
        let columns = entries.iter().map(|entry| entry.0).collect();
        Csr::new(pixels, row_start, columns, entries.iter().map(|entry| f64::from(entry.1)).collect())
    }
}

/// `Σ weight · x[column]`. Four accumulators, added in a fixed order, hide the latency of the additions.
fn gather(columns: &[u32], weights: &[f32], x: &[f64]) -> f64 {
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
