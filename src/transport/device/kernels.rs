//! The kernels that assemble a matrix, their parameters, and their dispatches.

use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::gpu::pipeline::{Kernel, READ, Step, WRITE};

/// The maximum number of contributions of a part; `SORTED` of `shaders/assemble_parts.wgsl`.
pub(super) const MOST_OF_PART: u32 = 512;
/// The maximum number of terms of a row that are sorted in workgroup memory; `SORTED` of `shaders/assemble_rows.wgsl`.
pub(super) const MOST_OF_ROW: u32 = 1024;
/// The number of elements that a workgroup takes; `BLOCK` of `shaders/assemble_scan.wgsl` and `shaders/assemble_sums.wgsl`.
pub(super) const BLOCK: u32 = 4096;
/// The number of weights that a workgroup of `shaders/assemble_squares.wgsl` adds.
pub(super) const WEIGHTS: u32 = 1 << 16;
/// Threads of a workgroup of `shaders/assemble_pixels.wgsl`.
pub(super) const PIXELS_OF_GROUP: u32 = 256;
/// Parts of a workgroup of `shaders/assemble_scatter.wgsl`, and rows of one of `shaders/assemble_pack.wgsl`.
pub(super) const OF_GROUP: u32 = 8;
/// `SUMS` of `shaders/assemble_sums.wgsl`.
pub(super) const SUMS: usize = 6;

/// Flags of `shaders/shared/assembly.wgsl`.
pub(super) const HAS_OWN: u32 = 1;
pub(super) const HAS_MIRRORED: u32 = 2;
pub(super) const FROM_PROJECTOR: u32 = 4;
pub(super) const SYMMETRIC: u32 = 8;

/// The parameters of a dispatch, in the layout of `Assembly` in `shaders/shared/assembly.wgsl`, which explains them.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Assembly {
    pub(super) luminance: [f32; 3],
    pub(super) paths: u32,
    pub(super) mean: [f32; 2],
    pub(super) first_pixel: u32,
    pub(super) first_sample: u32,
    pub(super) error_high: [f32; 4],
    pub(super) error_low: [f32; 4],
    pub(super) samples: u32,
    pub(super) first_half: u32,
    pub(super) samples_of_part: u32,
    pub(super) parts_of_pixel: u32,
    pub(super) parts_of_first_half: u32,
    pub(super) first_part: u32,
    pub(super) parts: u32,
    pub(super) max_bounces: u32,
    pub(super) direct: u32,
    pub(super) gathers: u32,
    pub(super) ambient: u32,
    pub(super) stride: u32,
    pub(super) mark: u32,
    pub(super) split: u32,
    pub(super) lowest_class: u32,
    pub(super) class_bits: u32,
    pub(super) part_bits: u32,
    pub(super) own_base: u32,
    pub(super) other_base: u32,
    pub(super) first_row: u32,
    pub(super) rows: u32,
    pub(super) flags: u32,
    pub(super) class_number: u32,
    pub(super) channel: u32,
    pub(super) first_halves: [u32; 2],
    pub(super) total: u32,
    pub(super) padding: u32,
}

/// A number as the sum of two numbers of single precision.
pub(super) fn split(value: f64) -> [f32; 2] {
    let high = value as f32;
    [high, (value - f64::from(high)) as f32]
}

/// All kernels for matrices of a number of channels.
#[derive(Clone)]
pub(super) struct Kernels {
    pub(super) parts: Kernel,
    pub(super) pixels: Kernel,
    pub(super) scan: [Kernel; 3],
    pub(super) scatter: Kernel,
    /// For rows that fit workgroup memory, and for longer rows.
    pub(super) rows: [Kernel; 2],
    pub(super) sums: Kernel,
    pub(super) pack: Kernel,
    pub(super) squares: Kernel,
}

/// Whether the keys of terms, and the keys of rows, fit into a word together with a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Packing {
    pub(super) of_part: bool,
    pub(super) of_row: bool,
}

impl Packing {
    /// The packing of keys of at most this many bits. Fails with [`Error::Device`] if a word is too short for a key of a row.
    pub(super) fn new(term_bits: u32, row_bits: u32) -> Result<Self> {
        if term_bits.max(row_bits) > u32::BITS {
            return Err(Error::device(format!(
                "an entry's place takes {} bits, and a GPU sorts by {}",
                term_bits.max(row_bits),
                u32::BITS
            )));
        }
        let fits = |bits: u32, places: u32| bits + places.ilog2() <= u32::BITS;
        Ok(Self { of_part: fits(term_bits, MOST_OF_PART), of_row: fits(row_bits, MOST_OF_ROW) })
    }
}

impl Kernels {
    /// The kernels of this device, which are compiled at first use.
    pub(super) fn of(gpu: &Gpu, channels: usize, packing: Packing) -> Result<Self> {
        gpu.kept(&format!("{channels} {packing:?}"), || Self::new(gpu, channels, packing))
    }

