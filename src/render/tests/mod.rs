//! Tests of the shaders' functions, which run as the WGSL that the tracer runs, and of whole traces.

mod bsdf;
mod energy;
mod material;
mod paths;
mod random;
mod statistics;
mod support;
mod surface;
mod weights;
