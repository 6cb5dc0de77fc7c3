//! The verbs of the command line as methods of a laboratory. Each takes a request, and returns an answer with arrays.

mod audit;
mod machines;
mod matrix;
mod model;
mod photo;
mod probe;
mod solve;

pub use machines::{JoinedShards, Scaling, TracedShard, join_shards};
pub use matrix::MatrixRequest;
pub use photo::SinglePhoto;
