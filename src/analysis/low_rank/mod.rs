//! Low-rank light transport: one capture of `k` photos, then any pattern relit with no further photo.
//!
//! The Krylov process leaves an orthonormal basis `Q` (`n × k`) and the photos `W = G Q` of its patterns. Where `G` is symmetric
//! these tell more than the projection `Q QᵀG Q Qᵀ`: everything of `G` but what maps the rest of the space into itself,
//!
//! ```text
//! G_k = W Qᵀ + Q Wᵀ − Q (QᵀW) Qᵀ,      G − G_k = (I − Q Qᵀ) G (I − Q Qᵀ)
//! ```
//!
//! which is exact on the span of `Q` and symmetric. Where `G` is not symmetric, `G_k = W Qᵀ`. Direct light has no low rank (it is
//! the diagonal, for a coaxial rig): it is kept apart, `A ≈ D + G_k`. What the model answers, it answers at no further photo: any
//! pattern relit, dual photographs, and photos without their interreflections ([`cancel_interreflections`]).
//!
//! O'Toole and Kutulakos, *Optical computing for fast light transport analysis* (2010), doi:10.1145/1882261.1866165, sections 4
//! and 7; there with Arnoldi, `W Qᵀ`, and no diagonal.

mod capture;
mod channels;
mod error_curve;
mod from_products;
mod inverse;
mod model;
mod relight;
mod saved;

pub use capture::{LowRankCapture, capture, smooth_starts};
pub use channels::{DirectPart, RankRow, capture_channels, diagonal_of, rank_curve};
pub use error_curve::{ErrorRow, error_curve, optimal_errors};
pub use from_products::{estimated_direct, from_products};
pub use inverse::{Cancelled, cancel_interreflections};
pub use model::LowRank;
pub use relight::{Dual, Reduced, Relit};
pub use saved::SavedModel;
