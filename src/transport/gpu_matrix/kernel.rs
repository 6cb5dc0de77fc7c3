//! The kernel that computes products, and its dispatches. A layer is divided into bands that fit the device's buffers and one dispatch.

use std::ops::Range;

use super::layer::Band;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::pipeline::{self, READ, Step, WRITE};

#[derive(Clone, Copy)]
pub(in crate::transport) struct Limits {
    pub(in crate::transport) entries: usize,
    pub(in crate::transport) rows: usize,
}

/// The limits of a dispatch on a GPU. 2²⁷ entries take a gigabyte, which even a slow GPU reads in a tenth of a second.
const ON_GPU: Limits = Limits { entries: 1 << 27, rows: 1 << 24 };

/// The limits of a dispatch on software Vulkan. Two cores take some 50 ms for this many entries, or for this many rows (measured).
pub(super) const ON_PROCESSOR: Limits = Limits { entries: 1 << 22, rows: 1 << 15 };

impl Limits {
    pub(in crate::transport) fn of(gpu: &Gpu) -> Self {
        let Self { entries, rows } = if gpu.summary.is_processor() { ON_PROCESSOR } else { ON_GPU };
        let room = gpu.summary.max_storage_binding.min(gpu.summary.max_buffer) / 4;
        Self { entries: entries.min(usize::try_from(room).unwrap_or(usize::MAX)), rows }
    }
}

/// Divides the rows into bands of whole rows. Each band has as many rows as the limits allow, and at least one.
pub(in crate::transport) fn cut(row_start: &[usize], limits: Limits) -> Vec<Range<usize>> {
    let rows = row_start.len() - 1;
    let mut bands = Vec::new();
    let mut first = 0;
    while first < rows {
        let next = &row_start[first + 1..=rows.min(first.saturating_add(limits.rows))];
        let fit = next.partition_point(|end| end - row_start[first] <= limits.entries);
        bands.push(first..first + fit.max(1));
        first += fit.max(1);
    }
    bands
}

/// The rows of a workgroup; `ROWS_OF_GROUP` of `shaders/product.wgsl`.
const ROWS_OF_GROUP: u32 = 2;

/// The flag for a band with entries; `HAS_ENTRIES` of `shaders/product.wgsl`.
const HAS_ENTRIES: u32 = 1;

/// The uniform of a dispatch, with the layout of `Band` in `shaders/product.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Parameters {
    first_row: u32,
    rows: u32,
    terms: u32,
    padding: u32,
}

/// The terms that are added to the sum over a row's entries. They are flags of `shaders/product.wgsl`.
#[derive(Clone, Copy)]
pub(super) struct Terms {
    pub(super) diagonal: bool,
    /// Whether to add the sum that earlier bands have written to the photo.
    pub(super) adds: bool,
}

#[derive(Clone)]
pub(super) struct Kernel {
    kernel: pipeline::Kernel,
    /// A placeholder for buffers that a dispatch does not read.
    nothing: wgpu::Buffer,
}

impl Kernel {
    pub(super) fn new(gpu: &Gpu) -> Result<Self> {
        let buffers = [READ, READ, READ, READ, READ, WRITE];
        let [kernel] = pipeline::Kernel::all(gpu, "product", ["product"], &[], &buffers, |source| {
            gpu.module("product", source)
        })?;
        Ok(Self { kernel, nothing: gpu.storage("nothing", &[0.0_f32])? })
    }

    /// The dispatch that writes the sums of these rows to the photo. A sum adds the products of a band's entries in one channel, if `band`
    /// is given, and the terms that `terms` selects. The last argument consists of the diagonal, the pattern and the photo.
    pub(super) fn step(
        &self,
        gpu: &Gpu,
        rows: Range<u32>,
        band: Option<(&Band, usize)>,
        terms: Terms,
        [diagonal, from, to]: [&wgpu::Buffer; 3],
    ) -> Result<Step> {
        let ([starts, columns, weights], entries) = match band {
            Some((band, channel)) => ([&band.starts, &band.columns, &band.weights[channel]], HAS_ENTRIES),
            None => ([&self.nothing; 3], 0),
        };
        let count = rows.end - rows.start;
        let terms = entries | bits(terms);
        let parameters = Parameters { first_row: rows.start, rows: count, terms, padding: 0 };
        let buffers = [starts, columns, weights, diagonal, from, to];
        self.kernel.step(gpu, &parameters, &buffers, count.div_ceil(ROWS_OF_GROUP))
    }
}

fn bits(terms: Terms) -> u32 {
    u32::from(terms.diagonal) << 1 | u32::from(terms.adds) << 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::{assert_constant, assert_layout};

    #[test]
    fn bands_lie_as_the_shader_reads_them() {
        assert_layout!("product", "Band", Parameters: first_row, rows, terms, padding);
        assert_constant("product", "ROWS_OF_GROUP", ROWS_OF_GROUP);
        let (diagonal, adds) = (Terms { diagonal: true, adds: false }, Terms { diagonal: false, adds: true });
        assert_constant("product", "HAS_ENTRIES", HAS_ENTRIES);
        assert_constant("product", "HAS_DIAGONAL", bits(diagonal));
        assert_constant("product", "ADDS", bits(adds));
    }

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
        let gpu = Gpu::for_tests();
        let limits = |kind: &str, max_buffer, max_storage_binding| {
            let mut gpu = gpu.clone();
            (gpu.summary.kind, gpu.summary.max_buffer) = (kind.into(), max_buffer);
            gpu.summary.max_storage_binding = max_storage_binding;
            let Limits { entries, rows } = Limits::of(&gpu);
            [entries, rows]
        };
        let (many, card) = (u64::from(u32::MAX), "discrete GPU");
        // The limit is the buffer size; an entry takes four bytes in a buffer.
        assert_eq!(limits(card, 4004, many)[0], 1001);
        assert_eq!(limits(card, many, 4004)[0], 1001);
        assert_eq!(limits(card, many, many), [1 << 27, 1 << 24]);
        assert_eq!(
            limits("software", many, many),
            [1 << 22, 1 << 15],
            "software Vulkan has smaller dispatches"
        );
    }
}
