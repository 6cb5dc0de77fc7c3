//! Runs one WGSL function in many invocations, and reads the records of light paths as bits for exact comparisons.

use crate::gpu::buffers::Results;
use crate::gpu::pipeline::{READ, TEXEL_ARRAY, WRITE};
use crate::gpu::{Gpu, shader};
use crate::render::strategy::Strategy;
use crate::render::{Batch, TraceSummary, Tracer};
use crate::scene::Scene;

/// The entry point that calls the function under test. It uses bind group 1, because group 0 belongs to the shared shaders.
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

/// Returns `work(0), …, work(count − 1)`. The WGSL in `source` defines `fn work(index: u32) -> vec4f`; it may import shared shaders and
/// read `input`. `shared` holds the resources of group 0 that the imported shaders read, with their bindings.
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
    let input = gpu.storage("input", input).expect("the input fits");
    let output = Results::new(gpu, "output", bytes).expect("the output fits");
    let shared: Vec<_> =
        shared.iter().map(|(binding, resource)| (*binding, resource.clone(), true)).collect();
    let own = vec![(0, input.as_entire_binding(), true), (1, output.buffer.as_entire_binding(), false)];
    let groups = [shared, own];
    let request = output.launch(gpu, "test", bytes, |encoder| {
        let layouts = groups.each_ref().map(|group| {
            let ty = |resource: &_, is_read| match resource {
                wgpu::BindingResource::TextureView(_) => TEXEL_ARRAY,
                _ if is_read => READ,
                _ => WRITE,
            };
            gpu.layout_at("test", group.iter().map(|(at, resource, is_read)| (*at, ty(resource, *is_read))))
        });
        let module = gpu.module("test", wgpu::ShaderSource::Wgsl(text.into()));
        let [pipeline] = gpu.pipelines("test", &module, &layouts.each_ref(), ["main"]);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        for ((index, layout), group) in (0..).zip(&layouts).zip(&groups) {
            let resources = group.iter().map(|(at, resource, _)| (*at, resource.clone()));
            pass.set_bind_group(index, &gpu.bind_at("test", layout, resources), &[]);
        }
        pass.dispatch_workgroups(count.div_ceil(64) as u32, 1, 1);
    });
    let request = request.expect("the test's kernel runs");
    let view = request.wait(gpu).expect("results can be read back");
    bytemuck::cast_slice(&view).to_vec()
}

/// The record of one path as bits: rays, direct light, ambient light, and connections (camera pixel, projector pixel, value).
pub(super) type PathRecord = (u64, [u32; 3], [u32; 3], Vec<(u32, u32, [u32; 3])>);

pub(super) fn path_records(tracer: &mut Tracer, strategy: &Strategy) -> Vec<PathRecord> {
    let mut records = Vec::new();
    trace(tracer, strategy, |batch| {
        records.extend((0..batch.len()).map(|path| {
            let connections = batch.connections(path).map(|connection| {
                (connection.camera, connection.projector, connection.value.map(f32::to_bits))
            });
            let ambient = batch.ambient(path).unwrap_or_default();
            let [direct, ambient] = [batch.direct(path), ambient].map(|light| light.map(f32::to_bits));
            (batch.rays(path), direct, ambient, connections.collect())
        }));
    });
    records
}

/// Traces all paths of a strategy.
pub(super) fn trace(tracer: &mut Tracer, strategy: &Strategy, mut visit: impl FnMut(&Batch<'_>)) {
    let summary = &mut TraceSummary::default();
    let mut visit = |batch: &Batch<'_>| {
        visit(batch);
        Ok(())
    };
    tracer
        .run(strategy, 0..strategy.paths(), strategy.paths(), summary, &mut visit)
        .expect("the scene can be traced");
}

pub(crate) fn tracer(scene: &Scene) -> Tracer {
    Tracer::new(scene, None).expect("the README's test command installs a Vulkan driver")
}
