//! Tracing a scene: the light paths of either end of the rig, batch by batch.

use std::collections::hash_map::Entry;
use std::collections::{HashMap, VecDeque};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use super::batch::Batch;
use super::chains::Chains;
use super::dispatch::{Dispatches, MAX_PATHS, Pace, Work};
use super::features::Features;
use super::geometry::GpuScene;
use super::output::{Landing, Output};
use super::parameters::Parameters;
use super::pipeline::Pipeline;
use super::rig::Rig;
use super::settings::{TraceSettings, check};
use super::sight::Sights;
use super::strategy::{Stage, Strategy};
use super::summary::TraceSummary;
use crate::error::{Error, Result};
use crate::gpu::readback::Readback;
use crate::gpu::{AdapterSummary, Gpu};
use crate::image::Resolution;
use crate::observer::{Estimate, Observer, Step};
use crate::scene::Scene;

/// A dispatch under way.
struct Launched<'a> {
    output: &'a Output,
    flight: Readback,
    start: Instant,
    first_path: u64,
    parameters: Parameters,
}

/// A scene on a device, ready to be traced.
pub struct Tracer {
    gpu: Gpu,
    scene: GpuScene,
    rig: Rig,
    /// The kernels that were needed so far.
    kernels: HashMap<Features, Kernel>,
    dispatches: Dispatches,
    sights: Sights,
    chains: Chains,
    /// Of the last trace.
    landings: Vec<Landing>,
    observer: Arc<dyn Observer + Send + Sync>,
}

/// A compiled kernel, and how fast it was.
struct Kernel {
    pipeline: Pipeline,
    pace: Pace,
}

impl Tracer {
    /// Opens the adapter whose name contains `adapter` (the fastest one for `None`) and moves the scene there.
    ///
    /// # Errors
    /// [`Error::NoAdapter`] without a Vulkan driver; [`Error::Device`] when the scene does not fit.
    pub fn new(scene: &Scene, adapter: Option<&str>) -> Result<Self> {
        Self::on(Gpu::open(adapter)?, scene)
    }

