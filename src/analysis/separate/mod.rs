//! Separation: which light came straight from the projector, and which by way of other surfaces.
//!
//! | by | photos | exact where |
//! |---|---|---|
//! | [`checkerboards`] | `shifts²` | global light does not see the squares |
//! | [`sinusoids`] | 3 or more a direction | global light does not see the waves |
//! | [`random_patterns`] | any number | always on average; the noise falls as `1/√photos` |
//! | [`from_capture`] | the white one | roughly, from the photos of a Krylov capture |
//!
//! The first two are those of Nayar, Krishnan, Grossberg and Raskar, *Fast separation of direct and global components of a scene
//! using high frequency illumination* (2006), doi:10.1145/1141911.1141977; they fail where global light is sharp, as behind a
//! mirror. The other two estimate the diagonal of `A`, which a coaxial rig's direct light is (and so see mirrors as they are). A
//! simulator knows each bounce and needs none of this: [`crate::transport::Part`], [`crate::transport::Layer`].

mod bounces;
mod by;
mod comparison;
mod high_frequency;
mod near_far;
mod statistical;

pub use bounces::second_and_rest;
pub use by::{SeparateBy, separate};
pub use comparison::{ComparisonRow, compare_separations};
pub use high_frequency::{checkerboards, sinusoids};
pub use near_far::{NearFar, NearFarOptions, near_far};
pub use statistical::{from_capture, random_patterns};

/// Direct and global light under an all-ones pattern.
#[derive(Clone, Debug, PartialEq)]
pub struct Separation {
    /// One bounce (`n`).
    pub direct: Vec<f64>,
    /// Two bounces and more (`n`).
    pub global: Vec<f64>,
    /// Standard errors of `direct` (`n`), where the method can tell them.
    pub standard_error: Option<Vec<f64>>,
    /// Photos taken, the white one included.
    pub photos: usize,
}
