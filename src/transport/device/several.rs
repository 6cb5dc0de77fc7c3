//! Several equal devices: each traces the paths that start from some pixels and sums them to terms. The terms of the others move to the
//! first one by way of the host, and the first one makes the rows. A term does not depend on the device that sums it, and rows sort their
//! terms, so the bits are those of one device.

use std::ops::{ControlFlow, Range};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use super::parts::{Endpoint, Parts};
use super::{Assembling, Limits, self_test};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::observer::{Estimate, Level, Observer, Step};
use crate::render::{RecordLayout, StartPixels, TraceSettings, TraceSummary, Tracer};
use crate::transport::assembled::shape;
use crate::transport::{Channels, RigShape};

/// Tests the tracer's device and prepares the tracer. Returns the device, the shape of the rig, and the layouts of the records.
pub(super) fn prepared(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    channels: Channels,
) -> Result<(Gpu, RigShape, Vec<RecordLayout>)> {
    let gpu = tracer.gpu().clone();
    gpu.require_double_precision("sums of light")?;
    // The device is tested while the tracer prepares.
    let (works, layouts) =
        rayon::join(|| self_test::require_working(&gpu, channels), || tracer.prepare_resident(settings));
    Ok((gpu, shape(tracer, settings), works.and(layouts)?))
}

/// Traces the paths of all pixels, on the tracer's device and on those of the others, into `parts`. The observer of `tracer` sees its own
/// share of the paths. If it stops, or if a device fails, all devices stop.
pub(super) fn trace(
    (tracer, others): (&mut Tracer, &mut [Tracer]),
    settings: &TraceSettings,
    of: (Channels, bool),
    parts: &mut Parts<'_>,
) -> Result<TraceSummary> {
    let all = tracer.start_pixels(settings);
    if others.is_empty() {
        return tracer.trace_resident(settings, &all, parts);
    }
    let fewest =
        if all.projector.is_empty() { all.camera.len() } else { all.camera.len().min(all.projector.len()) };
    let mut shares = all.split((1 + others.len()).min(fewest)).into_iter();
    let own = shares.next().unwrap_or(all);
    let (observer, stop) = (tracer.observer(), Arc::new(AtomicBool::new(false)));
    let together = |user| Arc::new(Together { stop: Arc::clone(&stop), user });
    others.iter_mut().for_each(|other| other.observe(together(Arc::new(()))));
    tracer.observe(together(Arc::clone(&observer)));
    let limits = parts.of.limits;
    let (summary, moved) = thread::scope(|scope| {
        let shared = others.iter_mut().zip(shares).map(|(other, pixels)| {
            let stop = Arc::clone(&stop);
            let work = move || {
                let moved = Terms::traced(other, settings, of, &pixels, limits);
                stop.fetch_or(moved.is_err(), Ordering::Relaxed);
                moved
            };
            thread::Builder::new().spawn_scoped(scope, work)
        });
        let running: Vec<_> = shared.collect();
        let summary = tracer.trace_resident(settings, &own, parts);
        stop.fetch_or(summary.is_err(), Ordering::Relaxed);
        while running.iter().flatten().any(|thread| !thread.is_finished()) {
            // The user may stop the others, whose threads may need this one for their parallel work.
            let _ = tracer.observer().step(&Step {
                stage: "tracing",
                done: 1,
                total: 1,
                estimate: Estimate::None,
            });
            if rayon::yield_now() != Some(rayon::Yield::Executed) {
                thread::sleep(POLL);
            }
        }
        let join = |thread: std::io::Result<thread::ScopedJoinHandle<'_, Result<Terms>>>| {
            let thread = thread.map_err(|error| Error::device(format!("a thread for a device: {error}")))?;
            thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        (summary, running.into_iter().map(join).collect::<Vec<Result<Terms>>>())
    });
    tracer.observe(observer);
    let (mut all, mut errors) = (Vec::new(), Vec::new());
    for terms in moved {
        match terms {
            Ok(terms) => all.push(terms),
            Err(error) => errors.push(error),
        }
    }
    // When a device fails, the others are interrupted: its error is the cause.
    errors.sort_by_key(|error| matches!(error, Error::Interrupted));
    let mut summary = match (summary, errors.into_iter().next()) {
        (Err(Error::Interrupted) | Ok(_), Some(error)) | (Err(error), _) => return Err(error),
        (Ok(summary), None) => summary,
    };
    for terms in all {
        summary.add_parallel(&terms.summary);
        parts.receive(&terms)?;
    }
    Ok(summary)
}

/// The time between two looks at whether the other devices are done.
const POLL: Duration = Duration::from_millis(5);

