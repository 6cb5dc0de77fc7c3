//! The kernel of a product and its dispatches, one for each band.

use std::ops::Range;

use wgpu::{BindingType, BufferBindingType, BufferUsages, ShaderStages};

use super::bands::Band;
use crate::error::Result;
use crate::gpu::{Gpu, shader};

/// Rows of a workgroup; `ROWS_OF_GROUP` of `shaders/product.wgsl`.
const ROWS_OF_GROUP: u32 = 2;

/// The band has entries; `HAS_ENTRIES` of `shaders/product.wgsl`.
const HAS_ENTRIES: u32 = 1;

/// Most workgroups in one dimension of a dispatch.
const MOST_GROUPS: u32 = 65_535;

/// The uniform of a dispatch, with the layout of `Band` in `shaders/product.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Parameters {
    first_row: u32,
    rows: u32,
    terms: u32,
    padding: u32,
}

/// The terms of a row's sum besides its entries; flags of `shaders/product.wgsl`.
#[derive(Clone, Copy)]
pub(super) struct Terms {
    pub(super) diagonal: bool,
    /// The sum that earlier bands wrote to the photo.
    pub(super) adds: bool,
}

/// The buffers that all bands share.
pub(super) struct Shared<'a> {
    pub(super) diagonal: &'a wgpu::Buffer,
    pub(super) from: &'a wgpu::Buffer,
    pub(super) to: &'a wgpu::Buffer,
}

/// The compiled kernel.
pub(super) struct Kernel {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    /// Bound in place of a buffer that is not read.
    nothing: wgpu::Buffer,
}

/// A dispatch, ready to be recorded.
pub(super) struct Step {
    group: wgpu::BindGroup,
    workgroups: [u32; 2],
}

impl Kernel {
    pub(super) fn new(gpu: &Gpu) -> Result<Self> {
        let source = shader::compose("product")?;
        let nothing = gpu.storage("nothing", &[0.0_f32])?;
        gpu.guarded("product", || {
            let device = &gpu.device;
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("product"),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            });
            let read = BufferBindingType::Storage { read_only: true };
            let types = [BufferBindingType::Uniform, read, read, read, read, read];
            let types = types.into_iter().chain([BufferBindingType::Storage { read_only: false }]);
            let entries: Vec<_> = (0..)
                .zip(types)
                .map(|(binding, ty)| wgpu::BindGroupLayoutEntry {
                    binding,
                    visibility: ShaderStages::COMPUTE,
                    ty: BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
                    count: None,
                })
                .collect();
            let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some("product"),
                entries: &entries,
            });
            let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some("product"),
                layout: Some(&device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                    label: Some("product"),
                    bind_group_layouts: &[Some(&layout)],
                    immediate_size: 0,
                })),
                module: &module,
                entry_point: Some("product"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: gpu.pipeline_cache(),
            });
            Self { pipeline, layout, nothing }
        })
    }

    /// The dispatch for a band's entries of one channel.
    pub(super) fn band(
        &self,
        gpu: &Gpu,
        (band, channel): (&Band, usize),
        terms: Terms,
        shared: &Shared<'_>,
    ) -> Result<Step> {
        let of_band = [&band.starts, &band.columns, &band.weights[channel]];
        self.step(gpu, band.rows.clone(), HAS_ENTRIES | bits(terms), of_band, shared)
    }

    /// The dispatch that writes the diagonal's products to these rows, or zeros without a diagonal.
    pub(super) fn diagonal(
        &self,
        gpu: &Gpu,
        rows: Range<u32>,
        terms: Terms,
        shared: &Shared<'_>,
    ) -> Result<Step> {
        self.step(gpu, rows, bits(terms), [&self.nothing; 3], shared)
    }

    fn step(
        &self,
        gpu: &Gpu,
        rows: Range<u32>,
        terms: u32,
        of_band: [&wgpu::Buffer; 3],
        shared: &Shared<'_>,
    ) -> Result<Step> {
        let uniform = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let parameters = gpu.buffer("band", size_of::<Parameters>() as u64, uniform)?;
        let count = rows.end - rows.start;
        let values = Parameters { first_row: rows.start, rows: count, terms, padding: 0 };
        let [starts, columns, weights] = of_band;
        let buffers = [&parameters, starts, columns, weights, shared.diagonal, shared.from, shared.to];
        let group = gpu.guarded("bindings", || {
            gpu.queue.write_buffer(&parameters, 0, bytemuck::bytes_of(&values));
            let entries: Vec<_> = (0..)
                .zip(buffers)
                .map(|(binding, buffer)| wgpu::BindGroupEntry {
                    binding,
                    resource: buffer.as_entire_binding(),
                })
                .collect();
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("product"),
                layout: &self.layout,
                entries: &entries,
            })
        })?;
        Ok(Step { group, workgroups: workgroups(count) })
    }

    /// Records the steps, which the device runs one after the other.
    pub(super) fn encode(&self, encoder: &mut wgpu::CommandEncoder, steps: &[Step]) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline);
        for Step { group, workgroups: [across, down] } in steps {
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(*across, *down, 1);
        }
    }
}

fn bits(terms: Terms) -> u32 {
    u32::from(terms.diagonal) << 1 | u32::from(terms.adds) << 2
}

/// Workgroups in two dimensions for `rows` rows, with as few in the second dimension as possible.
fn workgroups(rows: u32) -> [u32; 2] {
    let groups = rows.div_ceil(ROWS_OF_GROUP);
    let down = groups.div_ceil(MOST_GROUPS).max(1);
    [groups.div_ceil(down), down]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::{assert_constant, assert_layout, offsets};

    #[test]
    fn bands_lie_as_the_shader_reads_them() {
        let members = offsets!(Parameters: first_row, rows, terms, padding);
        assert_layout("product", "Band", members, size_of::<Parameters>());
        assert_constant("product", "ROWS_OF_GROUP", ROWS_OF_GROUP);
        let (diagonal, adds) = (Terms { diagonal: true, adds: false }, Terms { diagonal: false, adds: true });
        assert_constant("product", "HAS_ENTRIES", HAS_ENTRIES);
        assert_constant("product", "HAS_DIAGONAL", bits(diagonal));
        assert_constant("product", "ADDS", bits(adds));
    }

    #[test]
    fn workgroups_are_enough_and_within_the_limits() {
        for rows in [0, 1, 2, 3, 131_070, 131_071, 1 << 20, 268_435_456] {
            let [across, down] = workgroups(rows);
            assert!(across <= MOST_GROUPS && down <= MOST_GROUPS, "{rows}");
            assert!(ROWS_OF_GROUP * across * down >= rows, "{rows}");
            assert!(
                across * down < rows.div_ceil(ROWS_OF_GROUP) + down.max(1),
                "{rows}: nearly none for nothing"
            );
        }
    }
}
