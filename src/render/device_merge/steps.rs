//! The kernels that process the contributions of a dispatch one after the other, with their parameters and buffers.

use wgpu::{BindingType, BufferBindingType, BufferUsages, ShaderStages};

use super::{MergeRequest, words_of_term};
use crate::error::Result;
use crate::gpu::buffers::{Readback, Results};
use crate::gpu::{Gpu, shader};
use crate::render::batch::RecordLayout;

/// Threads of a workgroup; `LANES` of `shaders/shared/merging.wgsl`.
const LANES: u32 = 256;
/// The number of elements that a workgroup scans, and of entries that it sorts; `BLOCK` there.
const BLOCK: u32 = 1024;
/// The number of values of a digit; `DIGITS` there.
const DIGITS: u32 = 256;
/// `NOTHING` there.
const NOTHING: u32 = u32::MAX;

const DIGIT_BITS: u32 = DIGITS.trailing_zeros();
/// Lowest bits of a key, which hold the class of bounces.
const CLASS_BITS: u32 = 2;

/// The parameters of a step, in the layout of `Merging` in `shaders/shared/merging.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct MergeParameters {
    pub(super) luminance: [f32; 3],
    pub(super) channels: u32,
    pub(super) paths: u32,
    pub(super) samples: u32,
    first_half: u32,
    pub(super) max_bounces: u32,
    pub(super) direct: u32,
    pub(super) gathers: u32,
    pub(super) split: u32,
    pub(super) elements: u32,
    pub(super) blocks: u32,
    pub(super) word: u32,
    pub(super) shift: u32,
    pub(super) total: u32,
    pub(super) mean: f32,
    error_first: f32,
    error_second: f32,
    pub(super) padding: u32,
}

pub(super) struct MergeStep {
    pub(super) kernel: KernelName,
    /// Whether the entries are in the second of their two buffers, and move to the first one.
    pub(super) is_swapped: bool,
    pub(super) workgroups: u32,
    pub(super) parameters: MergeParameters,
}

pub(super) fn base_parameters(
    request: &MergeRequest<'_>,
    layout: &RecordLayout,
    paths: u32,
) -> MergeParameters {
    let [mean, error_first, error_second] = (request.weights)(layout.samples).map(|weight| weight as f32);
    MergeParameters {
        luminance: request.luminance,
        channels: request.channels as u32,
        paths,
        samples: layout.samples,
        first_half: layout.samples.div_ceil(2),
        max_bounces: layout.max_bounces,
        direct: u32::from(layout.direct),
        gathers: u32::from(layout.gathers),
        split: u32::from(request.split),
        total: NOTHING,
        mean,
        error_first,
        error_second,
        ..MergeParameters::default()
    }
}

/// The steps from records to terms, for paths that end at one of `other_pixels` pixels.
pub(super) fn all_steps(base: &MergeParameters, other_pixels: u64, layout: &RecordLayout) -> Vec<MergeStep> {
    let most = base.paths * layout.most_ends() as u32;
    let blocks = most.div_ceil(BLOCK);
    let base = MergeParameters { blocks, ..*base };
    let mut steps = MergeSteps { all: Vec::new(), is_swapped: false };
    steps.push(KernelName::CountContributions, base.paths.div_ceil(LANES), base);
    steps.scan(MergeParameters { elements: base.paths, total: 0, ..base });
    steps.push(KernelName::WriteContributions, base.paths.div_ceil(LANES), base);
    // Entries are written by ascending start, and the sort keeps the order of equal digits, so starts are sorted last.
    let key_bits = bits(other_pixels.saturating_sub(1)) + CLASS_BITS;
    let start_bits = bits(u64::from(base.paths / base.samples).saturating_sub(1));
    for (word, bits) in [(0, key_bits), (1, start_bits)] {
        for shift in (0..bits).step_by(DIGIT_BITS as usize) {
            let pass = MergeParameters { word, shift, elements: DIGITS * blocks, ..base };
            steps.push(KernelName::CountDigits, blocks, pass);
            steps.scan(pass);
            steps.push(KernelName::MoveEntries, blocks, pass);
            steps.is_swapped = !steps.is_swapped;
        }
    }
    let sums = MergeParameters { elements: most, total: 1, ..base };
    steps.push(KernelName::MarkTerms, most.div_ceil(LANES), sums);
    steps.scan(sums);
    steps.push(KernelName::SumTerms, most.div_ceil(LANES), sums);
    steps.all
}

/// The most steps of [`all_steps`]: keys of 30 bits and starts of 32 bits have eight digits.
const MOST_STEPS: usize = 4 + 4 * 8 + 4;

fn counters(entries: u32, paths: u32) -> u32 {
    paths.max(entries).max(DIGITS * entries.div_ceil(BLOCK))
}

struct MergeSteps {
    all: Vec<MergeStep>,
    is_swapped: bool,
}

impl MergeSteps {
    fn push(&mut self, kernel: KernelName, workgroups: u32, parameters: MergeParameters) {
        self.all.push(MergeStep { kernel, is_swapped: self.is_swapped, workgroups, parameters });
    }

    fn scan(&mut self, parameters: MergeParameters) {
        self.push(KernelName::ScanBlocks, parameters.elements.div_ceil(BLOCK), parameters);
        self.push(KernelName::ScanSums, 1, parameters);
    }
}