/// The observer of a device that traces a share. The device stops if the user stops it, or if another device has stopped.
struct Together {
    stop: Arc<AtomicBool>,
    user: Arc<dyn Observer + Send + Sync>,
}

impl Observer for Together {
    fn step(&self, step: &Step<'_>) -> ControlFlow<()> {
        if !self.stop.load(Ordering::Relaxed) && self.user.step(step).is_continue() {
            return ControlFlow::Continue(());
        }
        self.stop.store(true, Ordering::Relaxed);
        ControlFlow::Break(())
    }

    fn log(&self, level: Level, message: &str) {
        self.user.log(level, message);
    }
}

/// The terms of a device, on their way to another one.
struct Terms {
    endpoints: Vec<OfEndpoint>,
    /// The number of terms of each row.
    counts: Vec<u32>,
    summary: TraceSummary,
}

struct OfEndpoint {
    /// The first part, and what the device has noted of each part from there on.
    first: usize,
    parts: Vec<[u32; 4]>,
    heads: Vec<f64>,
    /// The parts, keys and values of each arena.
    arenas: Vec<(Range<u32>, Vec<u32>, Vec<u32>)>,
}

impl Terms {
    /// Traces the paths from these pixels, and reads their terms.
    fn traced(
        tracer: &mut Tracer,
        settings: &TraceSettings,
        (channels, split): (Channels, bool),
        pixels: &StartPixels,
        limits: Limits,
    ) -> Result<Self> {
        let (gpu, rig, layouts) = prepared(tracer, settings, channels)?;
        let assembly =
            Assembling::new(&gpu, rig, channels, (settings.samples, split), &layouts, Some(limits))?;
        let mut parts = Parts::new(&assembly)?;
        let summary = tracer.trace_resident(settings, pixels, &mut parts)?;
        let counts = gpu.read::<u32>(&parts.counts, parts.counts.size() as usize / 4)?;
        let read = |endpoint: &Endpoint| {
            let ends = endpoint.arenas.last().map_or(0, |arena| arena.parts.end) as usize;
            let first = endpoint.arenas.first().map_or(0, |arena| arena.parts.start) as usize;
            let heads = endpoint.heads_of_part(channels);
            let arenas = endpoint.arenas.iter().map(|arena| {
                let terms = arena.terms as usize;
                let mut found =
                    gpu.read_all::<u32>(&[(&arena.keys, terms), (&arena.values, terms * channels.count())])?;
                let (values, keys) = (found.pop().unwrap_or_default(), found.pop().unwrap_or_default());
                Ok((arena.parts.clone(), keys, values))
            });
            Ok(OfEndpoint {
                first,
                parts: gpu.read::<[u32; 4]>(&endpoint.parts, ends)?.split_off(first),
                heads: gpu.read::<f64>(&endpoint.heads, ends * heads)?.split_off(first * heads),
                arenas: arenas.collect::<Result<_>>()?,
            })
        };
        let endpoints = parts.endpoints.iter().map(read).collect::<Result<_>>()?;
        Ok(Self { endpoints, counts, summary })
    }
}

impl Parts<'_> {
    /// Receives the terms of another device, which has traced the paths from other pixels.
    fn receive(&mut self, terms: &Terms) -> Result<()> {
        let (gpu, channels) = (self.of.gpu, self.of.channels);
        let own = gpu.read::<u32>(&self.counts, terms.counts.len())?;
        // The rows compare the sum of all counts with the number of terms, so a count that overflows is found there.
        let counts: Vec<u32> =
            own.iter().zip(&terms.counts).map(|(own, other)| own.wrapping_add(*other)).collect();
        gpu.fill("terms of rows", &self.counts, 0, bytemuck::cast_slice(&counts))?;
        for (index, moved) in terms.endpoints.iter().enumerate() {
            let endpoint = &self.endpoints[index];
            let heads = 8 * moved.first * endpoint.heads_of_part(channels);
            gpu.fill(
                "parts of paths",
                &endpoint.parts,
                16 * moved.first as u64,
                bytemuck::cast_slice(&moved.parts),
            )?;
            gpu.fill(
                "direct light of parts",
                &endpoint.heads,
                heads as u64,
                bytemuck::cast_slice(&moved.heads),
            )?;
            for (parts, keys, values) in &moved.arenas {
                let mut arena = self.arena(&self.endpoints[index], parts.start, keys.len().max(1) as u64)?;
                gpu.fill("keys of terms", &arena.keys, 0, bytemuck::cast_slice(keys))?;
                gpu.fill("values of terms", &arena.values, 0, bytemuck::cast_slice(values))?;
                arena.parts.end = parts.end;
                arena.terms = keys.len() as u64;
                self.endpoints[index].arenas.push(arena);
            }
        }
        Ok(())
    }
}
