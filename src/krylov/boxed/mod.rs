//! Least squares inside a box, `min ‖b − A x‖₂` over `lower ≤ x ≤ upper`: a projector shows values in [0, 1].
//!
//! An unconstrained solution that is clamped afterwards can be worse than none, so each method here respects
//! the bounds itself. [`ProjectedJacobi`] costs one product an iteration and is the baseline; [`Fista`] is
//! the accelerated projected gradient (two products, as the gradient is `Aᵀ(A x − b)`); [`KrylovBox`] learns
//! a model of the operator from all products so far. [`Mrnsd`] and [`Multiplicative`] keep `x ≥ 0` only, and
//! are here for comparison.

mod bounds;
mod coordinates;
mod fista;
mod gram;
mod jacobi;
mod krylov_box;
mod minimize;
mod model;
mod mrnsd;
mod multiplicative;
mod normal;
mod surrogate;

pub use fista::Fista;
pub use jacobi::ProjectedJacobi;
pub use krylov_box::KrylovBox;
pub use mrnsd::Mrnsd;
pub use multiplicative::Multiplicative;
pub use surrogate::Surrogate;
