//! The launch of one strategy: its kernel is bound, dispatches are submitted and awaited in order, and their results become batches.

use std::collections::VecDeque;
use std::ops::Range;
use std::time::Instant;

use wgpu::BufferUsages;

use super::batch::{Batch, RecordLayout};
use super::device_merge::{DeviceMerge, MergeInFlight, MergeRequest, MergedView, Trust, agree, host_terms};
use super::dispatch::{DispatchSizer, Dispatches, PathWork, unfinished_paths};
use super::geometry::GpuScene;
use super::kernel::{Parameters, Pipeline};
use super::photons::PhotonMap;
use super::settings::TraceSummary;
use super::strategy::Strategy;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::{Readback, Results};

pub(super) struct SizedKernel {
    pub(super) pipeline: Pipeline,
    pub(super) sizer: DispatchSizer,
}

/// A dispatch that was submitted to the device, and whose results have not been read yet.
struct InFlight {
    output: usize,
    readback: Readback,
    start: Instant,
    first_path: u64,
    parameters: Parameters,
    /// The state of sorting and summing the contributions of the dispatch, if the device does so.
    merge: Option<MergeInFlight>,
}

/// The host also sums each dispatch until a dispatch of at least this many paths agrees with the device. So many paths fill more than one
/// block of the device's kernels.
const CHECKED_PATHS: u32 = 2048;

pub(super) struct StrategyRun<'a> {
    gpu: &'a Gpu,
    scene: &'a GpuScene,
    strategy: &'a Strategy,
    kernel: &'a mut SizedKernel,
    dispatches: &'a mut Dispatches,
    pub(super) outputs: Vec<Output>,
    /// The merge of each output, if the device sorts and sums contributions.
    merges: Vec<DeviceMerge>,
    merging: Option<(&'a MergeRequest<'a>, &'a mut Trust)>,
    capacity: u32,
    /// The dispatches in flight, oldest first.
    in_flight: VecDeque<InFlight>,
    /// The numbers of the paths that are not yet launched.
    left: Range<u64>,
    /// The time at which the most recently finished dispatch was done.
    idle_since: Instant,
}

