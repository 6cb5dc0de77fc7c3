//! A layer in the device's memory: its rows in bands, each small enough for its buffers and for one dispatch.

use std::ops::Range;

use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::transport::CompressedRows;

/// Entries that one dispatch takes on a GPU: a gigabyte of them, which even a slow one reads in a tenth of a second.
const ENTRIES: usize = 1 << 27;

/// The same where the device is the processor itself, at a tenth of whose speed it goes.
const ENTRIES_ON_PROCESSOR: usize = 1 << 22;

/// Entries of a row at most. 32 lanes share them, and software Vulkan leaves a loop after 65,535 turns, without a word.
const LONGEST_ROW: usize = 1 << 20;

/// A layer's bands, top to bottom.
pub(super) struct DeviceLayer {
    /// Of its light: 1, or 2 for two and more.
    pub(super) bounces: u32,
    pub(super) bands: Vec<Band>,
}

/// Rows in compressed form, in buffers of their own.
pub(super) struct Band {
    pub(super) rows: Range<u32>,
    pub(super) starts: wgpu::Buffer,
    pub(super) columns: wgpu::Buffer,
    /// One for each channel.
    pub(super) weights: Vec<wgpu::Buffer>,
}

/// Entries of a band at most.
pub(super) fn most_entries(gpu: &Gpu) -> usize {
    let wish = if gpu.summary.is_processor() { ENTRIES_ON_PROCESSOR } else { ENTRIES };
    let room = gpu.summary.max_storage_binding.min(gpu.summary.max_buffer) / 4;
    wish.min(usize::try_from(room).unwrap_or(usize::MAX))
}

impl DeviceLayer {
    /// Moves the rows there, in bands of so many entries at most.
    pub(super) fn upload(gpu: &Gpu, bounces: u32, from: &CompressedRows, most: usize) -> Result<Self> {
        let CompressedRows { row_start, columns, weights } = from;
        let longest = row_start.windows(2).map(|ends| ends[1] - ends[0]).max().unwrap_or(0);
        if longest > LONGEST_ROW {
            return Err(Error::Device {
                fault: format!("a row of the matrix has {longest} entries, and {LONGEST_ROW} is the most"),
                help: "leave the products to the processor: --products cpu".into(),
            });
        }
        let band = |rows: Range<usize>| {
            let entries = row_start[rows.start]..row_start[rows.end];
            // A band's entries fit a buffer, whose length fits 32 bits as do pixels.
            let starts: Vec<u32> =
                row_start[rows.start..=rows.end].iter().map(|start| (start - entries.start) as u32).collect();
            let weights = weights.iter().map(|plane| gpu.upload("matrix's weights", &plane[entries.clone()]));
            Ok(Band {
                rows: rows.start as u32..rows.end as u32,
                starts: gpu.upload("matrix's rows", &starts)?,
                columns: gpu.upload("matrix's columns", &columns[entries.clone()])?,
                weights: weights.collect::<Result<_>>()?,
            })
        };
        let bands = cut(row_start, most).into_iter().map(band).collect::<Result<_>>()?;
        Ok(Self { bounces, bands })
    }
}

/// Whole rows, as many to a band as have at most so many entries together; at least one.
fn cut(row_start: &[usize], most: usize) -> Vec<Range<usize>> {
    let rows = row_start.len() - 1;
    let mut bands = Vec::new();
    let mut first = 0;
    while first < rows {
        let fit = row_start[first + 1..].partition_point(|end| end - row_start[first] <= most);
        bands.push(first..first + fit.max(1));
        first += fit.max(1);
    }
    bands
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_have_whole_rows_and_as_many_as_fit() {
        let row_start = [0, 2, 2, 5, 14, 15, 16];
        assert_eq!(cut(&row_start, 5), [0..3, 3..4, 4..6]);
        assert_eq!(cut(&row_start, 1), [0..1, 1..2, 2..3, 3..4, 4..5, 5..6]);
        assert_eq!(cut(&row_start, 100), vec![0..6]);
        assert_eq!(cut(&[0, 0, 0], 3), vec![0..2], "rows without entries are rows");
    }
}
