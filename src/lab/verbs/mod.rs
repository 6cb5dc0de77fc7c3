//! What the verbs of the command line ask, as methods of a laboratory: each takes a request, and returns an answer with arrays in it.

mod audit;
mod calibrate;
mod flat_field;
mod join;
mod matrix;
mod photo;
mod plan;
mod probe;
mod relight;
mod scaling;
mod separate;
mod shard;
mod solve;

pub use calibrate::Calibrated;
pub use join::{JoinedShards, join_shards};
pub use matrix::MatrixRequest;
pub use photo::SinglePhoto;
pub use plan::{Plan, PlanRequest};
pub use relight::{BLOCK, Questions, RelightRequest};
pub use scaling::Scaling;
pub use separate::SeparateRequest;
pub use shard::TracedShard;
