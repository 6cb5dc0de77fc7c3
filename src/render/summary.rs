//! The cost of a finished trace.

use std::time::Duration;

/// The cost of a trace.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct TraceSummary {
    /// Light paths traced.
    pub paths: u64,
    /// Rays traced for them: to the next surface, and to the other endpoint.
    pub rays: u64,
    /// Number of dispatches.
    pub dispatches: u32,
    /// Number of those whose contributions the device sorted and summed.
    pub merged: u32,
    /// Wall time of the longest dispatch, including its read-back. The time of a dispatch that waited for
    /// another one starts when that one was done. The host may notice the end of a dispatch late, while it
    /// reads the records of another one.
    pub longest: Duration,
    /// The sum of these times over all dispatches.
    pub tracing: Duration,
}

impl TraceSummary {
    /// Adds the cost of a trace that ran at the same time in another process: its paths, rays and dispatches; the time is that of the longer one.
    pub(crate) fn add_parallel(&mut self, other: &Self) {
        self.paths += other.paths;
        self.rays += other.rays;
        self.dispatches += other.dispatches;
        self.merged += other.merged;
        self.longest = self.longest.max(other.longest);
        self.tracing = self.tracing.max(other.tracing);
    }
}