fn bits(number: u64) -> u32 {
    u64::BITS - number.leading_zeros()
}

/// Bytes between the parameters of two steps, a multiple of the alignment that devices require.
const STRIDE: u64 = 256;

/// Bytes of the totals: the number of entries, the number of terms, and two unused words.
pub(super) const TOTALS: u64 = 16;

pub(super) fn offset(step: usize) -> u32 {
    (step as u64 * STRIDE) as u32
}

pub(super) struct Buffers {
    parameters: wgpu::Buffer,
    pub(super) totals: Results,
    pub(super) terms: Results,
    /// Bind groups with the entries in the first of their buffers, and in the second one.
    pub(super) groups: [wgpu::BindGroup; 2],
}

impl Buffers {
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

    pub(super) fn write_parameters(&self, gpu: &Gpu, steps: &[MergeStep]) {
        let mut bytes = vec![0_u8; steps.len() * STRIDE as usize];
        for (step, to) in steps.iter().zip(bytes.chunks_exact_mut(STRIDE as usize)) {
            to[..size_of::<MergeParameters>()].copy_from_slice(bytemuck::bytes_of(&step.parameters));
        }
        gpu.queue.write_buffer(&self.parameters, 0, &bytes);
    }

    pub(super) fn wait_totals(&self, gpu: &Gpu, request: Readback) -> Result<u32> {
        let view = self.totals.wait(gpu, request)?;
        let totals: &[u32] = bytemuck::cast_slice(&view);
        let terms = totals[1];
        drop(view);
        self.totals.release();
        Ok(terms)
    }

    /// The first `words` words of the terms. Without terms, one word is read.
    pub(super) fn read_terms(&self, gpu: &Gpu, words: u64) -> Result<wgpu::BufferView> {
        let bytes = 4 * words.max(2);
        let submission = gpu.guarded("read-back of terms", || {
            let encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            self.terms.submit(gpu, encoder, bytes)
        })?;
        self.terms.wait(gpu, self.terms.request(bytes, submission))
    }
}

/// The kernels, in the order in which `Kernels` keeps them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum KernelName {
    CountContributions,
    WriteContributions,
    ScanBlocks,
    ScanSums,
    CountDigits,
    MoveEntries,
    MarkTerms,
    SumTerms,
}

/// The entry points of each shader, in the order of [`KernelName`].
const SHADERS: [(&str, [&str; 2]); 4] = [
    ("merge_contributions", ["count_contributions", "write_contributions"]),
    ("merge_scan", ["scan_blocks", "scan_sums"]),
    ("merge_sort", ["count_digits", "move_entries"]),
    ("merge_sums", ["mark_terms", "sum_terms"]),
];

/// All kernels, which share one layout. Clones share them.
#[derive(Clone)]
pub(super) struct Kernels {
    pipelines: Vec<wgpu::ComputePipeline>,
    pub(super) layout: wgpu::BindGroupLayout,
}

impl Kernels {
    pub(super) fn new(gpu: &Gpu) -> Result<Self> {
        let layout = layout(gpu);
        let bound = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("merging"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let mut pipelines = Vec::new();
        for (name, entry_points) in SHADERS {
            let text = shader::compose(name)?;
            pipelines.extend(gpu.guarded(name, || {
                let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                    label: Some(name),
                    source: wgpu::ShaderSource::Wgsl(text.into()),
                });
                entry_points.map(|entry_point| {
                    gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                        label: Some(entry_point),
                        layout: Some(&bound),
                        module: &module,
                        entry_point: Some(entry_point),
                        compilation_options: wgpu::PipelineCompilationOptions::default(),
                        cache: gpu.pipeline_cache(),
                    })
                })
            })?);
        }
        Ok(Self { pipelines, layout })
    }

    pub(super) fn pipeline(&self, kernel: KernelName) -> &wgpu::ComputePipeline {
        &self.pipelines[kernel as usize]
    }
}

fn layout(gpu: &Gpu) -> wgpu::BindGroupLayout {
    let parameters = BindingType::Buffer {
        ty: BufferBindingType::Uniform,
        has_dynamic_offset: true,
        min_binding_size: std::num::NonZero::new(size_of::<MergeParameters>() as u64),
    };
    let storage = |read_only| BindingType::Buffer {
        ty: BufferBindingType::Storage { read_only },
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    let types = [parameters, storage(true)].into_iter().chain([storage(false); 7]);
    let entries: Vec<_> = (0..)
        .zip(types)
        .map(|(binding, ty)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: ShaderStages::COMPUTE,
            ty,
            count: None,
        })
        .collect();
    gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("merging"),
        entries: &entries,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::{assert_constant, assert_layout, offsets};

    #[test]
    fn parameters_and_constants_are_those_of_the_shaders() {
        let members = offsets!(
            MergeParameters: luminance, channels, paths, samples, first_half, max_bounces, direct, gathers, split, elements,
            blocks, word, shift, total, mean, error_first, error_second, padding
        );
        assert_layout("merge_sort", "Merging", members, size_of::<MergeParameters>());
        for (name, value) in [("LANES", LANES), ("BLOCK", BLOCK), ("DIGITS", DIGITS), ("NOTHING", NOTHING)] {
            assert_constant("merge_sort", name, value);
        }
    }
}
