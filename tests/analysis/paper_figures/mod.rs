//! The paper's figures of segmentation and compensation, as statements with numbers, at resolutions that tests can afford.
//!
//! | figure | what is stated | where |
//! |---|---|---|
//! | 2 | the principal eigenvector | `eigenvectors` |
//! | 4, 6, 8 | groups: two folds, a sheet behind a post, an egg carton | `segmentation` |
//! | 11, 12 | compensation in focus and out of it | `compensation` |
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

mod bench;
mod beyond;
mod compensation;
mod eigenvectors;
mod segmentation;
