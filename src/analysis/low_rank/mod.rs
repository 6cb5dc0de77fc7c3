//! Low-rank light transport: a single capture of `k` photos relights any pattern without further photos.
//!
//! The Krylov process gives an orthonormal basis `Q` (`n × k`) and the photos `W = G Q` of the basis vectors. For a symmetric `G`, the
//! photos contain more than the projection `Q QᵀG Q Qᵀ`. They contain all of `G` except the part that maps the orthogonal complement of `Q`
//! into itself:
//!
//! ```text
//! G_k = W Qᵀ + Q Wᵀ − Q (QᵀW) Qᵀ,      G − G_k = (I − Q Qᵀ) G (I − Q Qᵀ)
//! ```
//!
//! `G_k` is symmetric, and exact on the span of `Q`. For a matrix `G` that is not symmetric, `G_k = W Qᵀ`. Direct light has no low rank (on
//! a coaxial rig it is a diagonal) and is stored separately: `A ≈ D + G_k`. Without further photos, the model relights any pattern,
//! computes dual photographs, and removes interreflections from photos ([`cancel_interreflections`]).
//!
//! The source is O'Toole and Kutulakos, *Optical computing for fast light transport analysis* (2010), doi:10.1145/1882261.1866165. Their
//! optical Arnoldi process acquires a low-rank approximation of the matrix for relighting.

mod capture;
mod channels;
mod inverse;
mod model;
mod relight;

pub use capture::{LowRankCapture, capture, estimated_direct, from_products, smooth_starts};
pub use channels::{
    DirectPart, ErrorRow, RankRow, capture_channels, diagonal_of, error_curve, optimal_errors, rank_curve,
};
pub use inverse::{Cancelled, cancel_interreflections};
pub use model::LowRank;
pub use relight::{Dual, Reduced, Relit, SavedModel};
