//! Separation of direct light, straight from the projector, from global light, which reached other surfaces first.
//!
//! | method | photos | accuracy |
//! |---|---|---|
//! | [`checkerboards`] | `shifts²` | exact if global light does not resolve the squares |
//! | [`sinusoids`] | 3 or more per direction | exact if global light does not resolve the waves |
//! | [`codes`] | 4, 8, 16, … | light of near pixels cancels; the rest is in the standard errors |
//! | [`random_patterns`] | any number | unbiased; the noise falls as `1/√photos` |
//! | [`from_capture`] | the white one | approximate, from the photos of a Krylov capture |
//!
//! The first two are by Nayar, Krishnan, Grossberg and Raskar, *Fast separation of direct and global components of a scene using
//! high frequency illumination* (2006), doi:10.1145/1141911.1141977; they fail where global light is sharp, as with a mirror. The
//! others estimate the diagonal of `A`, the direct light of a coaxial rig, and so handle mirrors. A simulator stores each bounce
//! and needs no separation: [`crate::transport::Part`], [`crate::transport::Layer`].

mod bounces;
mod by;
mod comparison;
mod hadamard;
mod high_frequency;
mod near_far;
mod statistical;

pub use bounces::second_and_rest;
pub use by::{SeparateBy, separate};
pub use comparison::{ComparisonRow, compare_separations};
pub use hadamard::codes;
pub use high_frequency::{checkerboards, sinusoids};
pub use near_far::{NearFar, NearFarOptions, near_far};
pub use statistical::{from_capture, random_patterns};

/// Direct and global light under white, an all-ones pattern.
#[derive(Clone, Debug, PartialEq)]
pub struct Separation {
    /// The light of one bounce (`n`).
    pub direct: Vec<f64>,
    /// The light of two and more bounces (`n`).
    pub global: Vec<f64>,
    /// Standard errors of `direct` (`n`), if the method gives them.
    pub standard_error: Option<Vec<f64>>,
    /// Standard errors of `global` (`n`), if the method gives them.
    pub global_error: Option<Vec<f64>>,
    /// Photos taken, the white one included.
    pub photos: usize,
}
