//! Driving the kernels: dispatches sized by measured time, read back in path order, checked by the canary.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::batch::Batch;
use super::geometry::GpuScene;
use super::parameters::Parameters;
use super::pipeline::Pipeline;
use super::sampler::Sampler;
use crate::error::{Error, Result};
use crate::gpu::{AdapterSummary, Gpu};
use crate::image::Resolution;
use crate::scene::{Camera, Scene};

/// The most surfaces that a path may meet: ray and surface counts share a word with the canary.
pub const MAX_BOUNCES: u32 = 64;

/// A dispatch aims at this time: short enough for progress, cancellation and a GPU's watchdog, long enough that its
/// overhead does not show.
const TARGET: Duration = Duration::from_millis(100);

/// Bytes of records read back at a time, at most.
const RECORD_BYTES: u64 = 64 << 20;

/// What to trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TraceSettings {
    /// Pixels of the camera, and of the projector where it has none of its own.
    pub resolution: Resolution,
    /// Pixels of a projector apart from the camera; `None`: as many as the camera's.
    pub projector: Option<Resolution>,
    /// Light paths per camera pixel, at least 1.
    pub samples: u32,
    /// Surfaces that a path meets at most: 1 is direct light only, [`MAX_BOUNCES`] the limit.
    pub max_bounces: u32,
    /// Selects the random numbers; equal seeds give equal bits.
    pub seed: u32,
    /// How they are spread.
    pub sampler: Sampler,
}

impl TraceSettings {
    /// `samples` light paths of up to six surfaces from each of the camera's pixels.
    pub fn new(resolution: Resolution, samples: u32) -> Self {
        Self { resolution, projector: None, samples, max_bounces: 6, seed: 0, sampler: Sampler::Sobol }
    }
}

/// How far a trace has come.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Paths done.
    pub done: u64,
    /// Paths in all.
    pub total: u64,
}

/// What a trace took.
#[derive(Clone, Copy, Debug, Default)]
pub struct TraceSummary {
    /// Light paths traced.
    pub paths: u64,
    /// Rays traced for them: to the next surface, and to the pinhole.
    pub rays: u64,
    /// Dispatches, and the longest one.
    pub dispatches: u32,
    /// Wall time of the longest dispatch, its read-back included.
    pub longest: Duration,
    /// Wall time of all dispatches, their read-back included, without the work of the visitor.
    pub tracing: Duration,
}

/// A scene on a device, ready to be traced.
pub struct Tracer {
    gpu: Gpu,
    scene: GpuScene,
    camera: Camera,
    paths: Pipeline,
    dispatched: u32,
}

impl Tracer {
    /// Opens the adapter whose name contains `adapter` (the fastest one for `None`) and moves the scene there.
    ///
    /// # Errors
    /// [`Error::NoAdapter`] without a Vulkan driver; [`Error::Device`] when the scene does not fit.
    pub fn new(scene: &Scene, adapter: Option<&str>) -> Result<Self> {
        let gpu = Gpu::open(adapter)?;
        let uploaded = GpuScene::upload(&gpu, scene)?;
        let paths = Pipeline::new(&gpu, "trace_paths")?;
        Ok(Self { gpu, scene: uploaded, camera: scene.camera.clone(), paths, dispatched: 0 })
    }

    /// The adapter in use.
    pub fn adapter(&self) -> &AdapterSummary {
        &self.gpu.summary
    }

