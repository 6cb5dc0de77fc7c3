//! Runs one WGSL function over many invocations, and reads the records of light paths for comparisons to the last bit.

use wgpu::{BindingType, BufferBindingType, BufferUsages, ShaderStages};

use crate::gpu::{Gpu, shader};
use crate::render::kernel::TEXEL_ARRAY;
use crate::render::strategy::Strategy;
use crate::render::{Batch, TraceSummary, Tracer};
use crate::scene::Scene;

/// The entry point around the function under test. It uses bind group 1, because group 0 belongs to the shared shaders.
const FRAME: &str = "
@group(1) @binding(0) var<storage, read> input: array<vec4f>;
@group(1) @binding(1) var<storage, read_write> output: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x < arrayLength(&output)) {
        output[id.x] = work(id.x);
    }
}
";

pub(crate) fn gpu() -> Gpu {
    Gpu::open(None, 0).expect("the README's test command installs a Vulkan driver")
}

/// Returns `work(0), …, work(count − 1)`. The WGSL in `source` defines `fn work(index: u32) -> vec4f`; it may import shared shaders and
/// read `input`. `shared` holds the resources of group 0 that these shaders read, with their bindings.
pub(super) fn run(
    gpu: &Gpu,
    source: &str,
    shared: &[(u32, wgpu::BindingResource<'_>)],
    input: &[[f32; 4]],
    count: usize,
) -> Vec<[f32; 4]> {
    let text =
        shader::compose_source("test", &format!("{source}\n{FRAME}")).expect("the test's WGSL is valid");
    let bytes = 16 * count as u64;
    let storage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
    let input = gpu.storage("input", input).expect("the input fits");
    let output = gpu.buffer("output", bytes, storage).expect("the output fits");
    let readback = gpu
        .buffer("read-back", bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST)
        .expect("the read-back fits");

    let shared: Vec<_> =
        shared.iter().map(|(binding, resource)| (*binding, resource.clone(), true)).collect();
    let groups = [shared, vec![(0, input.as_entire_binding(), true), (1, output.as_entire_binding(), false)]];
    gpu.guarded("test", || {
        let layouts = groups.each_ref().map(|group| layout(gpu, group));
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("test"),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("test"),
            layout: Some(&gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: None,
                bind_group_layouts: &layouts.each_ref().map(Some),
                immediate_size: 0,
            })),
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        for ((index, layout), group) in (0..).zip(&layouts).zip(&groups) {
            pass.set_bind_group(index, &bind_group(gpu, layout, group), &[]);
        }
        pass.dispatch_workgroups(count.div_ceil(64) as u32, 1, 1);
        drop(pass);
        encoder.copy_buffer_to_buffer(&output, 0, &readback, 0, bytes);
        gpu.queue.submit([encoder.finish()]);
    })
    .expect("the test's kernel runs");

    readback.map_async(wgpu::MapMode::Read, .., |outcome| outcome.expect("results can be read back"));
    gpu.wait(None).expect("the device is there");
    let view = readback.get_mapped_range(..).expect("results can be read back");
    bytemuck::cast_slice(&view).to_vec()
}

type Entry<'a> = (u32, wgpu::BindingResource<'a>, bool);

fn layout(gpu: &Gpu, group: &[Entry<'_>]) -> wgpu::BindGroupLayout {
    let entry = |(binding, resource, read_only): &Entry<'_>| wgpu::BindGroupLayoutEntry {
        binding: *binding,
        visibility: ShaderStages::COMPUTE,
        ty: match resource {
            wgpu::BindingResource::TextureView(_) => TEXEL_ARRAY,
            _ => BindingType::Buffer {
                ty: BufferBindingType::Storage { read_only: *read_only },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
        },
        count: None,
    };
    gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &group.iter().map(entry).collect::<Vec<_>>(),
    })
}

fn bind_group(gpu: &Gpu, layout: &wgpu::BindGroupLayout, group: &[Entry<'_>]) -> wgpu::BindGroup {
    let entries = group
        .iter()
        .map(|(binding, resource, _)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() });
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout,
        entries: &entries.collect::<Vec<_>>(),
    })
}

/// The record of one path as bits: rays, direct light, ambient light, and connections (camera pixel, projector pixel, value).
pub(super) type PathRecord = (u64, [u32; 3], [u32; 3], Vec<(u32, u32, [u32; 3])>);

pub(super) fn path_records(tracer: &mut Tracer, strategy: &Strategy) -> Vec<PathRecord> {
    let mut records = Vec::new();
    let mut visit = |batch: &Batch<'_>| {
        records.extend((0..batch.len()).map(|path| {
            let connections = batch.connections(path).map(|connection| {
                (connection.camera, connection.projector, connection.value.map(f32::to_bits))
            });
            let ambient = batch.ambient(path).unwrap_or_default();
            let [direct, ambient] = [batch.direct(path), ambient].map(|light| light.map(f32::to_bits));
            (batch.rays(path), direct, ambient, connections.collect())
        }));
        Ok(())
    };
    tracer
        .run(
            (strategy, None),
            0..strategy.paths(),
            strategy.paths(),
            &mut TraceSummary::default(),
            &mut visit,
        )
        .expect("the scene can be traced");
    records
}

pub(crate) fn tracer(scene: &Scene) -> Tracer {
    Tracer::new(scene, None).expect("the README's test command installs a Vulkan driver")
}
