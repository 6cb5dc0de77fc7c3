//! How much of the work one dispatch takes: sized by measured time, and marked so that none goes missing.

use std::time::Duration;

use crate::gpu::Gpu;

/// A dispatch aims at this time: short enough for progress, cancellation and a GPU's watchdog, long enough that its
/// overhead does not show.
const TARGET: Duration = Duration::from_millis(100);

/// Bytes of records that a dispatch leaves, at most: enough paths to keep a GPU busy.
const RECORD_BYTES: u64 = 64 << 20;

/// The same where the device is the processor itself, and the records of two dispatches had better stay in its caches.
const RECORD_BYTES_IN_CACHE: u64 = 8 << 20;

/// Paths in one dispatch at most: 65,535 workgroups of 64.
pub(super) const MAX_PATHS: u32 = 65_535 * 64;

/// The dispatches of one tracer.
#[derive(Default)]
pub(super) struct Dispatches {
    count: u32,
}

impl Dispatches {
    /// A mark for the next dispatch, in the upper 16 bits: not 0, and another than the last 65,534 ones.
    pub(super) fn mark(&mut self) -> u32 {
        self.count = self.count % 0xffff + 1;
        self.count << 16
    }

    /// Paths that one dispatch may take, of `total`, when each leaves `stride` records of 16 bytes.
    pub(super) fn capacity(&self, gpu: &Gpu, stride: u64, total: u64) -> u32 {
        let wish = if gpu.shares_memory { RECORD_BYTES_IN_CACHE } else { RECORD_BYTES };
        let room = wish.min(gpu.summary.max_storage_binding).min(gpu.summary.max_buffer);
        (room / (16 * stride)).min(u64::from(MAX_PATHS)).min(total.max(64)) as u32
    }
}

/// How many paths the next dispatch takes.
pub(super) struct BatchSize {
    paths: u32,
    most: u32,
    state: State,
}

/// What is known of the time that a path takes.
#[derive(PartialEq)]
enum State {
    /// Nothing: the first dispatch of a pipeline compiles it, so that its time says nothing either.
    Cold,
    /// Too little, from dispatches that were mostly overhead.
    Growing,
    Steady,
}

impl BatchSize {
    pub(super) fn new(most: u32) -> Self {
        Self { paths: 64, most, state: State::Cold }
    }

    pub(super) fn paths(&self) -> u32 {
        self.paths
    }

    /// How many dispatches the device should have at a time: a second one, so that it need not wait for the host, as soon as
    /// its size means something.
    pub(super) fn flights(&self) -> usize {
        if self.state == State::Steady { 2 } else { 1 }
    }

    /// Learns that a dispatch of `paths` took `elapsed`.
    pub(super) fn adapt(&mut self, paths: u32, elapsed: Duration) {
        let wish = if self.state == State::Cold {
            4096.0
        } else {
            // Grow at most fourfold: a short dispatch is mostly overhead and would mislead.
            f64::from(paths) * (TARGET.as_secs_f64() / elapsed.as_secs_f64().max(1e-6)).min(4.0)
        };
        self.paths = (wish as u32).next_multiple_of(64).clamp(64, self.most.max(64));
        self.paths = self.paths.min(self.most);
        let grows = self.state == State::Cold || f64::from(self.paths) > 2.0 * f64::from(paths);
        self.state = if grows { State::Growing } else { State::Steady };
    }
}
