//! The path tracer finds the light paths of a scene, which connect camera pixels and projector pixels.
#![doc = include_str!("../../guide/src/right/operator.md")]

mod batch;
mod dispatch;
mod geometry;
mod kernel;
mod launch;
mod light_buffer;
mod materials;
mod pairs;
mod photons;
mod resident;
mod settings;
mod strategy;
#[cfg(test)]
mod tests;
mod tracer;

pub use batch::{Batch, Connection, Run};
pub(crate) use batch::{End, PIXEL_MASK, RecordLayout, Recorded};
pub use materials::MIN_ALPHA;
pub use photons::Gather;
pub(crate) use resident::{Consumer, ResidentPaths};
pub use settings::{MAX_BOUNCES, Sampler, StartPixels, TraceSettings, TraceSummary};
pub use tracer::Tracer;

pub use crate::gpu::AdapterSummary;
pub use crate::gpu::device::{adapters, no_adapter};
