//! The Krylov methods, against dense solutions and against SciPy.

mod arnoldi;
mod block;
mod boxed;
mod claims;
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
