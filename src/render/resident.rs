//! Traces without moving the records to the host: a consumer on the device takes them, while the next dispatch is already submitted.

use std::collections::VecDeque;
use std::ops::Range;
use std::time::Instant;

use super::batch::RecordLayout;
use super::dispatch::PathWork;
use super::launch::{Output, record_bytes};
use super::settings::{StartPixels, TraceSettings, TraceSummary};
use super::strategy::Strategy;
use super::tracer::{kernel, step};
use super::{Tracer, dispatch};
use crate::error::{Error, Result};
use crate::gpu::buffers::Results;

/// The maximum number of paths of a dispatch. So many paths keep a GPU busy, and their records fit any GPU's memory.
const MOST_PATHS: u64 = 1 << 20;

/// The number of paths of the first dispatch on a GPU, whose time determines the size of the next one. Even a slow GPU takes them in time.
const FIRST_PATHS: u32 = 1 << 16;

/// The maximum number of dispatches in flight, so that the device need not wait for the host.
const IN_FLIGHT: usize = 2;

/// The paths of one dispatch, whose records are on the device.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ResidentPaths {
    pub(crate) first_path: u64,
    pub(crate) paths: u32,
    /// The mark of the records of finished paths, in the upper 16 bits.
    pub(crate) mark: u32,
}

/// Takes the records of paths on the device that traced them.
pub(crate) trait Consumer {
    /// Prepares for the paths from one endpoint of the rig with these numbers, whose records will be in `records`.
    fn begin(&mut self, layout: &RecordLayout, paths: Range<u64>, records: &wgpu::Buffer) -> Result<()>;

    /// The number of paths of the dispatch that begins with `first_path`. It should be at most `most`, if the consumer can take so few.
    fn paths_from(&self, first_path: u64, most: u32) -> u32;

    /// Submits a dispatch: the commands that `trace` records, and then those that take the records of the paths.
    fn submit(
        &mut self,
        paths: &ResidentPaths,
        trace: &mut dyn FnMut(&mut wgpu::CommandEncoder),
    ) -> Result<()>;

    /// Waits until the oldest dispatch in flight is done.
    fn finish(&mut self) -> Result<()>;
}

impl Tracer {
    /// Works like [`Tracer::trace_from`], but `consumer` takes the records on the device. The rays and the unfinished paths are not counted here.
    pub(crate) fn trace_resident(
        &mut self,
        settings: &TraceSettings,
        pixels: &StartPixels,
        consumer: &mut dyn Consumer,
    ) -> Result<TraceSummary> {
        let strategies = self.resident_strategies(settings)?;
        self.run_each(&strategies, pixels, |tracer, strategy, paths, total, summary| {
            tracer.run_resident(strategy, paths, total, summary, consumer)
        })
    }

    fn run_resident(
        &mut self,
        strategy: &Strategy,
        mut left: Range<u64>,
        total: u64,
        summary: &mut TraceSummary,
        consumer: &mut dyn Consumer,
    ) -> Result<()> {
        let Self { gpu, scene, kernels, dispatches, resident, observer, .. } = self;
        let kernel = kernel(gpu, kernels, &strategy.features)?;
        let most = MOST_PATHS.min(left.end - left.start);
        let capacity = dispatches.capacity(gpu, u64::from(strategy.parameters.stride), 1, most);
        let bytes = record_bytes(&strategy.parameters, capacity);
        // The buffers of the last trace are used again. An interrupted trace has dropped its buffers.
        let results = match resident.take().filter(|results| results.buffer.size() >= bytes) {
            Some(results) => results,
            None => Results::resident(gpu, "path records", bytes)?,
        };
        let (chains, light_buffer) = (&strategy.chains, &strategy.light_buffer);
        let output = Output::new(gpu, &kernel.pipeline, scene, chains, light_buffer, results)?;
        consumer.begin(&strategy.layout, left.clone(), &output.results.buffer)?;
        kernel.sizer.begin(PathWork::of(&strategy.parameters));
        if !gpu.summary.is_processor() {
            kernel.sizer.start_with(FIRST_PATHS);
        }
        let mut in_flight = VecDeque::new();
        let mut idle_since = Instant::now();
        loop {
            while in_flight.len() < kernel.sizer.max_in_flight().min(IN_FLIGHT) && !left.is_empty() {
                if step(&**observer, summary.paths, total).is_break() {
                    return Err(Error::Interrupted);
                }
                let wanted = consumer.paths_from(left.start, kernel.sizer.paths(capacity)).min(capacity);
                let paths = u64::from(wanted).min(left.end - left.start) as u32;
                let parameters = strategy.parameters.of_paths(left.start, paths, dispatches.mark());
                let dispatched = ResidentPaths { first_path: left.start, paths, mark: parameters.mark };
                let mut start = Instant::now();
                consumer.submit(&dispatched, &mut |encoder| {
                    start = Instant::now();
                    output.record(gpu, encoder, &parameters);
                })?;
                in_flight.push_back((start, paths));
                left.start += u64::from(paths);
                summary.paths += u64::from(paths);
                summary.dispatches += 1;
            }
            let Some((start, paths)) = in_flight.pop_front() else { break };
            consumer.finish()?;
            // If a dispatch waited for an earlier one, it began when the earlier one was done.
            let elapsed = start.max(idle_since).elapsed();
            idle_since = Instant::now();
            summary.longest = summary.longest.max(elapsed);
            summary.tracing += elapsed;
            kernel.sizer.adapt(paths, elapsed);
        }
        *resident = Some(output.results);
        Ok(())
    }

    /// Compiles the kernels of [`Tracer::trace_resident`]. Returns the layouts of the records, for each endpoint at which paths start.
    pub(crate) fn prepare_resident(&mut self, settings: &TraceSettings) -> Result<Vec<RecordLayout>> {
        let strategies = self.resident_strategies(settings)?;
        for strategy in &strategies {
            kernel(&self.gpu, &mut self.kernels, &strategy.features)?;
        }
        Ok(strategies.into_iter().map(|strategy| strategy.layout).collect())
    }

    fn resident_strategies(&mut self, settings: &TraceSettings) -> Result<Vec<Strategy>> {
        settings.check()?;
        let mut strategies = self.strategies(settings)?;
        // Several paths of an invocation are an optimization for the processor.
        strategies.iter_mut().for_each(|strategy| strategy.features.several_paths = false);
        Ok(strategies)
    }

    /// The error for light paths that the driver left unfinished.
    pub(crate) fn unfinished(&self, unfinished: u64, total: u64) -> Error {
        dispatch::unfinished_paths(unfinished, total, &self.scene)
    }
}
