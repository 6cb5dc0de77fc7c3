//! The tracer of a scene. It traces light paths from the endpoints of the rig, and returns them in batches.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::ops::{ControlFlow, Range};
use std::sync::Arc;
use std::time::Duration;

use super::batch::Batch;
use super::dispatch::{DispatchSizer, Dispatches, MAX_PATHS};
use super::geometry::GpuScene;
use super::kernel::{Features, Parameters, Pipeline};
use super::launch::{Output, SizedKernel, StrategyRun};
use super::light_buffer::LightBuffers;
use super::materials::NONE;
use super::photons::ChainCache;
use super::settings::{StartPixels, TraceSettings, TraceSummary};
use super::strategy::{Endpoints, Strategy};
use crate::error::{Error, Result};
use crate::gpu::buffers::Results;
use crate::gpu::device::ALL;
use crate::gpu::{AdapterSummary, Gpu};
use crate::image::Resolution;
use crate::observer::{Estimate, Observer, Step};
use crate::scene::Scene;
use crate::team::Remote;

/// Traces the light paths of one scene on one device; several devices may share the paths of a matrix.
pub struct Tracer {
    pub(super) gpu: Gpu,
    pub(super) scene: GpuScene,
    pub(super) rig: Endpoints,
    pub(super) kernels: HashMap<Features, SizedKernel>,
    pub(super) dispatches: Dispatches,
    pub(super) light_buffers: LightBuffers,
    pub(super) chains: ChainCache,
    /// Whether a device that is not the processor assembles matrices.
    assembles: Option<bool>,
    /// The buffers of the last trace.
    results: Vec<Results>,
    /// The buffer of the last trace whose records stayed on the device.
    pub(crate) resident: Option<Results>,
    pub(super) observer: Arc<dyn Observer + Send + Sync>,
    /// The handle of the scene in a team of processes, each of which traces a part.
    remote: Option<Arc<Remote>>,
    /// Tracers of the same scene on other devices, which help to assemble a matrix.
    pub(crate) others: Vec<Tracer>,
}

impl Tracer {
    /// Opens the adapter whose name contains `adapter`, or the fastest adapter for `None`, and moves the scene to it. Fails with
    /// [`Error::NoAdapter`] if there is no Vulkan driver, and with [`Error::Device`] if the scene does not fit.
    ///
    /// The name `all` stands for all adapters that are equal to the fastest one. They share the paths of a matrix that is assembled on the
    /// device; everything else is traced by the first one.
    pub fn new(scene: &Scene, adapter: Option<&str>) -> Result<Self> {
        Self::open_turn(scene, adapter, 0)?.with_equals(adapter, scene)
    }

    /// Works like [`Tracer::new`], errors included, but opens one adapter only. If there are several equal adapters, `turn` selects one.
    pub fn open_turn(scene: &Scene, adapter: Option<&str>, turn: usize) -> Result<Self> {
        Self::on(Gpu::open(adapter, turn)?, scene)
    }

    /// Works like [`Tracer::new`], for the scene that `load` returns. The scene is loaded while the adapter is being opened. Fails like
    /// `load` or [`Tracer::new`].
    pub fn open<E: From<Error>>(
        adapter: Option<&str>,
        load: impl FnOnce() -> std::result::Result<Scene, E>,
    ) -> std::result::Result<(Scene, Self), E> {
        let (scene, gpu) = std::thread::scope(|scope| {
            let gpu = std::thread::Builder::new().spawn_scoped(scope, || Gpu::open(adapter, 0));
            let scene = load();
            let gpu = match gpu {
                Ok(gpu) => gpu.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
                // A thread for loading could not be started.
                Err(_) => Gpu::open(adapter, 0),
            };
            (scene, gpu)
        });
        let scene = scene?;
        let tracer = Self::on(gpu?, &scene)?.with_equals(adapter, &scene)?;
        Ok((scene, tracer))
    }

    fn on(gpu: Gpu, scene: &Scene) -> Result<Self> {
        let uploaded = GpuScene::upload(&gpu, scene)?;
        let rig = Endpoints::new(scene, uploaded.unit);
        Ok(Self {
            gpu,
            scene: uploaded,
            rig,
            kernels: HashMap::new(),
            dispatches: Dispatches::default(),
            light_buffers: LightBuffers::default(),
            chains: ChainCache::default(),
            assembles: None,
            results: Vec::new(),
            resident: None,
            observer: Arc::new(()),
            remote: None,
            others: Vec::new(),
        })
    }

    /// Lets the devices of all equal adapters help if `adapter` asks for all.
    fn with_equals(mut self, adapter: Option<&str>, scene: &Scene) -> Result<Self> {
        if adapter.is_some_and(|name| name.eq_ignore_ascii_case(ALL)) {
            let equals = self.gpu.open_equals()?;
            self.help_by(equals, scene)?;
        }
        Ok(self)
    }

    /// Lets these devices help to assemble the matrix of `scene`, the tracer's own scene.
    pub(crate) fn help_by(&mut self, others: Vec<Gpu>, scene: &Scene) -> Result<()> {
        self.others = others.into_iter().map(|gpu| Self::on(gpu, scene)).collect::<Result<_>>()?;
        Ok(())
    }

