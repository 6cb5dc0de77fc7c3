//! The kernels that assemble a matrix, their parameters, and their dispatches.

use std::borrow::Cow;

use wgpu::BufferUsages;

use crate::error::{Error, Result};
use crate::gpu::pipeline::{READ, UNIFORM, WRITE, grid};
use crate::gpu::{Gpu, shader};

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

#[derive(Clone)]
pub(super) struct Kernel {
    /// The entry point.
    name: &'static str,
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
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
        let one = |name: &str,
                   entry_point: &'static str,
                   constants: &[(&str, f64)],
                   buffers: &[wgpu::BindingType]| {
            Kernel::all(gpu, name, [entry_point], constants, buffers).map(|[kernel]| kernel)
        };
        let rows = |is_long: bool| {
            let constants = [channels, flag("PACKED", packing.of_row), flag("LONG", is_long)];
            let buffers = [WRITE, READ, READ, WRITE, WRITE, WRITE, WRITE];
            one("assemble_rows", "merge_rows", &constants, &buffers)
        };
        let of_part = [channels, flag("PACKED", packing.of_part)];
        Ok(Self {
            parts: one(
                "assemble_parts",
                "sum_parts",
                &of_part,
                &[READ, WRITE, WRITE, WRITE, WRITE, WRITE, WRITE],
            )?,
            pixels: one(
                "assemble_pixels",
                "sum_pixels",
                &[channels],
                &[READ, READ, WRITE, WRITE, WRITE, WRITE],
            )?,
            scan: Kernel::all(
                gpu,
                "assemble_scan",
                ["scan_blocks", "scan_sums", "scan_add"],
                &[],
                &[WRITE; 4],
            )?,
            scatter: one(
                "assemble_scatter",
                "scatter",
                &[channels],
                &[READ, READ, READ, READ, WRITE, WRITE],
            )?,
            rows: [rows(false)?, rows(true)?],
            sums: one("assemble_sums", "sum_rows", &[channels], &[READ, WRITE, WRITE])?,
            squares: one("assemble_squares", "sum_squares", &[], &[READ, WRITE])?,
            pack: one("assemble_pack", "pack", &[channels], &[READ, READ, READ, READ, READ, WRITE, WRITE])?,
        })
    }
}

impl Kernel {
    /// The kernels of these entry points of a shader. Their parameters are bound first, and then `buffers`.
    fn all<const N: usize>(
        gpu: &Gpu,
        name: &str,
        entry_points: [&'static str; N],
        constants: &[(&str, f64)],
        buffers: &[wgpu::BindingType],
    ) -> Result<[Self; N]> {
        let module = shader::kernel(name, constants)?;
        let bindings: Vec<_> = std::iter::once(UNIFORM).chain(buffers.iter().copied()).collect();
        gpu.guarded(name, || {
            let layout = gpu.layout(name, &bindings);
            let source = wgpu::ShaderSource::Naga(Cow::Owned(module));
            // SAFETY: indices follow from counts that the kernels themselves have made: of contributions, terms and entries. Buffers have
            // room for the largest possible counts, and loops count up to them.
            #[allow(unsafe_code, reason = "the checks would double the time of assembly")]
            let pipelines = unsafe { gpu.unchecked_pipelines(name, source, &[&layout], entry_points) };
            let mut kernels = entry_points.into_iter().zip(pipelines);
            std::array::from_fn(|_| {
                let (name, pipeline) = kernels.next().expect("each entry point has a pipeline");
                Self { name, pipeline, layout: layout.clone() }
            })
        })
    }

    /// The dispatch of `groups` workgroups with these parameters and buffers. It can be recorded several times.
    pub(super) fn step(
        &self,
        gpu: &Gpu,
        parameters: &Assembly,
        buffers: &[&wgpu::Buffer],
        groups: u32,
    ) -> Result<Step> {
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let uniform = gpu.buffer("parameters of assembly", size_of::<Assembly>() as u64, usage)?;
        let group = gpu.guarded("bindings of assembly", || {
            gpu.queue.write_buffer(&uniform, 0, bytemuck::bytes_of(parameters));
            let buffers = std::iter::once(&uniform).chain(buffers.iter().copied());
            gpu.bind("assembly", &self.layout, buffers.map(wgpu::Buffer::as_entire_binding))
        })?;
        Ok(Step { name: self.name, pipeline: self.pipeline.clone(), group, uniform, groups: grid(groups) })
    }
}

pub(super) struct Step {
    name: &'static str,
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    uniform: wgpu::Buffer,
    groups: [u32; 2],
}

impl Step {
    /// Changes the parameters and the number of workgroups, for dispatches that are submitted from now on.
    pub(super) fn change(&mut self, gpu: &Gpu, parameters: &Assembly, groups: u32) -> Result<()> {
        self.groups = grid(groups);
        gpu.guarded("parameters of assembly", || {
            gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(parameters));
        })
    }

    /// Records dispatches one after the other.
    pub(super) fn record<'a>(
        gpu: &Gpu,
        steps: impl IntoIterator<Item = &'a Self>,
        encoder: &mut wgpu::CommandEncoder,
    ) {
        let dispatch = |pass: &mut wgpu::ComputePass<'_>, step: &Self| {
            let Self { pipeline, group, groups: [across, down], .. } = step;
            if *across > 0 {
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, group, &[]);
                pass.dispatch_workgroups(*across, *down, 1);
            }
        };
        // If passes are timed, each step is a pass of its own.
        if gpu.is_timed() {
            steps.into_iter().for_each(|step| dispatch(&mut gpu.pass(encoder, step.name), step));
        } else {
            let mut pass = gpu.pass(encoder, "assembly");
            steps.into_iter().for_each(|step| dispatch(&mut pass, step));
        }
    }

    /// Submits dispatches one after the other.
    pub(super) fn submit<'a>(gpu: &Gpu, steps: impl IntoIterator<Item = &'a Self>) -> Result<()> {
        gpu.guarded("assembly", || {
            let mut encoder = gpu.encoder();
            Self::record(gpu, steps, &mut encoder);
            gpu.queue.submit([encoder.finish()]);
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::{assert_constant, assert_layout, offsets};

    #[test]
    fn parameters_lie_as_the_shaders_read_them() {
        let members = offsets!(
            Assembly: luminance, paths, mean, first_pixel, first_sample, error_high, error_low, samples, first_half,
            samples_of_part, parts_of_pixel, parts_of_first_half, first_part, parts, max_bounces, direct, gathers, ambient,
            stride, mark, split, lowest_class, class_bits, part_bits, own_base, other_base, first_row, rows, flags,
            class_number, channel, first_halves, total, padding,
        );
        assert_layout("assemble_scan", "Assembly", members, size_of::<Assembly>());
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
