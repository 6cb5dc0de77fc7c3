//! What the verbs of the command line ask, as methods of a laboratory: each takes a request, and returns an answer with arrays in it.

mod audit;
mod calibrate;
mod compensate;
mod flat_field;
mod join;
mod matrix;
mod model;
mod photo;
mod plan;
mod probe;
mod scaling;
mod shard;
mod solve;

pub use calibrate::Calibrated;
pub use compensate::{ColorMixing, CompensateAnswer, CompensateRequest};
pub use join::{JoinedShards, join_shards};
pub use matrix::MatrixRequest;
pub use photo::SinglePhoto;
pub use plan::{Plan, PlanRequest};
pub use scaling::Scaling;
pub use shard::TracedShard;
