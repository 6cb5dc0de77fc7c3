//! A layer in a device's memory, in bands of rows that fit the device's buffers. It was uploaded, or the device has made it.

use std::fmt;
use std::ops::Range;

use super::kernel::{Limits, cut};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::transport::tiles::Tiles;
use crate::transport::{Bounces, CompressedRows};

/// The maximum number of entries of a row. 32 lanes share a row, and software Vulkan leaves a loop after 65,535 iterations without an
/// error.
const LONGEST_ROW: usize = 1 << 20;

pub(in crate::transport) struct DeviceLayer {
    gpu: Gpu,
    pub(in crate::transport) bounces: Bounces,
    /// The numbers of rows and columns.
    shape: [usize; 2],
    channels: usize,
    pub(in crate::transport) entries: usize,
    /// The squares of all weights of each channel, if the device has made the layer.
    pub(in crate::transport) squares: Vec<f64>,
    pub(super) bands: Vec<Band>,
}

pub(in crate::transport) struct Band {
    pub(in crate::transport) rows: Range<u32>,
    pub(in crate::transport) starts: wgpu::Buffer,
    pub(in crate::transport) columns: wgpu::Buffer,
    pub(in crate::transport) weights: Vec<wgpu::Buffer>,
}

impl fmt::Debug for DeviceLayer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DeviceLayer").field("bounces", &self.bounces).finish_non_exhaustive()
    }
}

impl DeviceLayer {
    /// A layer without rows, to which the bands of `shape` are pushed.
    pub(in crate::transport) fn empty(
        gpu: &Gpu,
        bounces: Bounces,
        shape: [usize; 2],
        channels: usize,
    ) -> Self {
        let (gpu, squares) = (gpu.clone(), vec![0.0; channels]);
        Self { gpu, bounces, shape, channels, entries: 0, squares, bands: Vec::new() }
    }

    /// Appends the next rows, with this number of entries.
    pub(in crate::transport) fn push(&mut self, band: Band, entries: usize) {
        self.bands.push(band);
        self.entries += entries;
    }

    pub(super) fn upload(
        gpu: &Gpu,
        bounces: Bounces,
        source: &CompressedRows,
        limits: Limits,
    ) -> Result<Self> {
        let CompressedRows { row_start, columns, weights } = source;
        let longest = row_start.windows(2).map(|ends| ends[1] - ends[0]).max().unwrap_or(0);
        if longest > LONGEST_ROW {
            return Err(Error::device(format!(
                "a row of the matrix has {longest} entries, and a GPU can sum at most {LONGEST_ROW}"
            ))
            .help("take the products on the processor: --products cpu"));
        }
        let mut layer = Self::empty(gpu, bounces, [source.rows(), 0], weights.len());
        for rows in cut(row_start, limits) {
            let entries = row_start[rows.start]..row_start[rows.end];
            // The entries of a band fit into a buffer, and their number fits into 32 bits.
            let starts: Vec<u32> =
                row_start[rows.start..=rows.end].iter().map(|start| (start - entries.start) as u32).collect();
            let weights =
                weights.iter().map(|plane| gpu.storage("matrix's weights", &plane[entries.clone()]));
            let band = Band {
                rows: rows.start as u32..rows.end as u32,
                starts: gpu.storage("matrix's rows", &starts)?,
                columns: gpu.storage("matrix's columns", &columns[entries.clone()])?,
                weights: weights.collect::<Result<_>>()?,
            };
            layer.push(band, entries.len());
        }
        Ok(layer)
    }

    /// The size in the device's memory in bytes.
    pub(in crate::transport) fn bytes(&self) -> usize {
        4 * (self.entries * (1 + self.channels) + self.shape[0] + self.bands.len())
    }

    /// Reads the entries of a layer that the device has made.
    pub(in crate::transport) fn tiles(&self) -> Result<Tiles> {
        let piece = |band: &Band| {
            let starts = self.gpu.read::<u32>(&band.starts, band.rows.len() + 1)?;
            let row_start: Vec<usize> = starts.into_iter().map(|start| start as usize).collect();
            let entries = row_start.last().copied().unwrap_or(0);
            let columns = self.gpu.read::<u32>(&band.columns, entries)?;
            let weights = band.weights.iter().map(|plane| self.gpu.read::<f32>(plane, entries));
            Ok(CompressedRows { row_start, columns, weights: weights.collect::<Result<_>>()? })
        };
        Ok(Tiles::new(self.shape[1], self.bands.iter().map(piece).collect::<Result<_>>()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::gpu_matrix::kernel::ON_PROCESSOR;

    #[test]
    fn a_row_has_as_many_entries_as_a_device_can_sum() {
        let gpu = Gpu::for_tests();
        let upload = |entries: usize| {
            let columns = (0..entries as u32).collect();
            let rows =
                CompressedRows { row_start: vec![0, 1, entries], columns, weights: vec![vec![1.0; entries]] };
            DeviceLayer::upload(&gpu, Bounces::Global, &rows, ON_PROCESSOR).map(|layer| layer.bands.len())
        };
        assert_eq!(upload(LONGEST_ROW + 1).expect("the longest row fits"), 1);
        let error = upload(LONGEST_ROW + 2).expect_err("the row is too long").to_string();
        assert!(error.contains("1048577 entries") && error.contains("--products cpu"), "{error}");
    }
}
