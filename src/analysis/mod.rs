//! Answers about light transport, from operators and the Krylov methods.
//!
//! | question | here |
//! |---|---|
//! | which pixels exchange light? | [`mod@segment`]; the photos it takes: [`Capture`] |
//! | on which matrix | [`Graph`], [`NormalizedAdjacency`], [`NegativeLaplacian`] |
//! | what is to be projected, so that the scene looks as wanted? | [`mod@compensate`], for a [`Wish`] |
//! | which light came straight from the projector? | [`mod@separate`] |
//! | how does it look under another pattern? | [`mod@low_rank`] |
//! | which light came from how far away? | [`mod@probe`] |
//! | groups from eigenvectors | [`mod@kmeans`] |
//! | is the source a linear, symmetric operator at all? | [`mod@audit`] |
//! | how good are they? | [`adjusted_rand_index`] |
//! | what will it cost on a rig, and how good will it be? | [`mod@plan`] |
//! | how alike are two images? | [`mod@likeness`] |

mod adjacency;
pub mod audit;
mod capture;
pub mod compensate;
mod graph;
pub mod kmeans;
mod laplacian;
pub mod likeness;
pub mod low_rank;
pub mod plan;
pub mod probe;
mod rand_index;
pub mod segment;
mod segmentation;
pub mod separate;

pub use adjacency::NormalizedAdjacency;
pub use capture::Capture;
pub use compensate::{CompensateOptions, Compensation, CompensationRow, Precondition, Wish};
pub use graph::Graph;
pub use laplacian::NegativeLaplacian;
pub use likeness::Likeness;
pub use low_rank::LowRank;
pub use probe::{Probed, Probing};
pub use rand_index::adjusted_rand_index;
pub use segmentation::{Cut, MASKED, SegmentOptions, Segmentation};
pub use separate::Separation;
