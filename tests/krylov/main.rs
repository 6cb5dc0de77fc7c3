//! The Krylov methods, against dense solutions and against SciPy.

#[path = "../comb/mod.rs"]
mod comb;
#[path = "../common/mod.rs"]
mod common;
#[path = "../krylov_gallery/mod.rs"]
mod krylov_gallery;
#[path = "../krylov_support/mod.rs"]
mod krylov_support;

mod arnoldi;
mod block;
mod boxed;
mod completeness;
mod eigs;
mod estimators;
mod lanczos;
mod linear;
mod orthogonal;
mod powers;
mod save;
mod scipy;
mod singular;
mod trajectories;
