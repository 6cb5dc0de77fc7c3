//! Compute pipelines, the buffers and textures that are bound to them, and their dispatches. Layouts, bindings and pipelines must be made
//! within [`Gpu::guarded`].

use std::borrow::Cow;

use bytemuck::Pod;
use wgpu::{
    BindGroupLayout, BindGroupLayoutEntry, BindingResource, BindingType, BufferBindingType, BufferUsages,
    CommandEncoder, ComputePipeline, ShaderModule, ShaderSource, ShaderStages,
};

use super::{Gpu, shader};
use crate::error::Result;

/// A uniform buffer.
pub(crate) const UNIFORM: BindingType = buffer(BufferBindingType::Uniform);

/// A storage buffer that the kernel only reads.
pub(crate) const READ: BindingType = buffer(BufferBindingType::Storage { read_only: true });

/// A storage buffer that the kernel writes.
pub(crate) const WRITE: BindingType = buffer(BufferBindingType::Storage { read_only: false });

/// A read-only storage texture, which serves as an array of texels.
pub(crate) const TEXEL_ARRAY: BindingType = BindingType::StorageTexture {
    access: wgpu::StorageTextureAccess::ReadOnly,
    format: wgpu::TextureFormat::Rgba32Uint,
    view_dimension: wgpu::TextureViewDimension::D2,
};

const fn buffer(ty: BufferBindingType) -> BindingType {
    BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
}

/// The maximum number of workgroups in a dimension that every device allows.
const MOST_GROUPS: u32 = 65_535;

/// The numbers of workgroups in two dimensions that cover `groups` workgroups. The second number is as small as possible.
pub(crate) fn grid(groups: u32) -> [u32; 2] {
    let down = groups.div_ceil(MOST_GROUPS).max(1);
    [groups.div_ceil(down), down]
}

impl Gpu {
    /// The layout of bindings of these types. It is explicit, because an automatic layout omits bindings that a kernel does not use.
    pub(crate) fn layout(&self, label: &str, types: &[BindingType]) -> BindGroupLayout {
        self.layout_at(label, (0..).zip(types.iter().copied()))
    }

    /// Works like [`Gpu::layout`], for bindings of any numbers.
    pub(crate) fn layout_at(
        &self,
        label: &str,
        types: impl IntoIterator<Item = (u32, BindingType)>,
    ) -> BindGroupLayout {
        let entry = |(binding, ty)| BindGroupLayoutEntry {
            binding,
            visibility: ShaderStages::COMPUTE,
            ty,
            count: None,
        };
        let entries: Vec<_> = types.into_iter().map(entry).collect();
        let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries };
        self.device.create_bind_group_layout(&descriptor)
    }

    /// Binds these buffers and textures in the order of their layout.
    pub(crate) fn bind<'a>(
        &self,
        label: &str,
        layout: &BindGroupLayout,
        resources: impl IntoIterator<Item = BindingResource<'a>>,
    ) -> wgpu::BindGroup {
        self.bind_at(label, layout, (0..).zip(resources))
    }

    /// Works like [`Gpu::bind`], for bindings of any numbers.
    pub(crate) fn bind_at<'a>(
        &self,
        label: &str,
        layout: &BindGroupLayout,
        resources: impl IntoIterator<Item = (u32, BindingResource<'a>)>,
    ) -> wgpu::BindGroup {
        let entry = |(binding, resource)| wgpu::BindGroupEntry { binding, resource };
        let entries: Vec<_> = resources.into_iter().map(entry).collect();
        let descriptor = wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries };
        self.device.create_bind_group(&descriptor)
    }

    pub(crate) fn module(&self, label: &str, source: ShaderSource<'_>) -> ShaderModule {
        self.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(label), source })
    }

    /// Works like [`Gpu::module`], without the checks that each index is in bounds and that each loop ends, which take half the time of short
    /// loops over workgroup memory.
    ///
    /// # Safety
    /// The shader must not, for any contents of the buffers, read or write out of their bounds, and its loops must end.
    #[allow(unsafe_code, reason = "wgpu cannot know that indices are in bounds")]
    pub(crate) unsafe fn unchecked_module(&self, label: &str, source: ShaderSource<'_>) -> ShaderModule {
        let description = wgpu::ShaderModuleDescriptor { label: Some(label), source };
        // SAFETY: the caller guarantees what the checks would.
        unsafe {
            self.device.create_shader_module_trusted(description, wgpu::ShaderRuntimeChecks::unchecked())
        }
    }

    /// Compiles these entry points of a shader. `layouts` are the layouts of its bind groups.
    pub(crate) fn pipelines<const N: usize>(
        &self,
        label: &str,
        module: &ShaderModule,
        layouts: &[&BindGroupLayout],
        entry_points: [&str; N],
    ) -> [ComputePipeline; N] {
        let layouts: Vec<_> = layouts.iter().copied().map(Some).collect();
        let layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(label),
            bind_group_layouts: &layouts,
            immediate_size: 0,
        });
        entry_points.map(|entry_point| {
            self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry_point),
                layout: Some(&layout),
                module,
                entry_point: Some(entry_point),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: self.pipeline_cache(),
            })
        })
    }

    /// Submits the commands that `record` records. Fails with [`Error::Device`](crate::Error::Device) if the device fails.
    pub(crate) fn submit(
        &self,
        what: &str,
        record: impl FnOnce(&mut CommandEncoder),
    ) -> Result<wgpu::SubmissionIndex> {
        self.guarded(what, || {
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            record(&mut encoder);
            self.queue.submit([encoder.finish()])
        })
    }
}

