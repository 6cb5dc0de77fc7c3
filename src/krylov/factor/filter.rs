//! The filter of the directions of a factorization whose products are noisy.

use std::sync::Arc;

/// A function of the rest of a product and the share of noise in it; see [`Filter::new`].
type Of = dyn Fn(&[f64], f64) -> Option<Vec<f64>> + Send + Sync;

/// Removes noise from the next direction of a Krylov process.
///
/// The next direction is what a product adds to the span. Where most of it is noise, the process goes on into noise, and finds nothing. A
/// filter knows what noise looks like, and hands on a direction without most of it. Eigenvalues are not distorted: they come from the
/// products themselves, projected on whatever directions there are.
#[derive(Clone)]
pub struct Filter(Arc<Of>);

impl Filter {
    /// A filter by a function. It gets the rest of a product, of length `n`, and the expected share of noise in its norm, from 0 to 1. It
    /// returns the direction of length `n` to go on with; `None` leaves it as it is.
    pub fn new(of: impl Fn(&[f64], f64) -> Option<Vec<f64>> + Send + Sync + 'static) -> Self {
        Self(Arc::new(of))
    }

    /// The direction to go on with.
    pub fn apply(&self, rest: &[f64], share: f64) -> Option<Vec<f64>> {
        (self.0)(rest, share)
    }
}

impl std::fmt::Debug for Filter {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("Filter")
    }
}