impl<'a> StrategyRun<'a> {
    /// Prepares buffers and bindings for the paths with these numbers. Buffers of `staging` that are large enough are reused.
    pub(super) fn new(
        gpu: &'a Gpu,
        scene: &'a GpuScene,
        strategy: &'a Strategy,
        paths: Range<u64>,
        kernel: &'a mut SizedKernel,
        dispatches: &'a mut Dispatches,
        (mut staging, mut merging): (Vec<StagingBuffers>, Option<(&'a MergeRequest<'a>, &'a mut Trust)>),
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
        staging.retain(|buffers| buffers.bytes() >= bytes);
        staging.truncate(wanted);
        while staging.len() < wanted {
            staging.push(StagingBuffers::new(gpu, bytes)?);
        }
        let output = |buffers: StagingBuffers| {
            let (chains, light_buffer) = (&strategy.chains, &strategy.light_buffer);
            Output::new(gpu, &kernel.pipeline, scene, chains, light_buffer, buffers)
        };
        let outputs = staging.into_iter().map(output).collect::<Result<Vec<Output>>>()?;
        let mut merges = Vec::new();
        if let Some((request, trust)) = &mut merging {
            let of = (&strategy.layout, strategy.parameters.end.pixels());
            // If the device lacks memory, or cannot compile the kernels, the host sorts and sums.
            let made: Result<Option<Vec<DeviceMerge>>> = trust.kernels(gpu).and_then(|kernels| {
                let merge = |output: &Output| {
                    let records = &output.staging.results.buffer;
                    DeviceMerge::new(gpu, &kernels, request.channels, of, capacity, records)
                };
                outputs.iter().map(merge).collect()
            });
            merges = made.ok().flatten().unwrap_or_default();
        }
        if merges.is_empty() {
            merging = None;
        }
        let in_flight = VecDeque::new();
        let idle_since = Instant::now();
        Ok(Self {
            gpu,
            scene,
            strategy,
            kernel,
            dispatches,
            outputs,
            merges,
            merging,
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
        let samples = u64::from(strategy.parameters.samples);
        let merging = self.merging.as_ref().filter(|(_, trust)| !trust.is_lost);
        // The number of paths is at most the capacity, which is a 32-bit number.
        let first_path = left.start;
        let mut paths = u64::from(sizer.paths(self.capacity));
        if merging.is_some() {
            paths = (paths / samples * samples).max(samples);
        }
        let paths = paths.min(left.end - first_path) as u32;
        let parameters = Parameters {
            first_pixel: (first_path / samples) as u32,
            first_sample: (first_path % samples) as u32,
            paths,
            mark: self.dispatches.mark(),
            paths_per_invocation: sizer.paths_per_invocation(paths, strategy.max_paths_per_invocation),
            ..strategy.parameters
        };
        let output = summary.dispatches as usize % self.outputs.len();
        let start = Instant::now();
        // The host needs whole records unless the device merges contributions and this has been checked. Then it needs only the heads, or
        // also the ambient light at the end of the records.
        let needs_all = merging.is_none_or(|(_, trust)| !trust.is_checked) || strategy.layout.ambient;
        let bytes = if needs_all { record_bytes(&parameters, paths) } else { u64::from(paths) * 16 };
        let merge = merging.map(|(request, _)| (&self.merges[output], *request, &strategy.layout));
        let (readback, submission) = self.outputs[output].launch(self.gpu, &parameters, bytes, merge)?;
        let merge = merge.map(|(merge, ..)| merge.request(submission, parameters.first_pixel));
        self.in_flight.push_back(InFlight { output, readback, start, first_path, parameters, merge });
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
        let InFlight { output: index, readback, start, first_path, mut parameters, mut merge } = oldest;
        let output = &self.outputs[index];
        let layout = self.strategy.layout;
        let paths = parameters.paths as usize;
        let mut view = output.wait(self.gpu, readback)?;
        let counted = |view: &wgpu::BufferView, mark: u32| {
            Batch::merged(first_path, layout, paths, (bytemuck::cast_slice(view), None))
                .unfinished_and_rays(mark)
        };
        let (mut unfinished, mut rays) = counted(&view, parameters.mark);
        if unfinished > 0 && parameters.paths_per_invocation > 1 {
            // The invocations looped more often than the driver allows. The paths are traced again, with one path per invocation.
            self.kernel.sizer.one_path_each();
            parameters = Parameters { paths_per_invocation: 1, mark: self.dispatches.mark(), ..parameters };
            drop(view);
            output.release();
            let bytes = record_bytes(&parameters, parameters.paths);
            view = output.run(self.gpu, &parameters, bytes)?;
            (unfinished, rays) = counted(&view, parameters.mark);
            // The host sums the contributions of the paths that were traced again.
            if let Some(merge) = merge.take() {
                drop(self.merges[index].wait(self.gpu, merge)?);
                self.merges[index].release();
            }
        }
        if unfinished > 0 {
            return Err(unfinished_paths(unfinished, paths as u64, self.scene));
        }
        let merged = merge.map(|merge| self.merges[index].wait(self.gpu, merge)).transpose()?;
        // If a dispatch waited for an earlier one, it began when the earlier one was done.
        let elapsed = start.max(self.idle_since).elapsed();
        self.idle_since = Instant::now();
        let records = bytemuck::cast_slice(&view);
        let mut terms = merged.as_ref().map(MergedView::merged);
        if let (Some(found), Some((request, trust))) = (&terms, &mut self.merging)
            && !trust.is_checked
        {
            let batch = Batch::merged(first_path, layout, paths, (records, None));
            trust.is_lost = !agree(found, &host_terms(&batch, request));
            trust.is_checked = trust.is_lost || parameters.paths >= CHECKED_PATHS;
        }
        if self.merging.as_ref().is_some_and(|(_, trust)| trust.is_lost) {
            terms = None;
        }
        summary.merged += u32::from(terms.is_some());
        let batch = Batch::merged(first_path, layout, paths, (records, terms));
        visit(&batch)?;
        summary.rays += rays;
        summary.paths += batch.len() as u64;
        summary.longest = summary.longest.max(elapsed);
        summary.tracing += elapsed;
        drop(view);
        output.release();
        if merged.is_some() {
            drop(merged);
            self.merges[index].release();
        }
        self.kernel.sizer.adapt(parameters.paths, elapsed);
        Ok(true)
    }
}

fn record_bytes(parameters: &Parameters, paths: u32) -> u64 {
    u64::from(paths) * u64::from(parameters.stride) * 16
}

/// The staging buffers of one dispatch: its parameters, and its results.
pub(super) struct StagingBuffers {
    parameters: wgpu::Buffer,
    results: Results,
}

impl StagingBuffers {
    pub(super) fn new(gpu: &Gpu, bytes: u64) -> Result<Self> {
        let results = Results::new(gpu, "path records", bytes)?;
        let uniform_bytes = size_of::<Parameters>() as u64;
        let parameters =
            gpu.buffer("parameters", uniform_bytes, BufferUsages::UNIFORM | BufferUsages::COPY_DST)?;
        Ok(Self { parameters, results })
    }

    pub(super) fn bytes(&self) -> u64 {
        self.results.buffer.size()
    }
}

/// A kernel with its staging buffers and all its inputs. It serves one dispatch at a time.
pub(super) struct Output {
    pipeline: wgpu::ComputePipeline,
    pub(super) staging: StagingBuffers,
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
        staging: StagingBuffers,
    ) -> Result<Self> {
        gpu.guarded("bindings", || {
            let view = wgpu::BindingResource::TextureView;
            let scene_group = gpu.bind(
                "scene",
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
            let output_group = gpu.bind(
                "output",
                &kernel.output_layout,
                [
                    staging.results.buffer.as_entire_binding(),
                    view(&chains.photons),
                    chains.buckets.as_entire_binding(),
                    view(light_buffer),
                ],
            );
            Self { pipeline: kernel.pipeline.clone(), staging, scene_group, output_group }
        })
    }

    /// Submits one dispatch of `parameters.paths` paths, with `parameters.paths_per_invocation` paths for each invocation, and requests the
    /// first `bytes` of its results. With `merge`, the device merges the contributions into terms.
    pub(super) fn launch(
        &self,
        gpu: &Gpu,
        parameters: &Parameters,
        bytes: u64,
        merge: Option<(&DeviceMerge, &MergeRequest<'_>, &RecordLayout)>,
    ) -> Result<(Readback, wgpu::SubmissionIndex)> {
        let submission = gpu.guarded("dispatch", || {
            gpu.queue.write_buffer(&self.staging.parameters, 0, bytemuck::bytes_of(parameters));
            let mut encoder = gpu.encoder();
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
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

    /// Waits for a dispatch of this output, and returns its results. Before the next launch, drop the view and call [`Output::release`].
    pub(super) fn wait(&self, gpu: &Gpu, in_flight: Readback) -> Result<wgpu::BufferView> {
        self.staging.results.wait(gpu, in_flight)
    }

    pub(super) fn run(&self, gpu: &Gpu, parameters: &Parameters, bytes: u64) -> Result<wgpu::BufferView> {
        let (readback, _) = self.launch(gpu, parameters, bytes, None)?;
        self.wait(gpu, readback)
    }

    /// Makes the results writable for the device again. Their view must have been dropped.
    pub(super) fn release(&self) {
        self.staging.results.release();
    }
}
