//! The library: Krylov methods, light transport, rigs, and the files and pages of a run.

mod comb;
mod common;
mod krylov_gallery;
mod krylov_support;
mod matrix_support;
mod rig_support;

mod analysis;
mod krylov;
mod render;
mod report;
mod rig;
mod transport;
