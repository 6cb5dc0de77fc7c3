//! Bringing results back: a buffer is mapped as soon as the work that fills it is done.

use std::sync::mpsc::Receiver;

use super::Gpu;
use crate::error::{Error, Result};

/// Results under way.
pub(crate) struct Readback {
    submission: wgpu::SubmissionIndex,
    mapped: Receiver<std::result::Result<(), wgpu::BufferAsyncError>>,
    bytes: u64,
}

impl Readback {
    /// Asks for the first `bytes` of `buffer` as `submission` leaves them.
    pub(crate) fn request(buffer: &wgpu::Buffer, bytes: u64, submission: wgpu::SubmissionIndex) -> Self {
        let (sender, mapped) = std::sync::mpsc::channel();
        buffer.map_async(wgpu::MapMode::Read, 0..bytes, move |outcome| {
            // Nobody listens any more where the work has been interrupted.
            let _ = sender.send(outcome);
        });
        Self { submission, mapped, bytes }
    }

    /// Waits for them. Drop the view and unmap the buffer before the device is to write there again.
    pub(crate) fn wait(self, gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<wgpu::BufferView> {
        gpu.wait(Some(self.submission))?;
        let lost = |reason: String| Error::Device {
            fault: format!("results cannot be read back from {}: {reason}", gpu.summary.name),
            help: "run again; if it happens again, choose another --adapter".into(),
        };
        match self.mapped.try_recv() {
            Ok(Ok(())) => buffer.get_mapped_range(0..self.bytes).map_err(|e| lost(e.to_string())),
            Ok(Err(e)) => Err(lost(e.to_string())),
            Err(e) => Err(lost(e.to_string())),
        }
    }
}