    /// The number of devices that assemble a matrix.
    pub fn devices(&self) -> usize {
        1 + self.others.len()
    }

    /// Compiles kernels from now on with the help of `kept`, the data that an earlier process got from [`Tracer::compiled_kernels`] for the
    /// same adapter. Kernels of another device, driver or version are ignored. Call it before the first trace.
    pub fn restore_kernels(&mut self, kept: Option<&[u8]>) {
        self.gpu.restore_compiled(kept);
        self.others.iter_mut().for_each(|other| other.restore_kernels(kept));
    }

    /// All compiled kernels, including those of [`Tracer::restore_kernels`], for later processes. It is `None` if there are no new kernels,
    /// or if the driver does not return kernels. Software Vulkan returns none, because it keeps kernels on disk itself.
    pub fn compiled_kernels(&self) -> Option<Vec<u8>> {
        self.gpu.compiled.as_ref()?.data()
    }

    pub(crate) fn share(&mut self, remote: Remote) {
        self.remote = Some(Arc::new(remote));
        // Each process of a team has its own device.
        self.others.clear();
    }

    pub(crate) fn remote(&self) -> Option<&Arc<Remote>> {
        self.remote.as_ref()
    }

    pub(crate) fn observer(&self) -> Arc<dyn Observer + Send + Sync> {
        Arc::clone(&self.observer)
    }

    /// Sets the observer that sees every later trace and may stop it. The observer of a new tracer, `()`, does nothing.
    pub fn observe(&mut self, observer: Arc<dyn Observer + Send + Sync>) {
        self.observer = observer;
    }

    /// The adapter in use.
    pub fn adapter(&self) -> &AdapterSummary {
        &self.gpu.summary
    }

    pub(crate) fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Whether the rig is coaxial, so that the matrix is square and symmetric.
    pub fn symmetric(&self, settings: &TraceSettings) -> bool {
        self.rig.coaxial(settings)
    }

    /// Resolution of the projector.
    pub fn projector_resolution(&self, settings: &TraceSettings) -> Resolution {
        settings.projector.unwrap_or(settings.resolution)
    }

    /// All pixels at which paths start: the camera's pixels, and the pixels of a projector that stands apart.
    pub fn start_pixels(&self, settings: &TraceSettings) -> StartPixels {
        let apart = !self.symmetric(settings);
        let projector = if apart { self.projector_resolution(settings).pixels() } else { 0 };
        StartPixels { camera: 0..settings.resolution.pixels(), projector: 0..projector }
    }

