//! Eigenvalues and eigenvectors: answered from a factorization, or driven to within a budget of products.

mod driver;
mod eigs;
pub(super) mod general;
mod pairs;
mod power;
pub(super) mod symmetric;

pub use driver::eigs_from;
pub use eigs::{Eigs, EigsMethod, EigsOptions, eigs};
pub use pairs::{RitzPair, Verdict, Which};
