//! Tracing a scene: the light paths of either end of the rig, batch by batch.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::batch::{Batch, Layout};
use super::dispatch::{BatchSize, Dispatches, MAX_PATHS};
use super::geometry::GpuScene;
use super::parameters::{GpuEye, Parameters, flags};
use super::photons::{Gather, PhotonMap};
use super::pipeline::Pipeline;
use super::rig::Rig;
use super::sampler::Sampler;
use crate::error::{Error, Result};
use crate::gpu::{AdapterSummary, Gpu};
use crate::image::Resolution;
use crate::scene::Scene;

/// The most surfaces that a path may meet: ray and surface counts share a word with the canary.
pub const MAX_BOUNCES: u32 = 64;

/// What to trace.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// Ends dim paths by chance. At six bounces that costs more variance than it saves time.
    pub russian_roulette: bool,
    /// How finely the specular chains of the far end are mapped, where the scene has any.
    pub gather: Gather,
}

impl TraceSettings {
    /// `samples` light paths of up to six surfaces from each of the camera's pixels.
    pub fn new(resolution: Resolution, samples: u32) -> Self {
        Self {
            resolution,
            projector: None,
            samples,
            max_bounces: 6,
            seed: 0,
            sampler: Sampler::Sobol,
            russian_roulette: false,
            gather: Gather::default(),
        }
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
    rig: Rig,
    paths: Pipeline,
    dispatches: Dispatches,
}

/// The paths of one end of the rig.
pub(super) struct Strategy {
    /// Of each dispatch, but for which paths are its own.
    pub(super) parameters: Parameters,
    chains: PhotonMap,
    layout: Layout,
}

impl Strategy {
    pub(super) fn paths(&self) -> u64 {
        self.parameters.start.pixels() * u64::from(self.parameters.samples)
    }
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
        Ok(Self { gpu, scene: uploaded, rig: Rig::new(scene), paths, dispatches: Dispatches::default() })
    }

    /// The adapter in use.
    pub fn adapter(&self) -> &AdapterSummary {
        &self.gpu.summary
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
    /// that is summed up in path order does.
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
        let strategies = self.strategies(settings)?;
        let total = strategies.iter().map(Strategy::paths).sum();
        let mut summary = TraceSummary::default();
        for strategy in &strategies {
            self.run(strategy, total, &mut summary, progress, visit)?;
        }
        // A break at the very end changes nothing any more: everything has been traced.
        let _ = progress(Progress { done: total, total });
        Ok(summary)
    }

    /// From the camera; and from the projector too, unless it is the same.
    pub(super) fn strategies(&mut self, settings: &TraceSettings) -> Result<Vec<Strategy>> {
        let (camera, projector) = (self.rig.camera(settings), self.rig.projector(settings));
        if self.rig.coaxial(settings) {
            return Ok(vec![self.strategy(settings, [camera, camera], [settings.samples; 2], true)?]);
        }
        let share = camera.pixels() as f64 / projector.pixels() as f64;
        let samples = [settings.samples, (f64::from(settings.samples) * share).round().max(1.0) as u32];
        Ok(vec![
            self.strategy(settings, [camera, projector], samples, true)?,
            self.strategy(settings, [projector, camera], [samples[1], samples[0]], false)?,
        ])
    }

    /// The paths from the first of two ends to the second, which have these samples per pixel.
    fn strategy(
        &mut self,
        settings: &TraceSettings,
        [start, end]: [GpuEye; 2],
        [samples, end_samples]: [u32; 2],
        from_camera: bool,
    ) -> Result<Strategy> {
        let coaxial = self.rig.coaxial(settings);
        let coaxial_pinhole = self.rig.coaxial_pinhole(settings);
        let ambient = self.scene.ambient && from_camera;
        let flag = |set: bool, bit: u32| if set { bit } else { 0 };
        let starts = |eye: &GpuEye, samples: u32| f64::from(samples) * eye.pixels() as f64 / eye.image_area();
        let end_to_start =
            if coaxial { 1.0 } else { starts(&end, end_samples) / starts(&start, samples) } as f32;
        let mut parameters = Parameters {
            start,
            end,
            first_pixel: 0,
            first_sample: 0,
            paths: 0,
            samples,
            max_bounces: settings.max_bounces,
            // The two ends' paths share no numbers.
            seed: if from_camera { settings.seed } else { settings.seed ^ 0x9e37_79b9 },
            mark: 0,
            flags: flag(ambient, flags::AMBIENT)
                | flag(coaxial_pinhole, flags::COAXIAL_PINHOLE)
                | flag(self.scene.passable, flags::PASSABLE)
                | flag(settings.russian_roulette, flags::ROULETTE),
            end_to_start,
            // A path from the projector estimates per projector sample what one from the camera does per camera sample.
            scale: if from_camera { 1.0 } else { end_to_start },
            gather_radius: 0.0,
            inverse_cell: 0.0,
            bucket_mask: 0,
            stride: 0,
            sampling: settings.sampler.word(),
            padding: 0,
        };
        let chains = if self.scene.specular {
            let dispatches = &mut self.dispatches;
            PhotonMap::trace(&self.gpu, &self.scene, end, settings.gather, &parameters, dispatches)?
        } else {
            PhotonMap::empty(&self.gpu)?
        };
        let layout = Layout {
            samples,
            max_bounces: settings.max_bounces,
            direct: coaxial_pinhole,
            gathers: chains.bucket_mask != 0,
            ambient,
            symmetric: coaxial,
            from_camera,
        };
        parameters.stride = layout.stride() as u32;
        parameters.bucket_mask = chains.bucket_mask;
        parameters.gather_radius = chains.radius;
        parameters.inverse_cell = chains.inverse_cell();
        Ok(Strategy { parameters, chains, layout })
    }

