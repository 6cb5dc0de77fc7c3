//! Segmentation, compensation and separation, and the figures of the paper that they make.

#[path = "../common/mod.rs"]
mod common;

mod compensation;
mod paper_figures;
mod segmentation;
mod separation;
