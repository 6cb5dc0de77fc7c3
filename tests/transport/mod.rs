//! The transport matrix: as an operator, its noise, and as it is kept on disk.

mod cache;
mod estimated;
mod matrix;
mod noise;
mod operators;
mod shards;
mod vectors;
