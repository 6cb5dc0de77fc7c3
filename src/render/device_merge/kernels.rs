//! The compiled kernels.

use wgpu::{BindingType, BufferBindingType, ShaderStages};

use super::steps::MergeParameters;
use crate::error::Result;
use crate::gpu::{Gpu, shader};

/// The kernels, in the order in which they are kept.
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

/// The bindings of `shaders/shared/merging.wgsl`.
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
