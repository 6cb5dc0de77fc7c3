//! Rayleigh–Ritz: eigenpairs of the operator on a subspace, at no product.

pub(super) mod general;
mod pairs;
pub(super) mod symmetric;

pub use pairs::{PairStatus, RitzPair, Which};
