//! The times of compute passes, as the device's own clock measures them. They are measured only on request, for benchmarks.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use wgpu::{BufferUsages, QuerySet};

use super::Gpu;
use crate::error::{Error, Result};

/// The number of passes that can be timed between two readings; each takes two queries. Later passes are not timed.
const PASSES: u32 = 2048;

#[derive(Default)]
pub(super) struct Stopwatch(Mutex<Option<Running>>);

struct Running {
    queries: QuerySet,
    /// The name of each timed pass.
    passes: Vec<&'static str>,
}

impl Gpu {
    /// Begins to time all passes of this device. Fails with [`Error::Device`] if its driver has no timestamps.
    pub(crate) fn start_stopwatch(&self) -> Result<()> {
        if !self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return Err(Error::device(format!("{} has no timestamps", self.summary.name)));
        }
        let queries = self.guarded("timestamps", || {
            self.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("times of passes"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * PASSES,
            })
        })?;
        *self.stopwatch() = Some(Running { queries, passes: Vec::new() });
        Ok(())
    }

    /// Whether passes are timed.
    pub(crate) fn is_timed(&self) -> bool {
        self.stopwatch().is_some()
    }

    fn stopwatch(&self) -> std::sync::MutexGuard<'_, Option<Running>> {
        self.kept.stopwatch.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins a compute pass. If the stopwatch runs, the pass is timed under the name of what it does.
    pub(crate) fn pass<'a>(
        &self,
        encoder: &'a mut wgpu::CommandEncoder,
        what: &'static str,
    ) -> wgpu::ComputePass<'a> {
        let mut stopwatch = self.stopwatch();
        let running = stopwatch.as_mut().filter(|running| running.passes.len() < PASSES as usize);
        let timestamp_writes = running.map(|running| {
            running.passes.push(what);
            let last = 2 * running.passes.len() as u32 - 1;
            wgpu::ComputePassTimestampWrites {
                query_set: &running.queries,
                beginning_of_pass_write_index: Some(last - 1),
                end_of_pass_write_index: Some(last),
            }
        });
        encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(what), timestamp_writes })
    }

    /// Stops the stopwatch. Returns what each pass did, and its time.
    pub(crate) fn stop_stopwatch(&self) -> Result<Vec<(&'static str, Duration)>> {
        let Some(Running { queries, passes }) = self.stopwatch().take() else { return Ok(Vec::new()) };
        let count = 2 * passes.len();
        if count == 0 {
            return Ok(Vec::new());
        }
        let usage = BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC;
        let to = self.buffer("times of passes", 8 * count as u64, usage)?;
        self.submit("timestamps", |encoder| {
            encoder.resolve_query_set(&queries, 0..count as u32, &to, 0);
        })?;
        let ticks = self.read::<u64>(&to, count)?;
        let period = f64::from(self.queue.get_timestamp_period());
        let time = |[begin, end]: &[u64; 2]| {
            Duration::from_secs_f64(1e-9 * period * end.saturating_sub(*begin) as f64)
        };
        Ok(passes.into_iter().zip(ticks.as_chunks::<2>().0.iter().map(time)).collect())
    }
}
