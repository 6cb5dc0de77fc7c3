//! A layer in the device's memory. Its rows are cut into bands, each small enough for the device's buffers
//! and for one dispatch.

use std::ops::Range;

use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::transport::{Bounces, CompressedRows};

/// The limits of one dispatch.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    pub(super) entries: usize,
    pub(super) rows: usize,
}

/// A gigabyte of entries, which even a slow GPU reads in a tenth of a second.
const ON_GPU: Limits = Limits { entries: 1 << 27, rows: 1 << 24 };

/// The limits for software Vulkan: either of them takes two cores some 50 ms (measured).
const ON_PROCESSOR: Limits = Limits { entries: 1 << 22, rows: 1 << 15 };

impl Limits {
    /// The limits for a device, with those of its buffers.
    pub(super) fn of(gpu: &Gpu) -> Self {
        let Self { entries, rows } = if gpu.summary.is_processor() { ON_PROCESSOR } else { ON_GPU };
        let room = gpu.summary.max_storage_binding.min(gpu.summary.max_buffer) / 4;
        Self { entries: entries.min(usize::try_from(room).unwrap_or(usize::MAX)), rows }
    }
}

/// Most entries of a row. 32 lanes share them, and software Vulkan leaves a loop after 65,535 iterations
/// without an error.
const LONGEST_ROW: usize = 1 << 20;

/// A layer's bands, top to bottom.
pub(super) struct DeviceLayer {
    pub(super) bounces: Bounces,
    pub(super) bands: Vec<Band>,
}

/// Rows of a band in compressed form, in buffers of their own.
pub(super) struct Band {
    pub(super) rows: Range<u32>,
    pub(super) starts: wgpu::Buffer,
    pub(super) columns: wgpu::Buffer,
    /// One buffer for each channel.
    pub(super) weights: Vec<wgpu::Buffer>,
}

impl DeviceLayer {
    /// Copies the rows to the device, in bands within `limits`.
    pub(super) fn upload(gpu: &Gpu, bounces: Bounces, from: &CompressedRows, limits: Limits) -> Result<Self> {
        let CompressedRows { row_start, columns, weights } = from;
        let longest = row_start.windows(2).map(|ends| ends[1] - ends[0]).max().unwrap_or(0);
        if longest > LONGEST_ROW {
            return Err(Error::Device {
                fault: format!(
                    "a row of the matrix has {longest} entries, and a GPU can sum at most {LONGEST_ROW}"
                ),
                help: "take the products on the processor: --products cpu".into(),
            });
        }
        let band = |rows: Range<usize>| {
            let entries = row_start[rows.start]..row_start[rows.end];
            // A band's entries fit a buffer, whose length fits 32 bits.
            let starts: Vec<u32> =
                row_start[rows.start..=rows.end].iter().map(|start| (start - entries.start) as u32).collect();
            let weights =
                weights.iter().map(|plane| gpu.storage("matrix's weights", &plane[entries.clone()]));
            Ok(Band {
                rows: rows.start as u32..rows.end as u32,
                starts: gpu.storage("matrix's rows", &starts)?,
                columns: gpu.storage("matrix's columns", &columns[entries.clone()])?,
                weights: weights.collect::<Result<_>>()?,
            })
        };
        let bands = cut(row_start, limits).into_iter().map(band).collect::<Result<_>>()?;
        Ok(Self { bounces, bands })
    }
}

/// Cuts the rows into bands of whole rows, each with as many rows as the limits allow, and at least one.
fn cut(row_start: &[usize], limits: Limits) -> Vec<Range<usize>> {
    let rows = row_start.len() - 1;
    let mut bands = Vec::new();
    let mut first = 0;
    while first < rows {
        let next = &row_start[first + 1..=rows.min(first + limits.rows)];
        let fit = next.partition_point(|end| end - row_start[first] <= limits.entries);
        bands.push(first..first + fit.max(1));
        first += fit.max(1);
    }
    bands
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_have_as_many_whole_rows_as_fit() {
        let row_start = [0, 2, 2, 5, 14, 15, 16];
        let cut = |entries, rows| cut(&row_start, Limits { entries, rows });
        assert_eq!(cut(5, 9), [0..3, 3..4, 4..6]);
        assert_eq!(cut(1, 9), [0..1, 1..2, 2..3, 3..4, 4..5, 5..6]);
        assert_eq!(cut(100, 9), vec![0..6]);
        assert_eq!(cut(100, 4), [0..4, 4..6]);
        assert_eq!(cut(5, 2), [0..2, 2..3, 3..4, 4..6], "rows without entries count");
    }

    #[test]
    fn buffers_of_a_device_limit_the_entries_of_a_band() {
        let gpu = super::super::tests::gpu();
        let limits = |kind: &str, max_buffer, max_storage_binding| {
            let mut gpu = gpu.clone();
            (gpu.summary.kind, gpu.summary.max_buffer) = (kind.into(), max_buffer);
            gpu.summary.max_storage_binding = max_storage_binding;
            let Limits { entries, rows } = Limits::of(&gpu);
            [entries, rows]
        };
        let (many, card) = (u64::from(u32::MAX), "discrete GPU");
        // Four bytes of an entry in one buffer.
        assert_eq!(limits(card, 4004, many)[0], 1001);
        assert_eq!(limits(card, many, 4004)[0], 1001);
        assert_eq!(limits(card, many, many), [1 << 27, 1 << 24]);
        assert_eq!(
            limits(&gpu.summary.kind, many, many),
            [1 << 22, 1 << 15],
            "software Vulkan has smaller dispatches"
        );
    }

    #[test]
    fn a_row_has_as_many_entries_as_a_device_can_sum() {
        let gpu = super::super::tests::gpu();
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