    fn new(gpu: &Gpu, channels: usize, packing: Packing) -> Result<Self> {
        let channels = ("CHANNELS", channels as f64);
        let flag = |name, set: bool| (name, f64::from(u8::from(set)));
        let of = |reads: usize, writes: usize| [[READ].repeat(reads), [WRITE].repeat(writes)].concat();
        let one = |name: &str, entry_point, constants: &[(&str, f64)], buffers: &[wgpu::BindingType]| {
            unchecked(gpu, name, [entry_point], constants, buffers).map(|[kernel]| kernel)
        };
        let rows = |is_long: bool| {
            let constants = [channels, flag("PACKED", packing.of_row), flag("LONG", is_long)];
            one("assemble_rows", "merge_rows", &constants, &[&of(0, 1)[..], &of(2, 4)].concat())
        };
        let scan = ["scan_blocks", "scan_sums", "scan_add"];
        let of_part = [channels, flag("PACKED", packing.of_part)];
        Ok(Self {
            parts: one("assemble_parts", "sum_parts", &of_part, &of(1, 6))?,
            pixels: one("assemble_pixels", "sum_pixels", &[channels], &of(2, 4))?,
            scan: unchecked(gpu, "assemble_scan", scan, &[], &of(0, 4))?,
            scatter: one("assemble_scatter", "scatter", &[channels], &of(4, 2))?,
            rows: [rows(false)?, rows(true)?],
            sums: one("assemble_sums", "sum_rows", &[channels], &of(1, 2))?,
            squares: one("assemble_squares", "sum_squares", &[], &of(1, 1))?,
            pack: one("assemble_pack", "pack", &[channels], &of(5, 2))?,
        })
    }
}

#[allow(unsafe_code, reason = "the checks would double the time of assembly")]
fn unchecked<const N: usize>(
    gpu: &Gpu,
    name: &str,
    entry_points: [&'static str; N],
    constants: &[(&str, f64)],
    buffers: &[wgpu::BindingType],
) -> Result<[Kernel; N]> {
    Kernel::all(gpu, name, entry_points, constants, buffers, |source| {
        // SAFETY: indices follow from counts that these kernels have made, here or on another device: of contributions, terms and entries.
        // Buffers have room for the largest possible counts, and loops count up to them.
        unsafe { gpu.unchecked_module(name, source) }
    })
}

/// Records dispatches one after the other.
pub(super) fn record<'a>(
    gpu: &Gpu,
    steps: impl IntoIterator<Item = &'a Step>,
    encoder: &mut wgpu::CommandEncoder,
) {
    // If passes are timed, each step is a pass of its own.
    if gpu.is_timed() {
        steps.into_iter().for_each(|step| Step::record(gpu, step.name, [step], encoder));
    } else {
        Step::record(gpu, "assembly", steps, encoder);
    }
}

/// Submits dispatches one after the other.
pub(super) fn submit<'a>(gpu: &Gpu, steps: impl IntoIterator<Item = &'a Step>) -> Result<()> {
    gpu.submit("assembly", |encoder| record(gpu, steps, encoder)).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::{assert_constant, assert_layout};

    #[test]
    fn parameters_lie_as_the_shaders_read_them() {
        assert_layout!(
            "assemble_scan", "Assembly", Assembly: luminance, paths, mean, first_pixel, first_sample, error_high, error_low, samples, first_half,
            samples_of_part, parts_of_pixel, parts_of_first_half, first_part, parts, max_bounces, direct, gathers, ambient,
            stride, mark, split, lowest_class, class_bits, part_bits, own_base, other_base, first_row, rows, flags,
            class_number, channel, first_halves, total, padding,
        );
        assert_constant("assemble_parts", "SORTED", MOST_OF_PART);
        assert_constant("assemble_parts", "PLACE_BITS", MOST_OF_PART.ilog2());
        assert_constant("assemble_rows", "SORTED", MOST_OF_ROW);
        assert_constant("assemble_rows", "PLACE_BITS", MOST_OF_ROW.ilog2());
        assert_constant("assemble_scan", "BLOCK", BLOCK);
        assert_constant("assemble_sums", "BLOCK", BLOCK);
        assert_constant("assemble_sums", "SUMS", SUMS as u32);
        assert_constant("assemble_squares", "WEIGHTS", WEIGHTS);
        assert_constant("assemble_pixels", "LANES", PIXELS_OF_GROUP);
        assert_constant("assemble_scatter", "PARTS_OF_GROUP", OF_GROUP);
        assert_constant("assemble_pack", "ROWS_OF_GROUP", OF_GROUP);
        for (name, flag) in [
            ("HAS_OWN", HAS_OWN),
            ("HAS_MIRRORED", HAS_MIRRORED),
            ("FROM_PROJECTOR", FROM_PROJECTOR),
            ("SYMMETRIC", SYMMETRIC),
        ] {
            assert_constant("assemble_scatter", name, flag);
        }
    }

    #[test]
    fn keys_that_do_not_fit_a_word_are_refused() {
        assert_eq!(Packing::new(23, 22).ok(), Some(Packing { of_part: true, of_row: true }));
        assert_eq!(Packing::new(24, 23).ok(), Some(Packing { of_part: false, of_row: false }));
        assert!(Packing::new(32, 32).is_ok());
        let error = Packing::new(30, 33).expect_err("33 bits are too many").to_string();
        assert!(error.contains("33 bits"), "{error}");
    }
}
