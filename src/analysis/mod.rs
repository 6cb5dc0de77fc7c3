//! Answers about light transport, from operators and the Krylov methods.
//!
//! | question | here |
//! |---|---|
//! | which pixels exchange light? | [`mod@segment`]; the photos it takes: [`Capture`] |
//! | on which matrix | [`Graph`], [`NormalizedAdjacency`], [`NegativeLaplacian`] |
//! | what is to be projected, so that the scene looks as wanted? | [`mod@compensate`], for a [`Target`] |
//! | which part of the light is asked about: [`mod@direct`]; its blurring | [`WithoutDirect`], [`Blurred`] |
//! | which light came straight from the projector? | [`mod@separate`] |
//! | how does it look under another pattern? | [`mod@low_rank`] |
//! | which light came from how far away? | [`mod@probe`] |
//! | groups from eigenvectors | [`mod@kmeans`] |
//! | is the source a linear, symmetric operator at all? | [`mod@audit`] |
//! | do camera and projector look from one point? | [`mod@align`] |
//! | how good are they? | [`adjusted_rand_index`] |
//! | what will it cost on a rig, and how good will it be? | [`mod@plan`] |
//! | how alike are two images? | [`mod@similarity`] |

pub mod align;
pub mod audit;
pub mod brute_force;
pub mod compensate;
pub mod direct;
pub mod kmeans;
pub mod low_rank;
pub mod plan;
pub mod planes;
pub mod probe;
mod rand_index;
pub mod segment;
pub mod separate;
pub mod similarity;

pub use compensate::{
    Clamping, CompensateOptions, Compensation, CompensationRow, Crosstalk, MethodRun, Precondition, Prior,
    Target,
};
pub use direct::{Blurred, DirectMethod, WithoutDirect, measure_direct};
pub use low_rank::LowRank;
pub use probe::{Probed, Probing};
pub use rand_index::adjusted_rand_index;
pub use segment::{
    Capture, Cut, Evidence, FeatureView, Graph, MASKED, NegativeLaplacian, NormalizedAdjacency, Regions,
    SegmentOptions, Segmentation,
};
pub use separate::Separation;
pub use similarity::Similarity;
