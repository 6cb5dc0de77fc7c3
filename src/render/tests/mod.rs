//! Tests of the shaders' functions, run as the same WGSL that the tracer runs, and of whole traces.

mod bsdf;
mod energy;
mod material;
mod paths;
mod random;
mod statistics;
pub(super) mod support;
mod surface;
mod weights;