/// A compiled kernel. Its parameters are bound first, and then buffers.
#[derive(Clone)]
pub(crate) struct Kernel {
    /// The entry point.
    name: &'static str,
    pipeline: ComputePipeline,
    layout: BindGroupLayout,
}

impl Kernel {
    /// The kernels of these entry points of the shader `name`. `module` makes its module.
    pub(crate) fn all<const N: usize>(
        gpu: &Gpu,
        name: &str,
        entry_points: [&'static str; N],
        constants: &[(&str, f64)],
        buffers: &[BindingType],
        module: impl FnOnce(ShaderSource<'_>) -> ShaderModule,
    ) -> Result<[Self; N]> {
        let source = ShaderSource::Naga(Cow::Owned(shader::kernel(name, constants)?));
        gpu.guarded(name, || {
            let layout = gpu.layout(name, &[&[UNIFORM][..], buffers].concat());
            let mut pipelines = gpu.pipelines(name, &module(source), &[&layout], entry_points).into_iter();
            entry_points.map(|name| {
                let pipeline = pipelines.next().expect("each entry point has a pipeline");
                Self { name, pipeline, layout: layout.clone() }
            })
        })
    }

    /// The dispatch of `groups` workgroups with these parameters and buffers. It can be recorded several times.
    pub(crate) fn step(
        &self,
        gpu: &Gpu,
        parameters: &impl Pod,
        buffers: &[&wgpu::Buffer],
        groups: u32,
    ) -> Result<Step> {
        let bytes = bytemuck::bytes_of(parameters);
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let uniform = gpu.buffer("parameters", bytes.len() as u64, usage)?;
        let group = gpu.guarded("bindings", || {
            gpu.queue.write_buffer(&uniform, 0, bytes);
            let buffers = std::iter::once(&uniform).chain(buffers.iter().copied());
            gpu.bind(self.name, &self.layout, buffers.map(wgpu::Buffer::as_entire_binding))
        })?;
        Ok(Step { name: self.name, pipeline: self.pipeline.clone(), group, uniform, groups: grid(groups) })
    }
}

pub(crate) struct Step {
    /// The entry point of the kernel.
    pub(crate) name: &'static str,
    pipeline: ComputePipeline,
    group: wgpu::BindGroup,
    uniform: wgpu::Buffer,
    groups: [u32; 2],
}

impl Step {
    /// Changes the parameters and the number of workgroups, for dispatches that are submitted from now on.
    pub(crate) fn change(&mut self, gpu: &Gpu, parameters: &impl Pod, groups: u32) -> Result<()> {
        self.groups = grid(groups);
        gpu.guarded("parameters", || {
            gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(parameters));
        })
    }

    /// Records dispatches one after the other, as one pass.
    pub(crate) fn record<'a>(
        gpu: &Gpu,
        what: &'static str,
        steps: impl IntoIterator<Item = &'a Self>,
        encoder: &mut CommandEncoder,
    ) {
        let mut pass = gpu.pass(encoder, what);
        for Self { pipeline, group, groups: [across, down], .. } in steps {
            if *across > 0 {
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, group, &[]);
                pass.dispatch_workgroups(*across, *down, 1);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workgroups_are_enough_and_within_the_limits() {
        for groups in [0, 1, 2, 65_535, 65_536, 1 << 20, 134_217_728] {
            let [across, down] = grid(groups);
            assert!(across <= MOST_GROUPS && down <= MOST_GROUPS, "{groups}");
            assert!(across * down >= groups, "{groups}");
            assert!(across * down < groups + down.max(1), "{groups}: nearly none for nothing");
        }
    }
}
