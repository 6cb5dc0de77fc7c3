//! The path tracer: it traces the light paths of a scene, as connections between camera pixels and projector
//! pixels.
//!
#![doc = include_str!("../../guide/src/right/operator.md")]

mod batch;
mod chains;
mod device_merge;
mod dispatch;
mod features;
mod geometry;
mod light_buffer;
mod materials;
mod output;
mod pairs;
mod parameters;
mod photon_grid;
mod photons;
mod piles;
mod pipeline;
mod records;
mod rig;
mod sampler;
mod settings;
mod start_pixels;
mod strategy;
mod strategy_run;
mod summary;
#[cfg(test)]
mod tests;
mod textures;
mod tracer;
mod unit;

pub(crate) use batch::Recorded;
pub use batch::{Batch, Run};
pub(crate) use device_merge::{MergeRequest, Merged};
pub use materials::MIN_ALPHA;
pub use photons::Gather;
pub use records::Connection;
pub(crate) use records::{End, PIXEL_MASK};
pub use sampler::Sampler;
pub use settings::{MAX_BOUNCES, TraceSettings};
pub use start_pixels::StartPixels;
pub use summary::TraceSummary;
pub use tracer::Tracer;

pub use crate::gpu::AdapterSummary;

/// All graphics adapters of this machine that can trace. The list may be empty.
///
/// # Errors
/// [`crate::Error::Device`] where `ulimit -v` leaves no room for a driver.
pub fn adapters() -> crate::Result<Vec<AdapterSummary>> {
    crate::gpu::device::adapters()
}

/// The error for a machine without any adapter. It says what to install.
pub fn no_adapter() -> crate::Error {
    crate::gpu::device::no_adapter()
}
