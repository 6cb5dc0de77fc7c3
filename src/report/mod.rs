//! What a run leaves behind: arrays, pictures, matrices, plots, the page and the record of how they came about.
//!
//!

pub mod atomic;
pub mod clock;
pub mod manifest;
