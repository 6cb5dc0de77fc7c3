//! Storage buffers; storage textures, which replace them if loads from buffers are slow; and results that the host reads back.

use std::ops::Deref;
use std::sync::mpsc::Receiver;
use std::time::Duration;

use wgpu::BufferUsages;
use wgpu::util::DeviceExt;

use super::Gpu;
use crate::error::{Error, Result};

/// The size in bytes of the pieces that [`Gpu::fill`] uploads. Two pieces are in flight at a time.
const PIECE: usize = 32 << 20;

/// The maximum time in which another thread delivers results that are ready.
const DELIVERY: Duration = Duration::from_secs(60);

/// The number of texels in a row of a data texture. Shaders use it to split an index into column and row.
pub(crate) const TEXTURE_WIDTH: u32 = 4096;

impl Gpu {
    /// A read-only storage buffer with `data`, which is uploaded piece by piece, so that uploads in flight need little memory. An empty
    /// slice becomes one element of zeros, because a binding must not be empty. Fails with [`Error::Device`] if the device has too little
    /// memory.
    pub(crate) fn storage<T: bytemuck::Pod>(&self, label: &str, data: &[T]) -> Result<wgpu::Buffer> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let size = bytes.len().max(size_of::<T>()) as u64;
        let buffer = self.buffer(label, size, BufferUsages::STORAGE | BufferUsages::COPY_DST)?;
        self.fill(label, &buffer, 0, bytes).map(|()| buffer)
    }

    /// Uploads `bytes` to a place in a buffer, piece by piece. Fails with [`Error::Device`] if the device fails.
    pub(crate) fn fill(&self, label: &str, buffer: &wgpu::Buffer, place: u64, bytes: &[u8]) -> Result<()> {
        let mut before = None;
        for (index, piece) in bytes.chunks(PIECE).enumerate() {
            let submission = self.guarded(label, || {
                self.queue.write_buffer(buffer, place + (index * PIECE) as u64, piece);
                self.queue.submit([])
            })?;
            if let Some(before) = before.replace(submission) {
                self.wait(Some(before))?;
            }
        }
        Ok(())
    }

    pub(crate) fn buffer(&self, label: &str, bytes: u64, usage: BufferUsages) -> Result<wgpu::Buffer> {
        self.check_size(label, bytes)?;
        let make = || {
            self.guarded(&format!("{label} ({:.1} MiB)", bytes as f64 / 1048576.0), || {
                self.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some(label),
                    size: bytes,
                    usage,
                    mapped_at_creation: false,
                })
            })
        };
        match make() {
            // Buffers that wait to be used again may occupy the memory.
            Err(_) if self.kept.waiting.clear() => self.wait(None).and_then(|()| make()),
            made => made,
        }
    }

    /// A read-only storage texture of 16-byte texels in rows of [`TEXTURE_WIDTH`], padded with zeros.
    pub(crate) fn texel_array(&self, label: &str, texels: &[[u32; 4]]) -> Result<wgpu::TextureView> {
        self.texel_rows(label, texels, TEXTURE_WIDTH)
    }

    pub(crate) fn texel_bytes(&self) -> u64 {
        u64::from(self.device.limits().max_texture_dimension_2d) * u64::from(TEXTURE_WIDTH) * 16
    }

    /// Works like [`Gpu::texel_array`], with rows of `width` texels.
    pub(crate) fn texel_rows(
        &self,
        label: &str,
        texels: &[[u32; 4]],
        width: u32,
    ) -> Result<wgpu::TextureView> {
        let rows = texels.len().div_ceil(width as usize).max(1);
        let limit = self.device.limits().max_texture_dimension_2d as usize;
        if rows > limit {
            return Err(self.too_large(
                label,
                texels.len() as u64 * 16,
                (limit * width as usize) as u64 * 16,
            ));
        }
        let mut padded = texels.to_vec();
        padded.resize(rows * width as usize, [0; 4]);
        self.guarded(label, || {
            let size = wgpu::Extent3d { width, height: rows as u32, depth_or_array_layers: 1 };
            let descriptor = wgpu::TextureDescriptor {
                label: Some(label),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba32Uint,
                usage: wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            };
            let order = wgpu::util::TextureDataOrder::LayerMajor;
            let texture = self.device.create_texture_with_data(
                &self.queue,
                &descriptor,
                order,
                bytemuck::cast_slice(&padded),
            );
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        })
    }

    pub(crate) fn check_size(&self, label: &str, bytes: u64) -> Result<()> {
        let limit = self.summary.max_storage_binding.min(self.summary.max_buffer);
        if bytes > limit { Err(self.too_large(label, bytes, limit)) } else { Ok(()) }
    }

    fn too_large(&self, label: &str, bytes: u64, limit: u64) -> Error {
        Error::device(format!(
            "the {label} need {:.0} MiB, and {} allows {:.0} MiB",
            bytes as f64 / 1048576.0,
            self.summary.name,
            limit as f64 / 1048576.0
        ))
        .help("use a simpler scene or smaller textures, or another --adapter")
    }
}

