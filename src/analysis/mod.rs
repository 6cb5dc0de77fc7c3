//! Analyses of light transport, based on operators and the Krylov methods.
//!
//! | question | modules and types |
//! |---|---|
//! | which pixels exchange light? | [`mod@segment`]; its photos: [`Capture`] |
//! | which matrix does segmentation use? | [`Graph`], [`CutMatrix`] |
//! | which pattern makes the scene look like a target? | [`mod@compensate`], for a [`Target`] |
//! | how is direct light left out, or an operator blurred? | [`mod@direct`]: [`WithoutDirect`], [`Blurred`] |
//! | which light comes straight from the projector? | [`mod@separate`] |
//! | how does the scene look under another pattern? | [`mod@low_rank`] |
//! | from how far away does light come? | [`mod@probe`] |
//! | which groups do points form? | [`mod@kmeans`] |
//! | how well do two segmentations agree? | [`adjusted_rand_index`] |
//! | what does a measurement on a rig cost, and how accurate is it? | [`mod@plan`] |
//! | how similar are two images? | [`mod@similarity`] |
//! | how good is a result, judged by light that it was not computed from? | [`mod@verification`] |

pub mod brute_force;
pub mod captures;
pub mod compensate;
pub mod direct;
pub mod kmeans;
pub mod low_rank;
pub mod plan;
pub mod planes;
pub mod probe;
pub mod segment;
pub mod separate;
pub mod similarity;
pub mod verification;

pub use compensate::{
    Clamping, CompensateOptions, Compensation, CompensationRow, Crosstalk, MethodRun, Precondition, Prior,
    Target,
};
pub use direct::{Blurred, WithoutDirect};
pub use low_rank::LowRank;
pub use probe::{Probed, Probing};
pub use segment::{
    Capture, Coordinates, Cut, CutMatrix, Evidence, FeatureView, Graph, MASKED, Regions, SegmentOptions,
    Segmentation, adjusted_rand_index,
};
pub use separate::Separation;
pub use similarity::Similarity;
pub use verification::EigenpairEstimate;
