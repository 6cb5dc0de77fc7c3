//! The Rayleigh–Ritz method: approximate eigenpairs from a subspace, without a product.

pub(super) mod general;
mod pairs;
pub(super) mod symmetric;

pub use pairs::{PairStatus, RitzPair, Which, temple_kato};
