//! How much of the work one dispatch takes: sized by measured time, and marked so that none goes missing.

use std::time::Duration;

use crate::gpu::Gpu;

/// A dispatch aims at this time: short enough for progress, cancellation and a GPU's watchdog, long enough that its
/// overhead does not show.
const TARGET: Duration = Duration::from_millis(100);

/// Bytes of records read back at a time, at most.
const RECORD_BYTES: u64 = 64 << 20;

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
        let room = RECORD_BYTES.min(gpu.summary.max_storage_binding).min(gpu.summary.max_buffer);
        (room / (16 * stride)).min(u64::from(MAX_PATHS)).min(total.max(64)) as u32
    }
}

/// How many paths the next dispatch takes.
pub(super) struct BatchSize {
    paths: u32,
    most: u32,
    /// The first dispatch of a pipeline compiles it, so its time says nothing.
    warm: bool,
}

impl BatchSize {
    pub(super) fn new(most: u32) -> Self {
        Self { paths: 64, most, warm: false }
    }

    pub(super) fn paths(&self) -> u32 {
        self.paths
    }

    pub(super) fn adapt(&mut self, elapsed: Duration) {
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
