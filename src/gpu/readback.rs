//! Results of kernels, read back by the host: a buffer is mapped as soon as the kernel that fills it is done.

use std::sync::mpsc::Receiver;

use wgpu::BufferUsages;

use super::Gpu;
use crate::error::Result;

/// The buffer of a kernel's results, with a staging buffer where the host cannot read the first one. Clones
/// share them.
#[derive(Clone)]
pub(crate) struct Results {
    /// The buffer to which the kernel writes.
    pub(crate) buffer: wgpu::Buffer,
    /// The staging buffer; `None` where the host reads results in place (see [`Gpu::shares_memory`]).
    readback: Option<wgpu::Buffer>,
}

/// A request for results that are in flight.
pub(crate) struct Readback {
    submission: wgpu::SubmissionIndex,
    mapped: Receiver<std::result::Result<(), wgpu::BufferAsyncError>>,
    bytes: u64,
}

impl Results {
    /// Allocates `bytes` for results.
    pub(crate) fn new(gpu: &Gpu, label: &str, bytes: u64) -> Result<Self> {
        let read = if gpu.shares_memory { BufferUsages::MAP_READ } else { BufferUsages::COPY_SRC };
        let readback = (!gpu.shares_memory)
            .then(|| gpu.buffer("read-back", bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST));
        Ok(Self {
            buffer: gpu.buffer(label, bytes, BufferUsages::STORAGE | read)?,
            readback: readback.transpose()?,
        })
    }

    /// Submits `encoder`, followed by a copy of the first `bytes` to the staging buffer, if there is one.
    /// Call it within [`Gpu::guarded`].
    pub(crate) fn submit(
        &self,
        gpu: &Gpu,
        mut encoder: wgpu::CommandEncoder,
        bytes: u64,
    ) -> wgpu::SubmissionIndex {
        self.copy(&mut encoder, bytes);
        gpu.queue.submit([encoder.finish()])
    }

    /// Records a copy of the first `bytes` to the staging buffer, if there is one.
    pub(crate) fn copy(&self, encoder: &mut wgpu::CommandEncoder, bytes: u64) {
        if let Some(readback) = &self.readback {
            encoder.copy_buffer_to_buffer(&self.buffer, 0, readback, 0, bytes);
        }
    }

    /// Requests the first `bytes` in their state after `submission`.
    pub(crate) fn request(&self, bytes: u64, submission: wgpu::SubmissionIndex) -> Readback {
        let (sender, mapped) = std::sync::mpsc::channel();
        self.readable().map_async(wgpu::MapMode::Read, 0..bytes, move |outcome| {
            // After an interruption nothing receives this.
            let _ = sender.send(outcome);
        });
        Readback { submission, mapped, bytes }
    }

    /// Waits for requested results. Drop the view and call [`Results::release`] before the device writes to
    /// the buffer again.
    pub(crate) fn wait(&self, gpu: &Gpu, request: Readback) -> Result<wgpu::BufferView> {
        gpu.wait(Some(request.submission))?;
        let lost =
            |reason: &dyn std::fmt::Display| gpu.lost(&format!("results cannot be read back ({reason})"));
        match request.mapped.try_recv() {
            Ok(Ok(())) => self.readable().get_mapped_range(0..request.bytes).map_err(|e| lost(&e)),
            Ok(Err(e)) => Err(lost(&e)),
            Err(e) => Err(lost(&e)),
        }
    }

    /// Makes the results writable again for the device.
    pub(crate) fn release(&self) {
        self.readable().unmap();
    }

    /// The buffer that the host maps.
    fn readable(&self) -> &wgpu::Buffer {
        self.readback.as_ref().unwrap_or(&self.buffer)
    }
}
