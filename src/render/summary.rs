//! What is told of a trace while it goes on, and when it is done.

use std::time::Duration;

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
