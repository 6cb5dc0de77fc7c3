//! What a finished trace took.

use std::time::Duration;

/// What a trace took.
#[derive(Clone, Copy, Debug, Default)]
pub struct TraceSummary {
    /// Light paths traced.
    pub paths: u64,
    /// Rays traced for them: to the next surface, and to the other end.
    pub rays: u64,
    /// Dispatches, and the longest one.
    pub dispatches: u32,
    /// Wall time of the longest dispatch, its read-back included; one that waited for another counts from then on. The host may see
    /// its end late, when it is taking in another's paths.
    pub longest: Duration,
    /// The same of all dispatches together.
    pub tracing: Duration,
}