/// The buffer of a kernel's results, with a staging buffer if the host cannot read results in place.
pub(crate) struct Results {
    pub(crate) buffer: wgpu::Buffer,
    /// The staging buffer; `None` if the host reads results in place (see [`Gpu::shares_memory`]) or never.
    readback: Option<wgpu::Buffer>,
}

impl Results {
    pub(crate) fn new(gpu: &Gpu, label: &str, bytes: u64) -> Result<Self> {
        let read = if gpu.shares_memory { BufferUsages::MAP_READ } else { BufferUsages::empty() };
        let readback = (!gpu.shares_memory)
            .then(|| gpu.buffer("read-back", bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST));
        Ok(Self {
            buffer: gpu.buffer(label, bytes, BufferUsages::STORAGE | BufferUsages::COPY_SRC | read)?,
            readback: readback.transpose()?,
        })
    }

    /// Results that no host reads. They cannot be requested.
    pub(crate) fn resident(gpu: &Gpu, label: &str, bytes: u64) -> Result<Self> {
        Ok(Self { buffer: gpu.buffer(label, bytes, BufferUsages::STORAGE)?, readback: None })
    }

    /// Submits the commands that `record` records, and requests the first `bytes` of their results.
    pub(crate) fn launch(
        &self,
        gpu: &Gpu,
        what: &str,
        bytes: u64,
        record: impl FnOnce(&mut wgpu::CommandEncoder),
    ) -> Result<Readback> {
        let submission = gpu.submit(what, |encoder| {
            record(encoder);
            if let Some(readback) = &self.readback {
                encoder.copy_buffer_to_buffer(&self.buffer, 0, readback, 0, bytes);
            }
        })?;
        Ok(Readback::request(self.readback.as_ref().unwrap_or(&self.buffer), bytes, submission))
    }
}

/// A requested part of a buffer that the host can map.
pub(crate) struct Readback {
    buffer: wgpu::Buffer,
    submission: wgpu::SubmissionIndex,
    mapped: Receiver<std::result::Result<(), wgpu::BufferAsyncError>>,
    bytes: u64,
}

impl Readback {
    /// Requests the first `bytes` of the buffer as they are after `submission`.
    pub(crate) fn request(buffer: &wgpu::Buffer, bytes: u64, submission: wgpu::SubmissionIndex) -> Self {
        let (sender, mapped) = std::sync::mpsc::channel();
        buffer.map_async(wgpu::MapMode::Read, 0..bytes, move |outcome| {
            // Sending fails if an interruption has dropped the receiver, which is harmless.
            let _ = sender.send(outcome);
        });
        Self { buffer: buffer.clone(), submission, mapped, bytes }
    }

    /// Waits for the bytes. The device may write to the buffer again when they have been dropped.
    pub(crate) fn wait(self, gpu: &Gpu) -> Result<Mapped> {
        gpu.wait(Some(self.submission))?;
        let lost =
            |reason: &dyn std::fmt::Display| gpu.lost(&format!("results cannot be read back ({reason})"));
        // The device has done the work, so the answer is on its way; another thread that waits may be about to deliver it.
        match self.mapped.recv_timeout(DELIVERY) {
            Ok(Ok(())) => {
                let view = self.buffer.get_mapped_range(0..self.bytes).map_err(|e| lost(&e))?;
                Ok(Mapped { view, _unmap: Unmap(self.buffer) })
            }
            Ok(Err(e)) => Err(lost(&e)),
            Err(e) => Err(lost(&e)),
        }
    }
}

/// Bytes of a buffer that the host reads in place.
pub(crate) struct Mapped {
    // The view must be dropped before the buffer is unmapped.
    view: wgpu::BufferView,
    _unmap: Unmap,
}

impl Deref for Mapped {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.view
    }
}

struct Unmap(wgpu::Buffer);

impl Drop for Unmap {
    fn drop(&mut self) {
        self.0.unmap();
    }
}
