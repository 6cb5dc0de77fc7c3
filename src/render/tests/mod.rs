//! The shaders' functions by themselves, run as the WGSL that the tracer runs.

mod chi_square;
mod directions;
mod fresnel;
mod furnace;
mod invocations;
mod kernel;
mod left;
mod material;
mod observer;
mod random;
mod reciprocity;
mod sampler;
mod samples;
mod sight;
mod statistics;
mod surface;
mod texture;
mod weights;
