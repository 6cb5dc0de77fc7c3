//! A compute kernel over a scene, and the buffers that its results come back through.

use wgpu::{BindGroupLayoutEntry, BindingType, BufferBindingType, BufferUsages, ShaderStages};

use super::features::Features;
use super::geometry::GpuScene;
use super::parameters::Parameters;
use crate::error::{Error, Result};
use crate::gpu::{Gpu, shader};

/// A kernel whose group 0 is the scene and whose group 1 is its output, with what a strategy prepared for it: the chains to gather
/// from and the lists to see by.
pub(super) struct Pipeline {
    pipeline: wgpu::ComputePipeline,
    scene_layout: wgpu::BindGroupLayout,
    output_layout: wgpu::BindGroupLayout,
}

impl Pipeline {
    /// Composes and compiles the shader `name`, whose entry point has the same name, for a scene and rig with these features.
    pub(super) fn new(gpu: &Gpu, name: &str, features: &Features) -> Result<Self> {
        let source = shader::compose(name)?;
        gpu.guarded(name, || {
            let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            });
            let scene_layout = bind_group_layout(
                gpu,
                "scene",
                &[
                    BindingType::Buffer {
                        ty: BufferBindingType::Uniform,
                        has_dynamic_offset: false,
                        min_binding_size: None,
                    },
                    TEXEL_ARRAY,
                    TEXEL_ARRAY,
                    storage(true),
                    TEXEL_ARRAY,
                    storage(true),
                    TEXEL_ARRAY,
                    storage(true),
                ],
            );
            let output_layout = bind_group_layout(
                gpu,
                "output",
                &[storage(false), storage(true), storage(true), TEXEL_ARRAY],
            );
            let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(name),
                bind_group_layouts: &[Some(&scene_layout), Some(&output_layout)],
                immediate_size: 0,
            });
            let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(&layout),
                module: &module,
                entry_point: Some(name),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &features.constants(),
                    ..Default::default()
                },
                cache: None,
            });
            Self { pipeline, scene_layout, output_layout }
        })
    }

    /// Buffers for `bytes` of results of this kernel over `scene`, with these chains to gather from and lists to see by.
    pub(super) fn output(
        &self,
        gpu: &Gpu,
        scene: &GpuScene,
        chains: &PhotonBuffers,
        sight: &wgpu::TextureView,
        bytes: u64,
    ) -> Result<Output> {
        let results = gpu.buffer("path records", bytes, BufferUsages::STORAGE | BufferUsages::COPY_SRC)?;
        let readback = gpu.buffer("read-back", bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?;
        let uniform_bytes = size_of::<Parameters>() as u64;
        let parameters =
            gpu.buffer("parameters", uniform_bytes, BufferUsages::UNIFORM | BufferUsages::COPY_DST)?;
        gpu.guarded("bindings", || {
            let view = wgpu::BindingResource::TextureView;
            let scene_group = bind_group(
                gpu,
                &self.scene_layout,
                [
                    parameters.as_entire_binding(),
                    view(&scene.nodes),
                    view(&scene.triangles),
                    scene.materials.as_entire_binding(),
                    view(&scene.corners),
                    scene.textures.as_entire_binding(),
                    view(&scene.texels),
                    scene.srgb_table.as_entire_binding(),
                ],
            );
            let output_group = bind_group(
                gpu,
                &self.output_layout,
                [
                    results.as_entire_binding(),
                    chains.photons.as_entire_binding(),
                    chains.buckets.as_entire_binding(),
                    view(sight),
                ],
            );
            Output { parameters, results, readback, scene_group, output_group }
        })
    }
}

/// The specular chains of an eye as the shaders read them.
pub(super) struct PhotonBuffers {
    pub(super) photons: wgpu::Buffer,
    pub(super) buckets: wgpu::Buffer,
}

/// Where a kernel's results land and are read from.
pub(super) struct Output {
    parameters: wgpu::Buffer,
    results: wgpu::Buffer,
    readback: wgpu::Buffer,
    scene_group: wgpu::BindGroup,
    output_group: wgpu::BindGroup,
}

impl Output {
    /// One dispatch of `parameters.paths` invocations; returns the first `bytes` of its results. Drop the view and call
    /// [`Output::release`] before the next one.
    pub(super) fn run(
        &self,
        gpu: &Gpu,
        kernel: &Pipeline,
        parameters: &Parameters,
        bytes: u64,
    ) -> Result<wgpu::BufferView> {
        gpu.guarded("dispatch", || {
            gpu.queue.write_buffer(&self.parameters, 0, bytemuck::bytes_of(parameters));
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&kernel.pipeline);
            pass.set_bind_group(0, &self.scene_group, &[]);
            pass.set_bind_group(1, &self.output_group, &[]);
            pass.dispatch_workgroups(parameters.paths.div_ceil(64), 1, 1);
            drop(pass);
            encoder.copy_buffer_to_buffer(&self.results, 0, &self.readback, 0, bytes);
            gpu.queue.submit([encoder.finish()]);
        })?;
        let (sender, receiver) = std::sync::mpsc::channel();
        self.readback.map_async(wgpu::MapMode::Read, 0..bytes, move |outcome| {
            // The receiver outlives the wait below, which runs this callback.
            let _ = sender.send(outcome);
        });
        gpu.wait()?;
        let lost = |reason: String| Error::Device {
            fault: format!("results cannot be read back from {}: {reason}", gpu.summary.name),
            help: "run again; if it happens again, choose another --adapter".into(),
        };
        match receiver.try_recv() {
            Ok(Ok(())) => self.readback.get_mapped_range(0..bytes).map_err(|e| lost(e.to_string())),
            Ok(Err(e)) => Err(lost(e.to_string())),
            Err(e) => Err(lost(e.to_string())),
        }
    }

    pub(super) fn release(&self) {
        self.readback.unmap();
    }
}

pub(super) const TEXEL_ARRAY: BindingType = BindingType::StorageTexture {
    access: wgpu::StorageTextureAccess::ReadOnly,
    format: wgpu::TextureFormat::Rgba32Uint,
    view_dimension: wgpu::TextureViewDimension::D2,
};

fn storage(read_only: bool) -> BindingType {
    BindingType::Buffer {
        ty: BufferBindingType::Storage { read_only },
        has_dynamic_offset: false,
        min_binding_size: None,
    }
}

/// Explicit, since an automatic layout drops the bindings that a kernel does not use.
fn bind_group_layout(gpu: &Gpu, label: &str, types: &[BindingType]) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = (0..)
        .zip(types)
        .map(|(binding, &ty)| BindGroupLayoutEntry {
            binding,
            visibility: ShaderStages::COMPUTE,
            ty,
            count: None,
        })
        .collect();
    gpu.device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

fn bind_group<const N: usize>(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    resources: [wgpu::BindingResource<'_>; N],
) -> wgpu::BindGroup {
    let entries: Vec<_> =
        (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}
