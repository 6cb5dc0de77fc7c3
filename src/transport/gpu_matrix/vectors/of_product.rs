//! The pattern and the photo of a product with vectors in a device's memory.

use wgpu::BufferUsages;

use super::{DeviceVectors, INVOCATIONS, Part, kernels};
use crate::error::Result;
use crate::gpu::pipeline::{Kernel, Step};
use crate::operator::Selection;

/// The pattern and the photo of the last product (`pixels` entries each), and the dispatches that write the entries of a selection to the
/// pattern and read them from the photo.
pub(super) struct OfProduct {
    pub(super) pattern: wgpu::Buffer,
    pub(super) photo: wgpu::Buffer,
    pub(super) pixels: usize,
    selected: Option<[Step; 2]>,
}

impl DeviceVectors {
    /// Adds room for a pattern and a photo, of `pixels` entries each. Without a selection, the vectors have as many. Fails as
    /// [`DeviceVectors::new`].
    pub(in crate::transport::gpu_matrix) fn of_product(
        self,
        pixels: usize,
        selection: Option<Selection<'_>>,
    ) -> Result<Self> {
        let gpu = &self.gpu;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let buffer = |label| gpu.buffer(label, 8 * pixels as u64, usage);
        let [pattern, photo] = [buffer("pattern")?, buffer("photo")?];
        let selected = |Selection { entries, factors }: Selection<'_>| -> Result<[Step; 2]> {
            let [.., write, read] = kernels(gpu)?;
            // A matrix has at most 2³² pixels.
            let entries: Vec<u32> = entries.iter().map(|&entry| entry as u32).collect();
            let entries = gpu.storage("selected entries", &entries)?;
            let factors = gpu.storage("factors", factors)?;
            let part = Part { rows: self.rows as u32, ..Part::default() };
            let groups = self.rows.div_ceil(INVOCATIONS) as u32;
            let step =
                |kernel: &Kernel, from, to| kernel.step(gpu, &part, &[from, &factors, &entries, to], groups);
            Ok([step(&write, &self.single, &pattern)?, step(&read, &photo, &self.work)?])
        };
        let selected = selection.map(selected).transpose()?;
        Ok(Self { of: Some(OfProduct { pattern, photo, pixels, selected }), ..self })
    }

    /// The entries of a pattern and of a photo.
    pub(in crate::transport::gpu_matrix) fn pixels(&self) -> usize {
        self.of.as_ref().map_or(0, |of| of.pixels)
    }

    pub(super) fn is_selection(&self) -> bool {
        self.of.as_ref().is_some_and(|of| of.selected.is_some())
    }

    /// Records the copies of the pattern and the photo to these buffers.
    pub(super) fn copy_product(&self, to: [&wgpu::Buffer; 2], encoder: &mut wgpu::CommandEncoder) {
        let Some(OfProduct { pattern, photo, .. }) = &self.of else { return };
        for (from, to) in [pattern, photo].into_iter().zip(to) {
            encoder.copy_buffer_to_buffer(from, 0, to, 0, to.size());
        }
    }

    /// Records the copy of a column to the pattern, and of the pattern to the beginning of a buffer.
    pub(in crate::transport::gpu_matrix) fn write_pattern(
        &self,
        column: usize,
        to: &wgpu::Buffer,
        encoder: &mut wgpu::CommandEncoder,
    ) {
        let Some(OfProduct { pattern, pixels, selected, .. }) = &self.of else { return };
        match selected {
            Some([write, _]) => {
                self.copy_column(column, &self.single, encoder);
                encoder.clear_buffer(pattern, 0, None);
                Step::record(&self.gpu, "selection", [write], encoder);
            }
            None => self.copy_column(column, pattern, encoder),
        }
        encoder.copy_buffer_to_buffer(pattern, 0, to, 0, 8 * *pixels as u64);
    }

    /// Records the copy of a buffer's beginning to the photo, and of the photo to `w`.
    pub(in crate::transport::gpu_matrix) fn read_photo(
        &self,
        from: &wgpu::Buffer,
        encoder: &mut wgpu::CommandEncoder,
    ) {
        let Some(OfProduct { photo, pixels, selected, .. }) = &self.of else { return };
        encoder.copy_buffer_to_buffer(from, 0, photo, 0, 8 * *pixels as u64);
        match selected {
            Some([_, read]) => Step::record(&self.gpu, "selection", [read], encoder),
            None => encoder.copy_buffer_to_buffer(photo, 0, &self.work, 0, self.bytes()),
        }
    }
}
