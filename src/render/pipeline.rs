//! Compiled compute kernels that read a scene.

use std::borrow::Cow;

use wgpu::{BindGroupLayoutEntry, BindingType, BufferBindingType, ShaderStages};

use super::features::Features;
use crate::error::Result;
use crate::gpu::{Gpu, shader};

/// A compiled kernel. Bind group 0 holds parameters and scene; group 1 holds the results, the photon map and
/// the light buffer.
pub(super) struct Pipeline {
    pub(super) pipeline: wgpu::ComputePipeline,
    pub(super) scene_layout: wgpu::BindGroupLayout,
    pub(super) output_layout: wgpu::BindGroupLayout,
}

impl Pipeline {
    /// Composes and compiles the shader `name` for a scene and rig with these features. Its entry point has
    /// the same name.
    pub(super) fn new(gpu: &Gpu, name: &str, features: &Features) -> Result<Self> {
        let kernel = shader::kernel(name, &features.constants())?;
        gpu.guarded(name, || {
            let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Naga(Cow::Owned(kernel)),
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
                    TEXEL_ARRAY,
                    TEXEL_ARRAY,
                    storage(true),
                    TEXEL_ARRAY,
                    storage(true),
                ],
            );
            let output_layout =
                bind_group_layout(gpu, "output", &[storage(false), TEXEL_ARRAY, storage(true), TEXEL_ARRAY]);
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
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: gpu.pipeline_cache(),
            });
            Self { pipeline, scene_layout, output_layout }
        })
    }
}

/// The photon map of an endpoint's specular chains, as the shaders read it.
#[derive(Clone)]
pub(super) struct PhotonBuffers {
    pub(super) photons: wgpu::TextureView,
    pub(super) buckets: wgpu::Buffer,
}

/// A read-only storage texture, which serves as an array of texels.
pub(super) const TEXEL_ARRAY: BindingType = BindingType::StorageTexture {
    access: wgpu::StorageTextureAccess::ReadOnly,
    format: wgpu::TextureFormat::Rgba32Uint,
    view_dimension: wgpu::TextureViewDimension::D2,
};

/// A storage buffer.
fn storage(read_only: bool) -> BindingType {
    BindingType::Buffer {
        ty: BufferBindingType::Storage { read_only },
        has_dynamic_offset: false,
        min_binding_size: None,
    }
}

/// The layout with these bindings. It is explicit, because an automatic layout omits the bindings that a
/// kernel does not use.
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
