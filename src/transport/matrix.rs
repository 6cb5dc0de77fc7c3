//! The frozen light transport matrix: a sparse symmetric global part, and the direct part as its diagonal.

use rayon::prelude::*;

use crate::image::Resolution;

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

/// A matrix in compressed sparse rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Csr {
    /// `n + 1` offsets into the other two.
    pub row_start: Vec<usize>,
    /// Ascending within a row.
    pub columns: Vec<u32>,
    /// The values there.
    pub weights: Vec<f32>,
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

    /// The `part` of one channel as a matrix of its own, e.g. to be written to a file.
    pub fn to_csr(&self, part: Part, channel: usize) -> Csr {
        let pixels = self.resolution.pixels();
        let mut csr = Csr { row_start: vec![0], columns: Vec::new(), weights: Vec::new() };
        for row in 0..pixels {
            let diagonal =
                (part != Part::Global).then_some(self.direct[channel][row]).filter(|&value| value != 0.0);
            let entries =
                if part == Part::Direct { 0..0 } else { self.row_start[row]..self.row_start[row + 1] };
            let split = entries.start
                + self.columns[entries.clone()].partition_point(|&column| (column as usize) < row);
            csr.push(self, channel, entries.start..split);
            // The global part may have an entry on the diagonal as well (light that comes back to where it was sent).
            let meets = split < entries.end && self.columns[split] as usize == row;
            match (diagonal, meets) {
                (None, _) => csr.push(self, channel, split..entries.end),
                (Some(value), true) => {
                    csr.columns.push(row as u32);
                    csr.weights.push(value + self.weights[channel][split]);
                    csr.push(self, channel, split + 1..entries.end);
                }
                (Some(value), false) => {
                    csr.columns.push(row as u32);
                    csr.weights.push(value);
                    csr.push(self, channel, split..entries.end);
                }
            }
            csr.row_start.push(csr.columns.len());
        }
        csr
    }
}

impl Csr {
    fn push(&mut self, matrix: &TransportMatrix, channel: usize, entries: std::ops::Range<usize>) {
        self.columns.extend_from_slice(&matrix.columns[entries.clone()]);
        self.weights.extend_from_slice(&matrix.weights[channel][entries]);
    }

    /// Whether the matrix equals its transpose to the last bit.
    pub fn is_symmetric(&self) -> bool {
        // Columns ascend within rows, so walking the rows in order meets the entries of each column in order too: the
        // next unmatched entry of row `column` must be this one's mirror image.
        let mut next = self.row_start.clone();
        (0..self.row_start.len() - 1).all(|row| {
            (self.row_start[row]..self.row_start[row + 1]).all(|entry| {
                let column = self.columns[entry] as usize;
                let mirror = next[column];
                next[column] += 1;
                mirror < self.row_start[column + 1]
                    && self.columns[mirror] as usize == row
                    && self.weights[mirror].to_bits() == self.weights[entry].to_bits()
            })
        })
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
