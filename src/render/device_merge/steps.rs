//! The kernels that process the contributions of a dispatch in successive steps, with their parameters.

use wgpu::{BindingType, BufferBindingType};

use super::MergeRequest;
use crate::error::Result;
use crate::gpu::pipeline::{READ, WRITE};
use crate::gpu::{Gpu, shader};
use crate::render::batch::RecordLayout;

/// Threads of a workgroup; `LANES` of `shaders/shared/merging.wgsl`.
const LANES: u32 = 256;
/// The number of elements that a workgroup scans, and of entries that it sorts; `BLOCK` of the same file.
const BLOCK: u32 = 1024;
/// The number of values of a digit; `DIGITS` of the same file.
const DIGITS: u32 = 256;
/// `NOTHING` of the same file. As `total`, it says that a scan does not store its sum.
const NOTHING: u32 = u32::MAX;

const DIGIT_BITS: u32 = DIGITS.trailing_zeros();
/// The number of the lowest bits of a key that hold the class of bounces.
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
    /// Whether the entries are in the second of their two buffers, so that sorting moves them to the first one.
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

/// The steps that turn records into terms, for paths that end at one of `other_pixels` pixels.
pub(super) fn all_steps(base: &MergeParameters, other_pixels: u64, layout: &RecordLayout) -> Vec<MergeStep> {
    let most = base.paths * layout.most_ends() as u32;
    let blocks = most.div_ceil(BLOCK);
    let base = MergeParameters { blocks, ..*base };
    let mut steps = MergeSteps { all: Vec::new(), is_swapped: false };
    steps.push(KernelName::CountContributions, base.paths.div_ceil(LANES), base);
    steps.scan(MergeParameters { elements: base.paths, total: 0, ..base });
    steps.push(KernelName::WriteContributions, base.paths.div_ceil(LANES), base);
    // Entries are written by ascending start pixel. The sort is stable, so digits of keys are sorted first, and digits of start pixels
    // last.
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

/// The maximum number of steps of [`all_steps`]. Keys of 30 bits and starts of 32 bits have eight digits.
pub(super) const MOST_STEPS: usize = 4 + 4 * 8 + 4;

/// The maximum number of counters of a step, and the number of their sums by blocks.
pub(super) fn counters(entries: u32, paths: u32) -> [u64; 2] {
    let counters = paths.max(entries).max(DIGITS * entries.div_ceil(BLOCK));
    [counters, counters.div_ceil(BLOCK)].map(u64::from)
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

/// The kernels, in the order of `Kernels`.
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

/// All kernels, which have the same layout. Clones share the kernels.
#[derive(Clone)]
pub(in crate::render) struct Kernels {
    pipelines: Vec<wgpu::ComputePipeline>,
    pub(super) layout: wgpu::BindGroupLayout,
}

impl Kernels {
    pub(super) fn new(gpu: &Gpu) -> Result<Self> {
        let parameters = BindingType::Buffer {
            ty: BufferBindingType::Uniform,
            has_dynamic_offset: true,
            min_binding_size: std::num::NonZero::new(size_of::<MergeParameters>() as u64),
        };
        let layout =
            gpu.layout("merging", &[parameters, READ, WRITE, WRITE, WRITE, WRITE, WRITE, WRITE, WRITE]);
        let mut pipelines = Vec::new();
        for (name, entry_points) in SHADERS {
            let source = wgpu::ShaderSource::Wgsl(shader::compose(name)?.into());
            pipelines.extend(gpu.guarded(name, || gpu.pipelines(name, source, &[&layout], entry_points))?);
        }
        Ok(Self { pipelines, layout })
    }

    pub(super) fn pipeline(&self, kernel: KernelName) -> &wgpu::ComputePipeline {
        &self.pipelines[kernel as usize]
    }
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
