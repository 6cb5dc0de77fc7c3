//! The buffers of the kernels.

use wgpu::{BufferUsages, CommandEncoder};

use super::kernels::Kernels;
use super::steps::{BLOCK, MOST_STEPS, MergeParameters, Step, counters};
use super::words_of_term;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::readback::{Readback, Results};

/// Bytes between the parameters of two steps, a multiple of what devices ask for.
const STRIDE: u64 = 256;

/// Bytes of the totals: the number of entries, that of terms, and two unused ones.
const TOTALS: u64 = 16;

/// Where the parameters of a step are.
pub(super) fn offset(step: usize) -> u32 {
    (step as u64 * STRIDE) as u32
}

/// Buffers for the contributions of one dispatch.
pub(super) struct Buffers {
    parameters: wgpu::Buffer,
    totals: Results,
    terms: Results,
    /// With the entries in the first of their buffers, and in the second one.
    groups: [wgpu::BindGroup; 2],
}

impl Buffers {
    /// Room for so many entries of so many paths.
    pub(super) fn new(
        gpu: &Gpu,
        kernels: &Kernels,
        records: &wgpu::Buffer,
        (entries, paths): (u32, u32),
        channels: usize,
    ) -> Result<Self> {
        let words = |label: &str, count: u64| gpu.buffer(label, 4 * count, BufferUsages::STORAGE);
        let counted = u64::from(counters(entries, paths));
        let entry_words = 4 * u64::from(entries);
        let [one, other] = [words("entries", entry_words)?, words("moved entries", entry_words)?];
        let values = words("values", u64::from(entries) * channels as u64)?;
        let counters = words("counters", counted)?;
        let sums = words("sums", counted.div_ceil(u64::from(BLOCK)))?;
        let totals = Results::new(gpu, "totals", TOTALS)?;
        let terms = Results::new(gpu, "terms", 4 * u64::from(entries) * words_of_term(channels) as u64)?;
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let parameters = gpu.buffer("parameters of merging", STRIDE * MOST_STEPS as u64, usage)?;
        let group = |[entries, moved]: [&wgpu::Buffer; 2]| {
            let parameters = wgpu::BufferBinding {
                buffer: &parameters,
                offset: 0,
                size: std::num::NonZero::new(size_of::<MergeParameters>() as u64),
            };
            let storage = [records, entries, moved, &values, &counters, &sums, &totals.buffer, &terms.buffer];
            let resources = std::iter::once(wgpu::BindingResource::Buffer(parameters))
                .chain(storage.map(wgpu::Buffer::as_entire_binding));
            let entries: Vec<_> = (0..)
                .zip(resources)
                .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
                .collect();
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("merging"),
                layout: &kernels.layout,
                entries: &entries,
            })
        };
        let groups = gpu.guarded("bindings of merging", || [group([&one, &other]), group([&other, &one])])?;
        Ok(Self { parameters, totals, terms, groups })
    }

    /// The bindings of a step.
    pub(super) fn group(&self, is_swapped: bool) -> &wgpu::BindGroup {
        &self.groups[usize::from(is_swapped)]
    }

    /// Writes the parameters of all steps.
    pub(super) fn write_parameters(&self, gpu: &Gpu, steps: &[Step]) {
        let mut bytes = vec![0_u8; steps.len() * STRIDE as usize];
        for (step, to) in steps.iter().zip(bytes.chunks_exact_mut(STRIDE as usize)) {
            to[..size_of::<MergeParameters>()].copy_from_slice(bytemuck::bytes_of(&step.parameters));
        }
        gpu.queue.write_buffer(&self.parameters, 0, &bytes);
    }

    /// Records the copy of the totals, if the host cannot read them in place.
    pub(super) fn copy_totals(&self, encoder: &mut CommandEncoder) {
        self.totals.copy(encoder, TOTALS);
    }

    pub(super) fn request_totals(&self, submission: wgpu::SubmissionIndex) -> Readback {
        self.totals.request(TOTALS, submission)
    }

    /// Waits for the number of terms.
    pub(super) fn wait_totals(&self, gpu: &Gpu, request: Readback) -> Result<u32> {
        let view = self.totals.wait(gpu, request)?;
        let totals: &[u32] = bytemuck::cast_slice(&view);
        let terms = totals[1];
        drop(view);
        self.totals.release();
        Ok(terms)
    }

    /// The first `words` words of the terms; one word more than none.
    pub(super) fn read_terms(&self, gpu: &Gpu, words: u64) -> Result<wgpu::BufferView> {
        let bytes = 4 * words.max(2);
        let submission = gpu.guarded("read-back of terms", || {
            let encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            self.terms.submit(gpu, encoder, bytes)
        })?;
        self.terms.wait(gpu, self.terms.request(bytes, submission))
    }

    /// Makes the terms writable again for the device.
    pub(super) fn release(&self) {
        self.terms.release();
    }
}
