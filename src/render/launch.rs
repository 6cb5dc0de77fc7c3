//! The launch of one strategy: its kernel is bound, dispatches are submitted and awaited in order, and their results become batches.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

use wgpu::BufferUsages;

use super::batch::Batch;
use super::dispatch::{DispatchSizer, Dispatches, PathWork, unfinished_paths};
use super::geometry::GpuScene;
use super::kernel::{Parameters, Pipeline};
use super::photons::PhotonMap;
use super::settings::TraceSummary;
use super::strategy::Strategy;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::{Mapped, Readback, Results};

pub(super) struct SizedKernel {
    pub(super) pipeline: Arc<Pipeline>,
    pub(super) sizer: DispatchSizer,
}

/// A dispatch that was submitted to the device, and whose results have not been read yet.
struct InFlight {
    output: usize,
    readback: Readback,
    start: Instant,
    first_path: u64,
    parameters: Parameters,
}

pub(super) struct StrategyRun<'a> {
    gpu: &'a Gpu,
    scene: &'a GpuScene,
    strategy: &'a Strategy,
    kernel: &'a mut SizedKernel,
    dispatches: &'a mut Dispatches,
    pub(super) outputs: Vec<Output>,
    capacity: u32,
    /// The dispatches in flight, oldest first.
    in_flight: VecDeque<InFlight>,
    /// The numbers of the paths that are not yet launched.
    left: Range<u64>,
    /// The time at which the most recently finished dispatch was done.
    idle_since: Instant,
}

impl<'a> StrategyRun<'a> {
    /// Prepares buffers and bindings for the paths with these numbers. Buffers of `results` that are large enough are reused.
    pub(super) fn new(
        gpu: &'a Gpu,
        scene: &'a GpuScene,
        strategy: &'a Strategy,
        paths: Range<u64>,
        kernel: &'a mut SizedKernel,
        dispatches: &'a mut Dispatches,
        mut results: Vec<Results>,
    ) -> Result<Self> {
        let stride = u64::from(strategy.parameters.stride);
        let total = paths.end - paths.start;
        let capacity = dispatches.capacity(gpu, stride, strategy.max_paths_per_invocation, total);
        let bytes = record_bytes(&strategy.parameters, capacity);
        kernel.sizer.begin(PathWork::of(&strategy.parameters));
        // While the host reads the records of one dispatch, the device writes the records of the next dispatch to a second buffer. If the
        // device is the processor itself, a single buffer is faster, because no dispatch then runs while the host reads, and all cores are
        // free for the host. A dispatch in flight would occupy them: the driver gives each core an equal part of it, and all cores would
        // wait for the core that the host also uses.
        let wanted = if gpu.shares_memory { 1 } else { 2 };
        results.retain(|results| results.buffer.size() >= bytes);
        results.truncate(wanted);
        while results.len() < wanted {
            results.push(Results::new(gpu, "path records", bytes)?);
        }
        let output = |results: Results| {
            let (chains, light_buffer) = (&strategy.chains, &strategy.light_buffer);
            Output::new(gpu, &kernel.pipeline, scene, chains, light_buffer, results)
        };
        let outputs = results.into_iter().map(output).collect::<Result<Vec<Output>>>()?;
        let in_flight = VecDeque::new();
        let idle_since = Instant::now();
        Ok(Self {
            gpu,
            scene,
            strategy,
            kernel,
            dispatches,
            outputs,
            capacity,
            in_flight,
            left: paths,
            idle_since,
        })
    }

    /// Whether there are paths left to launch, and the device can take one more dispatch.
    pub(super) fn can_launch(&self) -> bool {
        let most = self.kernel.sizer.max_in_flight().min(self.outputs.len());
        !self.left.is_empty() && self.in_flight.len() < most
    }

    pub(super) fn launch(&mut self, summary: &mut TraceSummary) -> Result<()> {
        let Self { strategy, left, kernel: SizedKernel { sizer, .. }, .. } = self;
        // The number of paths is at most the capacity, which is a 32-bit number.
        let first_path = left.start;
        let paths = u64::from(sizer.paths(self.capacity)).min(left.end - first_path) as u32;
        let parameters = Parameters {
            paths_per_invocation: sizer.paths_per_invocation(paths, strategy.max_paths_per_invocation),
            ..strategy.parameters.of_paths(first_path, paths, self.dispatches.mark())
        };
        let output = summary.dispatches as usize % self.outputs.len();
        let start = Instant::now();
        let bytes = record_bytes(&parameters, paths);
        let readback = self.outputs[output].launch(self.gpu, &parameters, bytes)?;
        self.in_flight.push_back(InFlight { output, readback, start, first_path, parameters });
        left.start += u64::from(paths);
        summary.dispatches += 1;
        Ok(())
    }

