//! Preconditioners: approximate inverses that cost no product.
//!
//! | preconditioner | `M⁻¹` | symmetric positive definite |
//! |---|---|---|
//! | [`Diagonal`] | division by a vector: `D = A 1`, or the direct image | yes, for positive entries |
//! | [`Multiscale`] | a gain for each scale of an image pyramid | yes, for positive gains |
//! | [`UserPreconditioner`] | a closure, or another operator | as the caller says |

mod diagonal;
mod multiscale;
mod user;

pub use diagonal::Diagonal;
pub use multiscale::Multiscale;
pub use user::UserPreconditioner;

use crate::error::Result;

/// An approximate inverse `M⁻¹` of `n × n`. Applying it takes no product with `A`.
pub trait Preconditioner: Send + Sync {
    /// The dimension `n`, or `None` where it fits any.
    fn size(&self) -> Option<usize>;
    /// `z ← M⁻¹ r`, both of length `n`; every entry of `z` is overwritten.
    ///
    /// # Errors
    /// The error of a preconditioner that is itself an operator.
    fn apply(&self, r: &[f64], z: &mut [f64]) -> Result<()>;
    /// Whether `M` is symmetric and positive definite, as CG, MINRES, LSQR and LSMR require.
    fn is_positive_definite(&self) -> bool;
}
