//! Compute pipelines, and the buffers and textures that are bound to them. All functions must be called within [`Gpu::guarded`].

use wgpu::{BindGroupLayoutEntry, BindingType, BufferBindingType, ShaderStages};

use super::Gpu;

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
    pub(crate) fn layout(&self, label: &str, types: &[BindingType]) -> wgpu::BindGroupLayout {
        let entry = |(binding, &ty)| BindGroupLayoutEntry {
            binding,
            visibility: ShaderStages::COMPUTE,
            ty,
            count: None,
        };
        let entries: Vec<_> = (0..).zip(types).map(entry).collect();
        let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries };
        self.device.create_bind_group_layout(&descriptor)
    }

    /// Binds these buffers and textures in the order of their layout.
    pub(crate) fn bind<'a>(
        &self,
        label: &str,
        layout: &wgpu::BindGroupLayout,
        resources: impl IntoIterator<Item = wgpu::BindingResource<'a>>,
    ) -> wgpu::BindGroup {
        let entry = |(binding, resource)| wgpu::BindGroupEntry { binding, resource };
        let entries: Vec<_> = (0..).zip(resources).map(entry).collect();
        let descriptor = wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries };
        self.device.create_bind_group(&descriptor)
    }

    /// Compiles these entry points of a shader. `layouts` are the layouts of its bind groups.
    pub(crate) fn pipelines<const N: usize>(
        &self,
        label: &str,
        source: wgpu::ShaderSource<'_>,
        layouts: &[&wgpu::BindGroupLayout],
        entry_points: [&str; N],
    ) -> [wgpu::ComputePipeline; N] {
        let description = wgpu::ShaderModuleDescriptor { label: Some(label), source };
        let module = self.device.create_shader_module(description);
        self.pipelines_of(label, &module, layouts, entry_points)
    }

    /// Works like [`Gpu::pipelines`], without the checks that each index is in bounds and that each loop ends, which take half the time of
    /// short loops over workgroup memory.
    ///
    /// # Safety
    /// Whatever the buffers contain, the shader must not read or write out of their bounds, and its loops must end.
    #[allow(unsafe_code, reason = "wgpu cannot know that indices are in bounds")]
    pub(crate) unsafe fn unchecked_pipelines<const N: usize>(
        &self,
        label: &str,
        source: wgpu::ShaderSource<'_>,
        layouts: &[&wgpu::BindGroupLayout],
        entry_points: [&str; N],
    ) -> [wgpu::ComputePipeline; N] {
        let description = wgpu::ShaderModuleDescriptor { label: Some(label), source };
        let checks = wgpu::ShaderRuntimeChecks::unchecked();
        // SAFETY: the caller guarantees what the checks would.
        let module = unsafe { self.device.create_shader_module_trusted(description, checks) };
        self.pipelines_of(label, &module, layouts, entry_points)
    }

    fn pipelines_of<const N: usize>(
        &self,
        label: &str,
        module: &wgpu::ShaderModule,
        layouts: &[&wgpu::BindGroupLayout],
        entry_points: [&str; N],
    ) -> [wgpu::ComputePipeline; N] {
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

    pub(crate) fn encoder(&self) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
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
