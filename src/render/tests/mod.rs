//! Tests of whole traces, and of the shaders' functions, which run as the same WGSL that the tracer runs.

mod bsdf;
mod energy;
mod material;
mod paths;
mod random;
mod statistics;
pub(super) mod support;
mod surface;
mod weights;
