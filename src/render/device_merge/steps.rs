//! The kernels that a dispatch's contributions go through, one after the other.

use super::MergeRequest;
use super::kernels::KernelName;
use crate::render::records::Layout;

/// Threads of a workgroup; `LANES` of `shaders/shared/merging.wgsl`.
pub(super) const LANES: u32 = 256;
/// Elements that a workgroup scans, and entries that it sorts; `BLOCK` there.
pub(super) const BLOCK: u32 = 1024;
/// Values of a digit; `DIGITS` there.
pub(super) const DIGITS: u32 = 256;
/// `NOTHING` there.
const NOTHING: u32 = u32::MAX;

/// Bits of a digit.
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
    pub(super) first_half: u32,
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
    pub(super) error_first: f32,
    pub(super) error_second: f32,
    pub(super) padding: u32,
}

/// One dispatch of one kernel.
pub(super) struct Step {
    pub(super) kernel: KernelName,
    /// The entries are in the second of their two buffers, and move to the first one.
    pub(super) is_swapped: bool,
    pub(super) workgroups: u32,
    pub(super) parameters: MergeParameters,
}

/// What the parameters of all steps have in common.
pub(super) fn base(request: &MergeRequest<'_>, layout: &Layout, paths: u32) -> MergeParameters {
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
pub(super) fn steps(base: &MergeParameters, other_pixels: u64, layout: &Layout) -> Vec<Step> {
    let most = base.paths * layout.most_ends() as u32;
    let blocks = most.div_ceil(BLOCK);
    let base = MergeParameters { blocks, ..*base };
    let mut steps = Steps { all: Vec::new(), is_swapped: false };
    steps.push(KernelName::CountContributions, base.paths.div_ceil(LANES), base);
    steps.scan(MergeParameters { elements: base.paths, total: 0, ..base });
    steps.push(KernelName::WriteContributions, base.paths.div_ceil(LANES), base);
    // Entries are written by ascending start, and the sort keeps the order of equal digits: starts come last.
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

/// The most steps of [`steps()`]: keys of 30 bits and starts of 32 bits have eight digits.
pub(super) const MOST_STEPS: usize = 4 + 4 * 8 + 4;

/// Words of the counters that so many entries of so many paths need.
pub(super) fn counters(entries: u32, paths: u32) -> u32 {
    paths.max(entries).max(DIGITS * entries.div_ceil(BLOCK))
}

struct Steps {
    all: Vec<Step>,
    is_swapped: bool,
}

impl Steps {
    fn push(&mut self, kernel: KernelName, workgroups: u32, parameters: MergeParameters) {
        self.all.push(Step { kernel, is_swapped: self.is_swapped, workgroups, parameters });
    }

    fn scan(&mut self, parameters: MergeParameters) {
        self.push(KernelName::ScanBlocks, parameters.elements.div_ceil(BLOCK), parameters);
        self.push(KernelName::ScanSums, 1, parameters);
    }
}

/// Bits of the number.
fn bits(number: u64) -> u32 {
    u64::BITS - number.leading_zeros()
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
