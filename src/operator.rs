//! Linear operators as the Krylov methods see them: signed real vectors, and a product that may fail.

mod closure;
mod each;
mod exchanged;
mod forward;
mod gram;
mod metered;
mod observed;
mod recorded;

pub use closure::Closure;
pub use each::each_product;
pub use exchanged::Exchanged;
pub(crate) use forward::delegate;
pub use gram::Gram;
pub use metered::Metered;
pub use observed::{Observed, Relayed};
pub use recorded::{Product, Recorded};

use crate::error::Result;
use crate::observer::Observer;

/// What is known about an operator's symmetry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// `A = Aᵀ`, to rounding or by construction.
    Symmetric,
    /// Nothing is known.
    General,
}

/// A linear operator `A` of `rows × cols`. A product is expensive (on a rig it is a photo) and can fail (a
/// rig can be unplugged).
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
    /// The error that kept the product from being taken; `y` is unspecified then.
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()>;

    /// `y_k ← A x_k` for each of `xs`, in order: the same bits as single products, and each counts as one
    /// product. There are as many `ys` as `xs`. By default the products are taken one by one.
    ///
    /// # Errors
    /// As [`Operator::apply`]; all of `ys` are unspecified then.
    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        debug_assert_eq!(xs.len(), ys.len());
        xs.iter().zip(ys).try_for_each(|(x, y)| self.apply(x, y))
    }

    /// How many products of a block take about as long as one. A method that knows several vectors beforehand
    /// asks for blocks of this size. By default 1, which is right wherever a product is a photo: no photo is
    /// then taken before it is needed.
    fn block_size(&self) -> usize {
        1
    }

    /// The observer of the computations with this operator, which sees each step and may stop them; by
    /// default `()`, which does nothing. An operator around another one returns the observer of that one.
    fn observer(&self) -> &dyn Observer {
        &()
    }

    /// The standard errors of the products that were taken last, in order: the expected `‖y − A x‖₂` due to noise
    /// for each vector of the last [`Operator::apply`] or [`Operator::apply_block`], or of the same with the
    /// transpose. Empty by default: the products are exact, or their errors are not known.
    fn standard_errors(&self) -> Vec<f64> {
        Vec::new()
    }

    /// The frames that a camera has taken so far for the rig behind this operator: those of exposures, takes, signs, bit planes, black and
    /// white and sentinels among them, and those that a journal had. `None` by default: products are computed, and cost no frames.
    fn frames(&self) -> Option<u64> {
        None
    }

    /// The standard error of `xᵀ A x` that all products share, and which no number of them averages out, where it is known; 0 by default. A
    /// rig that subtracts direct light has one: it measures this light once.
    ///
    /// # Errors
    /// As [`Operator::apply`]: what all products need may still have to be photographed.
    fn common_error(&mut self, x: &[f64]) -> Result<f64> {
        let _ = x;
        Ok(0.0)
    }

    /// Says whether products cost nothing, as those with a matrix in memory. Where they do, the products that follow while `on` only
    /// confirm an answer: they are no photos, and are neither counted nor shown. By default false: a product is a photo, whatever it is
    /// for.
    fn confirming(&mut self, on: bool) -> bool {
        let _ = on;
        false
    }

    /// The standard error of the last product, where a single one was taken; 0 where it is exact or not known.
    fn standard_error(&self) -> f64 {
        self.standard_errors().first().copied().unwrap_or(0.0)
    }
}

/// An operator whose transpose can be applied too.
pub trait Adjoint: Operator {
    /// `x ← Aᵀ y`; every entry of `x` is overwritten.
    ///
    /// # Errors
    /// As [`Operator::apply`].
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()>;

    /// `x_k ← Aᵀ y_k` for each of `ys`, in order, as [`Operator::apply_block`].
    ///
    /// # Errors
    /// As [`Operator::apply_block`].
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        debug_assert_eq!(xs.len(), ys.len());
        ys.iter().zip(xs).try_for_each(|(y, x)| self.apply_adjoint(y, x))
    }
}

/// The vectors as a block for [`Operator::apply_block`].
pub(crate) fn block(vectors: &[Vec<f64>]) -> Vec<&[f64]> {
    vectors.iter().map(Vec::as_slice).collect()
}

/// The vectors as a block that [`Operator::apply_block`] writes to.
pub(crate) fn block_mut(vectors: &mut [Vec<f64>]) -> Vec<&mut [f64]> {
    vectors.iter_mut().map(Vec::as_mut_slice).collect()
}