    pub(super) fn run(
        &mut self,
        strategy: &Strategy,
        total: u64,
        summary: &mut TraceSummary,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
        visit: &mut dyn FnMut(&Batch<'_>) -> Result<()>,
    ) -> Result<()> {
        let stride = u64::from(strategy.parameters.stride);
        let samples = u64::from(strategy.parameters.samples);
        let paths = strategy.paths();
        let capacity = self.dispatches.capacity(&self.gpu, stride, paths);
        let bytes = u64::from(capacity) * stride * 16;
        let slots = self.paths.output(&self.gpu, &self.scene, &strategy.chains.buffers, bytes)?;
        let mut size = BatchSize::new(capacity);
        let mut done = 0;
        while done < paths {
            if progress(Progress { done: summary.paths, total }).is_break() {
                return Err(Error::Interrupted);
            }
            let start = Instant::now();
            let count = u64::from(size.paths()).min(paths - done) as u32;
            let parameters = Parameters {
                first_pixel: (done / samples) as u32,
                first_sample: (done % samples) as u32,
                paths: count,
                mark: self.dispatches.mark(),
                ..strategy.parameters
            };
            let view = slots.run(&self.gpu, &self.paths, &parameters, u64::from(count) * stride * 16)?;
            let elapsed = start.elapsed();
            let batch =
                Batch { first_path: done, layout: strategy.layout, records: bytemuck::cast_slice(&view) };
            let unfinished = batch.unfinished(parameters.mark);
            if unfinished > 0 {
                return Err(Error::UnfinishedPaths { unfinished, total: u64::from(count) });
            }
            visit(&batch)?;
            summary.rays += (0..batch.len()).into_par_iter().map(|index| batch.rays(index)).sum::<u64>();
            done += u64::from(count);
            summary.paths += u64::from(count);
            summary.dispatches += 1;
            summary.longest = summary.longest.max(elapsed);
            summary.tracing += elapsed;
            drop(view);
            slots.release();
            size.adapt(elapsed);
        }
        Ok(())
    }

    /// The region (index into [`Scene::regions`]) that each camera pixel's centre sees; `None` where it sees nothing.
    ///
    /// # Errors
    /// [`Error::Device`] when the device failed.
    pub fn regions(&mut self, resolution: Resolution) -> Result<Vec<Option<u32>>> {
        let kernel = Pipeline::new(&self.gpu, "primary_regions")?;
        let settings = TraceSettings { max_bounces: 1, ..TraceSettings::new(resolution, 1) };
        check(&settings)?;
        let camera = self.rig.camera(&settings);
        let template = self.strategy(&settings, [camera; 2], [1; 2], true)?;
        let total = resolution.pixels() as u64;
        let capacity = total.min(u64::from(MAX_PATHS)).max(64);
        let slots = kernel.output(&self.gpu, &self.scene, &template.chains.buffers, capacity * 4)?;
        let mut regions = Vec::with_capacity(resolution.pixels());
        while (regions.len() as u64) < total {
            let first_pixel = regions.len() as u32;
            let pixels = capacity.min(total - u64::from(first_pixel));
            let parameters = Parameters { first_pixel, paths: pixels as u32, ..template.parameters };
            let view = slots.run(&self.gpu, &kernel, &parameters, pixels * 4)?;
            let seen: &[u32] = bytemuck::cast_slice(&view);
            regions.extend(seen.iter().map(|&region| (region != super::materials::NONE).then_some(region)));
            drop(view);
            slots.release();
        }
        Ok(regions)
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
    if !(settings.gather.radius.is_finite() && settings.gather.radius > 0.0) {
        return Err(Error::Option {
            option: "--gather-radius".into(),
            fault: format!("{} is no radius", settings.gather.radius),
            help: "give a positive number, e.g. --gather-radius 1".into(),
        });
    }
    if settings.gather.photons > 1 << 16 {
        return Err(Error::Option {
            option: "--gather-photons".into(),
            fault: format!("{} chains per pixel cannot be traced", settings.gather.photons),
            help: "give 0 to 65536, e.g. --gather-photons 16".into(),
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