    /// Traces `settings.samples` paths per pixel and hands them to `visit` in path order, batch by batch. The batches'
    /// limits depend on the machine's speed; nothing that is summed up in path order does.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when `progress` breaks, within one dispatch; [`Error::UnfinishedPaths`] when the driver
    /// dropped work; [`Error::Device`] when it failed; and whatever `visit` returns.
    pub fn trace(
        &mut self,
        settings: &TraceSettings,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
        visit: &mut dyn FnMut(&Batch<'_>) -> Result<()>,
    ) -> Result<TraceSummary> {
        check(settings)?;
        let total = settings.resolution.pixels() as u64 * u64::from(settings.samples);
        let stride = u64::from(settings.max_bounces) + u64::from(self.scene.ambient);
        let room = RECORD_BYTES.min(self.gpu.summary.max_storage_binding).min(self.gpu.summary.max_buffer);
        let capacity = (room / (16 * stride)).min(u64::from(MAX_PATHS)).min(total.max(64)) as u32;
        let slots = self.paths.output(&self.gpu, &self.scene, u64::from(capacity) * stride * 16)?;

        let mut summary = TraceSummary::default();
        let mut size = BatchSize { paths: 64, most: capacity, warm: false };
        while summary.paths < total {
            if progress(Progress { done: summary.paths, total }).is_break() {
                return Err(Error::Interrupted);
            }
            let start = Instant::now();
            let paths = u64::from(size.paths).min(total - summary.paths) as u32;
            let parameters = self.parameters(settings, summary.paths, paths);
            let bytes = u64::from(paths) * stride * 16;
            let view = slots.run(&self.gpu, &self.paths, &parameters, bytes)?;
            let elapsed = start.elapsed();
            let batch = Batch {
                first_path: summary.paths,
                samples: settings.samples,
                max_bounces: settings.max_bounces,
                ambient: self.scene.ambient,
                records: bytemuck::cast_slice(&view),
            };
            let unfinished = batch.unfinished(parameters.mark);
            if unfinished > 0 {
                return Err(Error::UnfinishedPaths { unfinished, total: u64::from(paths) });
            }
            visit(&batch)?;
            summary.rays += (0..batch.len()).into_par_iter().map(|index| batch.rays(index)).sum::<u64>();
            summary.paths += u64::from(paths);
            summary.dispatches += 1;
            summary.longest = summary.longest.max(elapsed);
            summary.tracing += elapsed;
            drop(view);
            slots.release();
            size.adapt(elapsed);
        }
        // A break at the very end changes nothing any more: everything has been traced.
        let _ = progress(Progress { done: total, total });
        Ok(summary)
    }

    /// The region (index into [`Scene::regions`]) that each pixel's centre sees; `None` where it sees nothing.
    ///
    /// # Errors
    /// [`Error::Device`] when the device failed.
    pub fn regions(&mut self, resolution: Resolution) -> Result<Vec<Option<u32>>> {
        let kernel = Pipeline::new(&self.gpu, "primary_regions")?;
        let settings = TraceSettings { max_bounces: 1, ..TraceSettings::new(resolution, 1) };
        check(&settings)?;
        let total = resolution.pixels() as u64;
        let capacity = total.min(u64::from(MAX_PATHS)).max(64);
        let slots = kernel.output(&self.gpu, &self.scene, capacity * 4)?;
        let mut regions = Vec::with_capacity(resolution.pixels());
        while (regions.len() as u64) < total {
            let pixels = capacity.min(total - regions.len() as u64);
            let parameters = self.parameters(&settings, regions.len() as u64, pixels as u32);
            let view = slots.run(&self.gpu, &kernel, &parameters, pixels * 4)?;
            let seen: &[u32] = bytemuck::cast_slice(&view);
            regions.extend(seen.iter().map(|&region| (region != super::materials::NONE).then_some(region)));
            drop(view);
            slots.release();
        }
        Ok(regions)
    }

    fn parameters(&mut self, settings: &TraceSettings, first_path: u64, paths: u32) -> Parameters {
        let Resolution { width, height } = settings.resolution;
        let vertical = self.camera.tan_half_fov;
        self.dispatched = self.dispatched % 0xffff + 1;
        Parameters {
            resolution: [width as u32, height as u32],
            tangent: [vertical * width as f32 / height as f32, vertical],
            first_pixel: (first_path / u64::from(settings.samples)) as u32,
            first_sample: (first_path % u64::from(settings.samples)) as u32,
            paths,
            samples: settings.samples,
            max_bounces: settings.max_bounces,
            seed: settings.seed,
            mark: self.dispatched << 16,
            ambient: u32::from(self.scene.ambient),
            sampling: settings.sampler.word(),
            padding: 0,
        }
    }
}

/// Paths in one dispatch at most: 65,535 workgroups of 64.
const MAX_PATHS: u32 = 65_535 * 64;

/// How many paths the next dispatch takes.
struct BatchSize {
    paths: u32,
    most: u32,
    /// The first dispatch of a pipeline compiles it, so its time says nothing.
    warm: bool,
}

impl BatchSize {
    fn adapt(&mut self, elapsed: Duration) {
        let wish = if self.warm {
            // Grow at most fourfold: a short dispatch is mostly overhead and would mislead.
            f64::from(self.paths) * (TARGET.as_secs_f64() / elapsed.as_secs_f64().max(1e-6)).min(4.0)
        } else {
            4096.0
        };
        self.warm = true;
        self.paths = (wish as u32).next_multiple_of(64).clamp(64, self.most.max(64));
        self.paths = self.paths.min(self.most);
    }
}

fn check(settings: &TraceSettings) -> Result<()> {
    let Resolution { width, height } = settings.resolution;
    if width == 0 || height == 0 || width > 16384 || height > 16384 {
        return Err(Error::Option {
            option: "--size".into(),
            fault: format!("{} pixels cannot be traced", settings.resolution),
            help: "give 1 to 16384 pixels a side, e.g. --size 128 or --size 128x96".into(),
        });
    }
    if settings.samples == 0 || settings.samples > 1 << 20 {
        return Err(Error::Option {
            option: "--spp".into(),
            fault: format!("{} samples per pixel cannot be traced", settings.samples),
            help: "give 1 to 1048576, e.g. --spp 64".into(),
        });
    }
    if settings.max_bounces == 0 || settings.max_bounces > MAX_BOUNCES {
        return Err(Error::Option {
            option: "--max-bounces".into(),
            fault: format!("{} surface hits per path cannot be traced", settings.max_bounces),
            help: format!("give 1 (direct light only) to {MAX_BOUNCES}, e.g. --max-bounces 6"),
        });
    }
    Ok(())
}
