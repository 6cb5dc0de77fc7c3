//! Measurements of the device for the benchmarks: products without transfers to and from the host, and plain
//! copies to compare with.

use std::time::{Duration, Instant};

use wgpu::BufferUsages;

use super::{GpuMatrix, Product};
use crate::error::Result;
use crate::transport::Part;

impl GpuMatrix {
    /// Bytes that a product with all light of one channel reads and writes, each counted once.
    pub fn bytes_of_product(&self) -> u64 {
        let of_band = |band: &super::bands::Band| {
            band.starts.size() + band.columns.size() + band.weights.first().map_or(0, wgpu::Buffer::size)
        };
        let bands = self.layers.iter().flat_map(|layer| &layer.bands);
        let vectors = 8 * (self.rig.projector.pixels() + self.rig.camera.pixels()) as u64;
        let diagonal =
            if self.has_diagonal { self.diagonals.first().map_or(0, wgpu::Buffer::size) } else { 0 };
        bands.map(of_band).sum::<u64>() + diagonal + vectors
    }

    /// The number of dispatches of a product with all light of one channel.
    pub fn dispatches(&self) -> usize {
        self.layers.iter().map(|layer| layer.bands.len()).sum::<usize>().max(1)
    }

    /// The time of `count` products with all light of the first channel, one after the other on the device,
    /// with the pattern of the last product.
    ///
    /// # Errors
    /// [`crate::Error::Device`] when the device failed.
    pub fn time_products(&self, count: u32) -> Result<Duration> {
        let mut state = self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let product = Product { part: Part::Full, channel: 0, is_transposed: false };
        let steps = self.steps(&mut state, product)?;
        self.time("products", |encoder| {
            (0..count).for_each(|_| self.kernel.encode(encoder, steps));
        })
    }

    /// The time of `count` copies of `bytes` from one buffer to another, which read and write each byte once.
    ///
    /// # Errors
    /// [`crate::Error::Device`] when the device failed or has not enough memory.
    pub fn time_copies(&self, bytes: u64, count: u32) -> Result<Duration> {
        let bytes = bytes.next_multiple_of(4);
        let usage = BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let [from, to] = [self.gpu.buffer("copied", bytes, usage)?, self.gpu.buffer("copy", bytes, usage)?];
        let copy = |encoder: &mut wgpu::CommandEncoder| {
            (0..count).for_each(|_| encoder.copy_buffer_to_buffer(&from, 0, &to, 0, bytes));
        };
        // The first use of the buffers also clears them, so the second run is the one that counts.
        self.time("copies", copy)?;
        self.time("copies", copy)
    }

    fn time(&self, what: &str, work: impl FnOnce(&mut wgpu::CommandEncoder)) -> Result<Duration> {
        let gpu = &self.gpu;
        let start = Instant::now();
        let submission = gpu.guarded(what, || {
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            work(&mut encoder);
            gpu.queue.submit([encoder.finish()])
        })?;
        gpu.wait(Some(submission))?;
        Ok(start.elapsed())
    }
}
