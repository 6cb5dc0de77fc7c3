//! Randomized estimators, from a few products with random vectors: low-rank approximations, traces and the
//! diagonal.
//!
//! Every estimator takes a number of products that is known beforehand and a seed, and returns an error
//! estimate. The vectors depend only on the seed, so a journal of products repeats the same result after a
//! failure.
//!
//! | estimator | products | needs |
//! |---|---|---|
//! | [`randomized_svd`] | `2 (q + 1) l + probes` | `A v` and `Aᵀ u` |
//! | [`hutchinson`] | `m` | `A v` |
//! | [`hutch_plus_plus`] | `2 ⌊m/3⌋ + (m − 2 ⌊m/3⌋)` | `A v` |
//! | [`diagonal()`] | `m` | `A v` |

mod diagonal;
mod probe;
mod svd;
mod trace;

pub use diagonal::{DiagonalEstimate, diagonal};
pub use probe::{Estimate, LowRankOptions};
pub use svd::{RandomizedSvd, randomized_svd};
pub use trace::{hutch_plus_plus, hutchinson};
