//! The shaders' functions by themselves, run as the WGSL that the tracer runs.

mod chi_square;
mod directions;
mod furnace;
mod kernel;
mod material;
mod random;
mod reciprocity;
mod sampler;
mod statistics;
mod texture;
mod weights;
