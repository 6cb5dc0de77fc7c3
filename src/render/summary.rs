//! The cost of a finished trace.

use std::time::Duration;

/// The cost of a trace.
#[derive(Clone, Copy, Debug, Default)]
pub struct TraceSummary {
    /// Light paths traced.
    pub paths: u64,
    /// Rays traced for them: to the next surface, and to the other endpoint.
    pub rays: u64,
    /// Number of dispatches.
    pub dispatches: u32,
    /// Wall time of the longest dispatch, including its read-back. The time of a dispatch that waited for
    /// another one starts when that one was done. The host may notice the end of a dispatch late, while it
    /// reads the records of another one.
    pub longest: Duration,
    /// The sum of these times over all dispatches.
    pub tracing: Duration,
}
