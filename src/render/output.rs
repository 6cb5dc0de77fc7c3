//! The buffers of a kernel's parameters and results, and its dispatches.

use wgpu::BufferUsages;

use super::device_merge::{DeviceMerge, MergeRequest};
use super::geometry::GpuScene;
use super::parameters::Parameters;
use super::pipeline::{PhotonBuffers, Pipeline};
use super::records::Layout;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::readback::{Readback, Results};

/// The staging buffers of one dispatch: its parameters, and its results. Clones share them.
#[derive(Clone)]
pub(super) struct StagingBuffers {
    parameters: wgpu::Buffer,
    results: Results,
}

impl StagingBuffers {
    /// Room for `bytes` of results.
    pub(super) fn new(gpu: &Gpu, bytes: u64) -> Result<Self> {
        let results = Results::new(gpu, "path records", bytes)?;
        let uniform_bytes = size_of::<Parameters>() as u64;
        let parameters =
            gpu.buffer("parameters", uniform_bytes, BufferUsages::UNIFORM | BufferUsages::COPY_DST)?;
        Ok(Self { parameters, results })
    }

    /// The buffer of the results.
    pub(super) fn buffer(&self) -> &wgpu::Buffer {
        &self.results.buffer
    }

    /// The room for results, in bytes.
    pub(super) fn bytes(&self) -> u64 {
        self.results.buffer.size()
    }
}

/// The bindings of a kernel: its staging buffers, and everything that it reads. It serves one dispatch at a
/// time.
pub(super) struct Output {
    staging: StagingBuffers,
    scene_group: wgpu::BindGroup,
    output_group: wgpu::BindGroup,
}

impl Output {
    /// Binds `scene`, the photon map `chains`, the light buffer and `staging` to `kernel`.
    pub(super) fn new(
        gpu: &Gpu,
        kernel: &Pipeline,
        scene: &GpuScene,
        chains: &PhotonBuffers,
        light_buffer: &wgpu::TextureView,
        staging: StagingBuffers,
    ) -> Result<Self> {
        gpu.guarded("bindings", || {
            let view = wgpu::BindingResource::TextureView;
            let scene_group = bind_group(
                gpu,
                &kernel.scene_layout,
                [
                    staging.parameters.as_entire_binding(),
                    view(&scene.nodes),
                    view(&scene.pairs),
                    view(&scene.materials),
                    view(&scene.corners),
                    scene.textures.as_entire_binding(),
                    view(&scene.texels),
                    scene.srgb_table.as_entire_binding(),
                ],
            );
            let output_group = bind_group(
                gpu,
                &kernel.output_layout,
                [
                    staging.results.buffer.as_entire_binding(),
                    view(&chains.photons),
                    chains.buckets.as_entire_binding(),
                    view(light_buffer),
                ],
            );
            Self { staging: staging.clone(), scene_group, output_group }
        })
    }

    /// Submits one dispatch of `parameters.paths` paths, `parameters.paths_per_invocation` for each
    /// invocation, and requests the first `bytes` of its results. With `merge`, their contributions become terms.
    pub(super) fn launch(
        &self,
        gpu: &Gpu,
        kernel: &Pipeline,
        parameters: &Parameters,
        bytes: u64,
        merge: Option<(&DeviceMerge, &MergeRequest<'_>, &Layout)>,
    ) -> Result<(Readback, wgpu::SubmissionIndex)> {
        let submission = gpu.guarded("dispatch", || {
            gpu.queue.write_buffer(&self.staging.parameters, 0, bytemuck::bytes_of(parameters));
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&kernel.pipeline);
            pass.set_bind_group(0, &self.scene_group, &[]);
            pass.set_bind_group(1, &self.output_group, &[]);
            pass.dispatch_workgroups(parameters.paths.div_ceil(64 * parameters.paths_per_invocation), 1, 1);
            drop(pass);
            if let Some((merge, request, layout)) = merge {
                merge.record(gpu, &mut encoder, request, layout, parameters.paths);
            }
            self.staging.results.submit(gpu, encoder, bytes)
        })?;
        Ok((self.staging.results.request(bytes, submission.clone()), submission))
    }

    /// Waits for a dispatch that this output launched, and returns its results. Drop the view and call
    /// [`Output::release`] before the next launch.
    pub(super) fn wait(&self, gpu: &Gpu, in_flight: Readback) -> Result<wgpu::BufferView> {
        self.staging.results.wait(gpu, in_flight)
    }

    /// Launches a dispatch and waits for it.
    pub(super) fn run(
        &self,
        gpu: &Gpu,
        kernel: &Pipeline,
        parameters: &Parameters,
        bytes: u64,
    ) -> Result<wgpu::BufferView> {
        let (readback, _) = self.launch(gpu, kernel, parameters, bytes, None)?;
        self.wait(gpu, readback)
    }

    /// Makes the results writable again for the device, after their view has been dropped.
    pub(super) fn release(&self) {
        self.staging.results.release();
    }
}

/// The resources as bindings 0, 1, and so on.
fn bind_group<const N: usize>(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    resources: [wgpu::BindingResource<'_>; N],
) -> wgpu::BindGroup {
    let entries: Vec<_> =
        (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}
