//! Bringing results back: a buffer is mapped as soon as the work that fills it is done.

use std::sync::mpsc::Receiver;

use wgpu::BufferUsages;

use super::Gpu;
use crate::error::{Error, Result};

/// Where a kernel writes what the host is to read.
#[derive(Clone)]
pub(crate) struct Results {
    /// What the kernel writes to.
    pub(crate) buffer: wgpu::Buffer,
    /// `None` where the host reads the results where they are: see [`Gpu::shares_memory`].
    readback: Option<wgpu::Buffer>,
}

/// Results under way.
pub(crate) struct Readback {
    submission: wgpu::SubmissionIndex,
    mapped: Receiver<std::result::Result<(), wgpu::BufferAsyncError>>,
    bytes: u64,
}

impl Results {
    /// Room for `bytes` of them.
    pub(crate) fn new(gpu: &Gpu, label: &str, bytes: u64) -> Result<Self> {
        let read = if gpu.shares_memory { BufferUsages::MAP_READ } else { BufferUsages::COPY_SRC };
        let readback = (!gpu.shares_memory)
            .then(|| gpu.buffer("read-back", bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST));
        Ok(Self {
            buffer: gpu.buffer(label, bytes, BufferUsages::STORAGE | read)?,
            readback: readback.transpose()?,
        })
    }

    /// Hands `encoder` to the device, and with it what brings the first `bytes` to where the host reads. For [`Gpu::guarded`].
    pub(crate) fn submit(
        &self,
        gpu: &Gpu,
        mut encoder: wgpu::CommandEncoder,
        bytes: u64,
    ) -> wgpu::SubmissionIndex {
        if let Some(readback) = &self.readback {
            encoder.copy_buffer_to_buffer(&self.buffer, 0, readback, 0, bytes);
        }
        gpu.queue.submit([encoder.finish()])
    }

    /// Asks for the first `bytes` as `submission` leaves them.
    pub(crate) fn request(&self, bytes: u64, submission: wgpu::SubmissionIndex) -> Readback {
        let (sender, mapped) = std::sync::mpsc::channel();
        self.readable().map_async(wgpu::MapMode::Read, 0..bytes, move |outcome| {
            // Nobody listens any more where the work has been interrupted.
            let _ = sender.send(outcome);
        });
        Readback { submission, mapped, bytes }
    }

    /// Waits for what was asked for. Drop the view and call [`Results::release`] before the device is to write there again.
    pub(crate) fn wait(&self, gpu: &Gpu, asked: Readback) -> Result<wgpu::BufferView> {
        gpu.wait(Some(asked.submission))?;
        let lost = |reason: String| Error::Device {
            fault: format!("results cannot be read back from {}: {reason}", gpu.summary.name),
            help: "run again; if it happens again, choose another --adapter".into(),
        };
        match asked.mapped.try_recv() {
            Ok(Ok(())) => self.readable().get_mapped_range(0..asked.bytes).map_err(|e| lost(e.to_string())),
            Ok(Err(e)) => Err(lost(e.to_string())),
            Err(e) => Err(lost(e.to_string())),
        }
    }

    pub(crate) fn release(&self) {
        self.readable().unmap();
    }

    fn readable(&self) -> &wgpu::Buffer {
        self.readback.as_ref().unwrap_or(&self.buffer)
    }
}