    /// Traces `settings.samples` paths per camera pixel, and about the same total number from a projector that stands apart. Calls `visit`
    /// with each batch, in path order. The sizes of the batches depend on the speed of the machine, but sums in path order do not.
    ///
    /// The observer sees a [`Step`] of stage `tracing` before each dispatch, counted in light paths, and one at the end.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if the observer stops the trace, within two dispatches; [`Error::UnfinishedPaths`] if the driver dropped
    /// paths; [`Error::Device`] if the device failed; and the errors of `visit`.
    pub fn trace(
        &mut self,
        settings: &TraceSettings,
        visit: &mut dyn FnMut(&Batch<'_>) -> Result<()>,
    ) -> Result<TraceSummary> {
        self.trace_from(settings, &self.start_pixels(settings), visit)
    }

    /// Works like [`Tracer::trace`], errors included, but traces only the paths that start from these pixels.
    pub fn trace_from(
        &mut self,
        settings: &TraceSettings,
        pixels: &StartPixels,
        visit: &mut dyn FnMut(&Batch<'_>) -> Result<()>,
    ) -> Result<TraceSummary> {
        settings.check()?;
        let strategies = self.strategies(settings)?;
        self.run_each(&strategies, pixels, |tracer, strategy, paths, total, summary| {
            tracer.run(strategy, paths, total, summary, visit)
        })
    }

    /// Calls `run` for each strategy with the numbers of its paths from `pixels`, the number of the paths of all strategies, and the cost so
    /// far. Returns the whole cost.
    pub(super) fn run_each(
        &mut self,
        strategies: &[Strategy],
        pixels: &StartPixels,
        mut run: impl FnMut(&mut Self, &Strategy, Range<u64>, u64, &mut TraceSummary) -> Result<()>,
    ) -> Result<TraceSummary> {
        let all: Vec<Range<u64>> = strategies.iter().map(|strategy| strategy.paths_from(pixels)).collect();
        let total = all.iter().map(|paths| paths.end - paths.start).sum();
        let mut summary = TraceSummary::default();
        for (strategy, paths) in strategies.iter().zip(all) {
            run(self, strategy, paths, total, &mut summary)?;
        }
        // Everything has been traced, so a request to stop has no effect.
        let _ = step(&*self.observer, total, total);
        Ok(summary)
    }

    /// Selects whether the device that traces also assembles the matrix, so that neither records nor entries are transferred. By default, a
    /// device does so unless it is the processor itself, which would gain nothing. Sums differ from the host's only by rounding. If the
    /// device lacks memory or `f64`, or fails its self-test, the host assembles the matrix all the same, and the observer gets a note.
    pub fn assemble_on_device(&mut self, asked: bool) {
        self.assembles = Some(asked);
        if !asked {
            self.others.clear();
        }
    }

    /// Whether the device that traces also assembles the matrix.
    pub(crate) fn assembles_on_device(&self) -> bool {
        self.assembles.unwrap_or(!self.gpu.summary.is_processor())
    }

    /// Measures the time of all work on the device during `work`, by the device's own clock: what each pass does (`tracing`, `products`, or
    /// the kernel of an assembly), and its time. At most 2,048 passes are timed. Fails like `work`, or with [`Error::Device`] if the driver
    /// has no timestamps.
    pub fn timed<T>(
        &mut self,
        work: impl FnOnce(&mut Self) -> Result<T>,
    ) -> Result<(T, Vec<(&'static str, Duration)>)> {
        self.gpu.start_stopwatch()?;
        let outcome = work(self);
        let times = self.gpu.stop_stopwatch()?;
        Ok((outcome?, times))
    }

    /// Frees staging buffers and photon maps. They would only shorten the start of the next trace.
    pub fn release_buffers(&mut self) {
        self.results.clear();
        self.resident = None;
        self.gpu.free_scratch();
        self.chains = ChainCache::default();
        self.others.iter_mut().for_each(Self::release_buffers);
    }

    /// Traces the paths of one strategy with these numbers. `total` counts the paths of all strategies, for the observer.
    pub(super) fn run(
        &mut self,
        strategy: &Strategy,
        paths: Range<u64>,
        total: u64,
        summary: &mut TraceSummary,
        visit: &mut dyn FnMut(&Batch<'_>) -> Result<()>,
    ) -> Result<()> {
        let Self { gpu, scene, kernels, dispatches, results, observer, .. } = self;
        let kernel = kernel(gpu, kernels, &strategy.features)?;
        // The buffers of the last trace are used again. An interrupted trace has dropped its buffers.
        let buffers = std::mem::take(results);
        let mut run = StrategyRun::new(gpu, scene, strategy, paths, kernel, dispatches, buffers)?;
        loop {
            while run.can_launch() {
                if step(&**observer, summary.paths, total).is_break() {
                    return Err(Error::Interrupted);
                }
                run.launch(summary)?;
            }
            if !run.finish_oldest(summary, visit)? {
                break;
            }
        }
        *results = run.outputs.into_iter().map(|output| output.results).collect();
        Ok(())
    }
}

pub(super) fn step(observer: &dyn Observer, done: u64, total: u64) -> ControlFlow<()> {
    observer.step(&Step { stage: "tracing", done, total, estimate: Estimate::None })
}

pub(super) fn kernel<'a>(
    gpu: &Gpu,
    kernels: &'a mut HashMap<Features, SizedKernel>,
    features: &Features,
) -> Result<&'a mut SizedKernel> {
    Ok(match kernels.entry(*features) {
        Entry::Occupied(entry) => entry.into_mut(),
        Entry::Vacant(entry) => {
            // The kernels of a device serve every scene of the process with these features.
            let name = format!("trace_paths {features:?}");
            let pipeline = gpu.kept(&name, || Pipeline::new(gpu, "trace_paths", features).map(Arc::new))?;
            entry.insert(SizedKernel { pipeline, sizer: DispatchSizer::default() })
        }
    })
}

impl Tracer {
    /// For each camera pixel, the region at its centre, as an index into [`Scene::regions`](crate::scene::Scene::regions), or `None`. Fails
    /// with [`crate::Error::Device`] if the device failed.
    pub fn regions(&mut self, resolution: Resolution) -> Result<Vec<Option<u32>>> {
        let settings = TraceSettings { max_bounces: 1, ..TraceSettings::new(resolution, 1) };
        settings.check()?;
        let camera = self.rig.camera(&settings);
        let template = self.strategy(&settings, [camera; 2], [1; 2], true)?;
        let kernel = Pipeline::new(&self.gpu, "primary_regions", &template.features)?;
        let total = resolution.pixels() as u64;
        let capacity = total.min(u64::from(MAX_PATHS)).max(64);
        let (chains, light_buffer) = (&template.chains, &template.light_buffer);
        let results = Results::new(&self.gpu, "regions", capacity * 4)?;
        let output = Output::new(&self.gpu, &kernel, &self.scene, chains, light_buffer, results)?;
        let mut regions = Vec::with_capacity(resolution.pixels());
        while (regions.len() as u64) < total {
            let first_pixel = regions.len() as u32;
            let pixels = capacity.min(total - u64::from(first_pixel));
            let parameters = Parameters { first_pixel, paths: pixels as u32, ..template.parameters };
            let view = output.run(&self.gpu, &parameters, pixels * 4)?;
            let seen: &[u32] = bytemuck::cast_slice(&view);
            regions.extend(seen.iter().map(|&region| (region != NONE).then_some(region)));
        }
        Ok(regions)
    }
}