    /// Waits for the oldest dispatch in flight, calls `visit` with its batch, and adds its cost to `summary`. Returns `false` if no
    /// dispatch is in flight. Fails with [`UnfinishedPaths`](crate::Error::UnfinishedPaths) if the driver dropped paths, with
    /// [`Device`](crate::Error::Device) if the device failed, or like `visit`.
    pub(super) fn finish_oldest(
        &mut self,
        summary: &mut TraceSummary,
        visit: &mut dyn FnMut(&Batch<'_>) -> Result<()>,
    ) -> Result<bool> {
        let Some(oldest) = self.in_flight.pop_front() else { return Ok(false) };
        let InFlight { output, readback, start, first_path, mut parameters } = oldest;
        let output = &self.outputs[output];
        let layout = self.strategy.layout;
        let mut view = readback.wait(self.gpu)?;
        let counted = |view: &Mapped, mark: u32| {
            Batch::new(first_path, layout, bytemuck::cast_slice(view)).unfinished_and_rays(mark)
        };
        let (mut unfinished, mut rays) = counted(&view, parameters.mark);
        if unfinished > 0 && parameters.paths_per_invocation > 1 {
            // The invocations looped more often than the driver allows. The paths are traced again, with one path per invocation.
            self.kernel.sizer.one_path_each();
            parameters = Parameters { paths_per_invocation: 1, mark: self.dispatches.mark(), ..parameters };
            drop(view);
            let bytes = record_bytes(&parameters, parameters.paths);
            view = output.run(self.gpu, &parameters, bytes)?;
            (unfinished, rays) = counted(&view, parameters.mark);
        }
        if unfinished > 0 {
            return Err(unfinished_paths(unfinished, u64::from(parameters.paths), self.scene));
        }
        // If a dispatch waited for an earlier one, it began when the earlier one was done.
        let elapsed = start.max(self.idle_since).elapsed();
        self.idle_since = Instant::now();
        let batch = Batch::new(first_path, layout, bytemuck::cast_slice(&view));
        visit(&batch)?;
        summary.rays += rays;
        summary.paths += batch.len() as u64;
        summary.longest = summary.longest.max(elapsed);
        summary.tracing += elapsed;
        self.kernel.sizer.adapt(parameters.paths, elapsed);
        Ok(true)
    }
}

pub(super) fn record_bytes(parameters: &Parameters, paths: u32) -> u64 {
    u64::from(paths) * u64::from(parameters.stride) * 16
}

/// A kernel with its results and all its inputs. It serves one dispatch at a time.
pub(super) struct Output {
    pipeline: wgpu::ComputePipeline,
    parameters: wgpu::Buffer,
    pub(super) results: Results,
    scene_group: wgpu::BindGroup,
    output_group: wgpu::BindGroup,
}

impl Output {
    pub(super) fn new(
        gpu: &Gpu,
        kernel: &Pipeline,
        scene: &GpuScene,
        chains: &PhotonMap,
        light_buffer: &wgpu::TextureView,
        results: Results,
    ) -> Result<Self> {
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let parameters = gpu.buffer("parameters", size_of::<Parameters>() as u64, usage)?;
        gpu.guarded("bindings", || {
            let view = wgpu::BindingResource::TextureView;
            let scene_group = gpu.bind(
                "scene",
                &kernel.scene_layout,
                [
                    parameters.as_entire_binding(),
                    view(&scene.nodes),
                    view(&scene.pairs),
                    view(&scene.materials),
                    view(&scene.corners),
                    scene.textures.as_entire_binding(),
                    view(&scene.texels),
                    scene.srgb_table.as_entire_binding(),
                ],
            );
            let output_group = gpu.bind(
                "output",
                &kernel.output_layout,
                [
                    results.buffer.as_entire_binding(),
                    view(&chains.photons),
                    chains.buckets.as_entire_binding(),
                    view(light_buffer),
                ],
            );
            Self { pipeline: kernel.pipeline.clone(), parameters, results, scene_group, output_group }
        })
    }

    /// Submits one dispatch of `parameters.paths` paths, with `parameters.paths_per_invocation` paths for each invocation, and requests the
    /// first `bytes` of its results.
    pub(super) fn launch(&self, gpu: &Gpu, parameters: &Parameters, bytes: u64) -> Result<Readback> {
        self.results.launch(gpu, "dispatch", bytes, |encoder| self.record(gpu, encoder, parameters))
    }

    /// Records one dispatch. Its parameters are those of the next submission.
    pub(super) fn record(&self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, parameters: &Parameters) {
        gpu.queue.write_buffer(&self.parameters, 0, bytemuck::bytes_of(parameters));
        let mut pass = gpu.pass(encoder, "tracing");
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.scene_group, &[]);
        pass.set_bind_group(1, &self.output_group, &[]);
        pass.dispatch_workgroups(parameters.paths.div_ceil(64 * parameters.paths_per_invocation), 1, 1);
    }

    pub(super) fn run(&self, gpu: &Gpu, parameters: &Parameters, bytes: u64) -> Result<Mapped> {
        self.launch(gpu, parameters, bytes)?.wait(gpu)
    }
}
