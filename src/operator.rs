//! Linear operators as the Krylov methods see them: signed real vectors, and a product that may fail.

use crate::error::Result;

/// What is known about an operator's symmetry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// `A = Aᵀ`, to rounding or by construction.
    Symmetric,
    /// Nothing is known.
    General,
}

/// A linear operator `A` of `rows × cols`. A product is dear (a photo, on a rig), and can fail (a rig can be unplugged).
pub trait Operator {
    /// The length of `y` in `y = A x`.
    fn rows(&self) -> usize;
    /// The length of `x` in `y = A x`.
    fn cols(&self) -> usize;
    /// What is known about symmetry.
    fn symmetry(&self) -> Symmetry;
    /// `y ← A x`; every entry of `y` is overwritten.
    ///
    /// # Errors
    /// Whatever kept the product from being taken; `y` is unspecified then.
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()>;
}

/// An operator whose transpose can be applied too.
pub trait Adjoint: Operator {
    /// `x ← Aᵀ y`; every entry of `x` is overwritten.
    ///
    /// # Errors
    /// As [`Operator::apply`].
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()>;
}