    /// As [`Tracer::new`] for the scene that `load` returns, which it loads while the adapter is being opened.
    ///
    /// # Errors
    /// Whatever `load` returns; else as [`Tracer::new`].
    pub fn open<E: From<Error>>(
        adapter: Option<&str>,
        load: impl FnOnce() -> std::result::Result<Scene, E>,
    ) -> std::result::Result<(Scene, Self), E> {
        let (scene, gpu) = std::thread::scope(|scope| {
            let gpu = scope.spawn(|| Gpu::open(adapter));
            (load(), gpu.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
        });
        let scene = scene?;
        let tracer = Self::on(gpu?, &scene)?;
        Ok((scene, tracer))
    }

    fn on(gpu: Gpu, scene: &Scene) -> Result<Self> {
        let uploaded = GpuScene::upload(&gpu, scene)?;
        Ok(Self {
            gpu,
            scene: uploaded,
            rig: Rig::new(scene),
            kernels: HashMap::new(),
            dispatches: Dispatches::default(),
            sights: Sights::default(),
            chains: Chains::default(),
            landings: Vec::new(),
            observer: Arc::new(()),
        })
    }

    /// Lets `observer` watch every trace from now on, and stop it. The observer that a new tracer has, `()`, does nothing.
    pub fn observe(&mut self, observer: Arc<dyn Observer + Send + Sync>) {
        self.observer = observer;
    }

    /// The adapter in use.
    pub fn adapter(&self) -> &AdapterSummary {
        &self.gpu.summary
    }

    /// The device, for what else is to be done on it.
    pub(crate) fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Whether camera and projector are one, so that the matrix is square and symmetric.
    pub fn symmetric(&self, settings: &TraceSettings) -> bool {
        self.rig.coaxial(settings)
    }

    /// Pixels of the projector.
    pub fn projector_resolution(&self, settings: &TraceSettings) -> Resolution {
        settings.projector.unwrap_or(settings.resolution)
    }

    /// Traces `settings.samples` paths per camera pixel, and about as many in all from a projector that stands apart,
    /// and hands them to `visit` in path order, batch by batch. The batches' limits depend on the machine's speed; nothing
    /// that is summed up in path order does. The observer sees a [`Step`] of stage `tracing` before each dispatch, counted in
    /// light paths, and one at the end.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when the observer breaks, within two dispatches; [`Error::UnfinishedPaths`] when the driver
    /// dropped work; [`Error::Device`] when it failed; and whatever `visit` returns.
    pub fn trace(
        &mut self,
        settings: &TraceSettings,
        visit: &mut dyn FnMut(&Batch<'_>) -> Result<()>,
    ) -> Result<TraceSummary> {
        check(settings)?;
        let strategies = self.stage().strategies(settings)?;
        let total = strategies.iter().map(Strategy::paths).sum();
        let mut summary = TraceSummary::default();
        for strategy in &strategies {
            self.run(strategy, total, &mut summary, visit)?;
        }
        // A break at the very end changes nothing any more: everything has been traced.
        let _ = step(&*self.observer, total, total);
        Ok(summary)
    }

    /// Gives back the memory that would only make the next trace begin earlier.
    pub fn rest(&mut self) {
        self.landings.clear();
        self.chains = Chains::default();
    }

    pub(super) fn stage(&mut self) -> Stage<'_> {
        Stage {
            gpu: &self.gpu,
            scene: &self.scene,
            rig: &self.rig,
            dispatches: &mut self.dispatches,
            sights: &mut self.sights,
            chains: &mut self.chains,
        }
    }

    pub(super) fn run(
        &mut self,
        strategy: &Strategy,
        total: u64,
        summary: &mut TraceSummary,
        visit: &mut dyn FnMut(&Batch<'_>) -> Result<()>,
    ) -> Result<()> {
        let stride = u64::from(strategy.parameters.stride);
        let samples = u64::from(strategy.parameters.samples);
        let paths = strategy.paths();
        let capacity = self.dispatches.capacity(&self.gpu, stride, strategy.most_paths, paths);
        let bytes = |paths: u32| u64::from(paths) * stride * 16;
        let room = bytes(capacity);
        let Kernel { pipeline, pace } = kernel(&self.gpu, &mut self.kernels, &strategy.features)?;
        pace.begin(Work::of(&strategy.parameters));
        // While the host takes in the paths of one, the device writes to the other; but not where both are the same cores, which
        // the host then has for itself: the driver gives each of them half of a dispatch, and whichever has to do the host's work, too,
        // would keep the others waiting.
        let places = if self.gpu.shares_memory { 1 } else { 2 };
        // Those of the last trace may serve again, unless it was broken off: then they are not here.
        let mut landings = std::mem::take(&mut self.landings);
        landings.retain(|landing| landing.bytes() >= room);
        landings.truncate(places);
        while landings.len() < places {
            landings.push(Landing::new(&self.gpu, room)?);
        }
        let outputs = landings.iter().map(|landing| {
            let (chains, sight) = (&strategy.chains.buffers, &strategy.sight);
            Output::new(&self.gpu, pipeline, &self.scene, chains, sight, landing.clone())
        });
        let outputs: Vec<Output> = outputs.collect::<Result<_>>()?;
        let mut flights = VecDeque::new();
        let mut launched = 0;
        let mut idle_since = Instant::now();
        loop {
            while launched < paths && flights.len() < pace.flights().min(places) {
                if step(&*self.observer, summary.paths, total).is_break() {
                    return Err(Error::Interrupted);
                }
                let count = u64::from(pace.paths(capacity)).min(paths - launched) as u32;
                let parameters = Parameters {
                    first_pixel: (launched / samples) as u32,
                    first_sample: (launched % samples) as u32,
                    paths: count,
                    mark: self.dispatches.mark(),
                    paths_each: pace.paths_each(count, strategy.most_paths),
                    ..strategy.parameters
                };
                let output = &outputs[summary.dispatches as usize % outputs.len()];
                let start = Instant::now();
                let flight = output.launch(&self.gpu, pipeline, &parameters, bytes(count))?;
                flights.push_back(Launched { output, flight, start, first_path: launched, parameters });
                launched += u64::from(count);
                summary.dispatches += 1;
            }
            let Some(next) = flights.pop_front() else { break };
            let Launched { output, flight, start, first_path, mut parameters } = next;
            let mut view = output.land(&self.gpu, flight)?;
            let census = |view: &[u8], mark| {
                Batch::new(first_path, strategy.layout, bytemuck::cast_slice(view)).census(mark)
            };
            let (mut unfinished, mut rays) = census(&view, parameters.mark);
            if unfinished > 0 && parameters.paths_each > 1 {
                // Too long a way for one invocation: each path gets its own.
                pace.one_each();
                parameters = Parameters { paths_each: 1, mark: self.dispatches.mark(), ..parameters };
                drop(view);
                output.release();
                view = output.run(&self.gpu, pipeline, &parameters, bytes(parameters.paths))?;
                (unfinished, rays) = census(&view, parameters.mark);
            }
            // One behind another began when that was done.
            let elapsed = start.max(idle_since).elapsed();
            idle_since = Instant::now();
            let batch = Batch::new(first_path, strategy.layout, bytemuck::cast_slice(&view));
            if unfinished > 0 {
                return Err(Error::UnfinishedPaths { unfinished, total: batch.len() as u64 });
            }
            visit(&batch)?;
            summary.rays += rays;
            summary.paths += batch.len() as u64;
            summary.longest = summary.longest.max(elapsed);
            summary.tracing += elapsed;
            drop(view);
            output.release();
            pace.adapt(parameters.paths, elapsed);
        }
        self.landings = landings;
        Ok(())
    }

    /// The region (index into [`Scene::regions`]) that each camera pixel's centre sees; `None` where it sees nothing.
    ///
    /// # Errors
    /// [`Error::Device`] when the device failed.
    pub fn regions(&mut self, resolution: Resolution) -> Result<Vec<Option<u32>>> {
        let settings = TraceSettings { max_bounces: 1, ..TraceSettings::new(resolution, 1) };
        check(&settings)?;
        let camera = self.rig.camera(&settings);
        let template = self.stage().strategy(&settings, [camera; 2], [1; 2], true)?;
        let kernel = Pipeline::new(&self.gpu, "primary_regions", &template.features)?;
        let total = resolution.pixels() as u64;
        let capacity = total.min(u64::from(MAX_PATHS)).max(64);
        let (chains, sight) = (&template.chains.buffers, &template.sight);
        let landing = Landing::new(&self.gpu, capacity * 4)?;
        let output = Output::new(&self.gpu, &kernel, &self.scene, chains, sight, landing)?;
        let mut regions = Vec::with_capacity(resolution.pixels());
        while (regions.len() as u64) < total {
            let first_pixel = regions.len() as u32;
            let pixels = capacity.min(total - u64::from(first_pixel));
            let parameters = Parameters { first_pixel, paths: pixels as u32, ..template.parameters };
            let view = output.run(&self.gpu, &kernel, &parameters, pixels * 4)?;
            let seen: &[u32] = bytemuck::cast_slice(&view);
            regions.extend(seen.iter().map(|&region| (region != super::materials::NONE).then_some(region)));
            drop(view);
            output.release();
        }
        Ok(regions)
    }
}

/// Tells `observer` that `done` of `total` light paths are done.
fn step(observer: &dyn Observer, done: u64, total: u64) -> ControlFlow<()> {
    observer.step(&Step { stage: "tracing", done, total, estimate: Estimate::None })
}

/// The kernel for paths with these features, compiled at its first use.
fn kernel<'a>(
    gpu: &Gpu,
    kernels: &'a mut HashMap<Features, Kernel>,
    features: &Features,
) -> Result<&'a mut Kernel> {
    Ok(match kernels.entry(*features) {
        Entry::Occupied(entry) => entry.into_mut(),
        Entry::Vacant(entry) => {
            let pipeline = Pipeline::new(gpu, "trace_paths", features)?;
            entry.insert(Kernel { pipeline, pace: Pace::default() })
        }
    })
}
