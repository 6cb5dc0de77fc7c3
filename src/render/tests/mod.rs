//! Tests of the shaders' functions, which run as the WGSL that the tracer runs, and of whole traces.

mod chi_square;
mod compiled;
mod directions;
mod fresnel;
mod furnace;
mod invocations;
mod kernel;
mod light_buffer;
mod material;
mod observer;
mod path_records;
mod photons;
mod random;
mod reciprocity;
mod sampler;
mod samples;
mod statistics;
mod surface;
mod texture;
mod weights;
