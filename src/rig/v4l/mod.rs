//! A camera behind Linux's video interface (feature `v4l`), which has not been tried on hardware.

mod spec;

pub use spec::{V4lFormat, V4lSpec};
