//! The vectors of a Krylov process, in the memory where an operator computes its products.

use std::any::Any;
use std::borrow::Cow;

use super::Product;
use crate::error::{Error, Result};

/// The columns `V`, for example of an orthonormal basis, and a vector `w`; all have `n` entries.
///
/// An operator whose products are computed in another memory ([`Operator::vectors`](super::Operator::vectors)) keeps the vectors there.
/// Only coefficients then move at each step. After an error of that memory ([`Error::Device`]), the vectors are unspecified; after any
/// other error, only `w` is.
pub trait Vectors: Any + Send {
    /// `n`.
    fn rows(&self) -> usize;

    /// The number of columns.
    fn columns(&self) -> usize;

    /// Column `index`.
    ///
    /// # Errors
    /// The error of the memory in which the vectors are.
    fn column(&self, index: usize) -> Result<Cow<'_, [f64]>>;

    /// `w`. Fails as [`Vectors::column`].
    fn work(&self) -> Result<Cow<'_, [f64]>>;

    /// `w ← x`. Fails as [`Vectors::column`].
    fn load(&mut self, x: &[f64]) -> Result<()>;

    /// Removes all columns, and keeps their memory.
    fn clear(&mut self);

    /// `V ← [V w/divisor]`. Fails as [`Vectors::column`].
    fn push(&mut self, divisor: f64) -> Result<()>;

    /// `w ← w − V h` over the first columns, one for each coefficient. Fails as [`Vectors::column`].
    fn remove(&mut self, h: &[f64]) -> Result<()>;

    /// `Vᵀ w` over the columns from `first`, and `‖w‖`. Fails as [`Vectors::column`].
    fn dots_and_norm(&mut self, first: usize) -> Result<Sums>;

    /// `w ← w − V h` over all columns; then `Vᵀ w` and `‖w‖`. Fails as [`Vectors::column`].
    fn remove_and_dot(&mut self, h: &[f64]) -> Result<Sums>;

    /// Removes small parts from the last column, and the known parts from `w`; then `Vᵀ w` with the new last column, and `‖w‖`. Fails as
    /// [`Vectors::column`].
    fn settle_and_dot(&mut self, settling: &Settling<'_>) -> Result<Sums>;

    /// `to ← (Σ c v)/divisor`, for one to three terms `(c, v)`. A vector is a column, or `w` if it is `None`. Fails as [`Vectors::column`],
    /// and with [`Error::Numerical`] if this memory cannot combine these columns. The default, for vectors in the host's memory, always
    /// fails.
    fn combine(&mut self, to: Option<usize>, terms: &[(f64, Option<usize>)], divisor: f64) -> Result<()> {
        let _ = (to, terms, divisor);
        Err(made_elsewhere())
    }

    /// Overwrites column `index` with `w`. Fails as [`Vectors::combine`].
    fn keep(&mut self, index: usize) -> Result<()> {
        let _ = index;
        Err(made_elsewhere())
    }

    /// `wᵢ ← vᵢ wᵢ` for column `index`. Fails as [`Vectors::combine`].
    fn scale_by(&mut self, index: usize) -> Result<()> {
        let _ = index;
        Err(made_elsewhere())
    }

    /// Moves each `wᵢ` into the interval from `lower · vᵢ` to `upper · vᵢ`, for column `index` without negative entries. Fails as
    /// [`Vectors::combine`].
    fn clip_by(&mut self, index: usize, (lower, upper): (f64, f64)) -> Result<()> {
        let _ = (index, lower, upper);
        Err(made_elsewhere())
    }

    /// The last product that [`Operator::apply_within`](super::Operator::apply_within) computed in these vectors: `x` and `A x` or `Aᵀ x`,
    /// of all `n` entries, also with a selection. Fails as [`Vectors::column`]. The default, for vectors in the host's memory, always
    /// fails.
    fn product(&self) -> Result<Product> {
        Err(made_elsewhere())
    }
}

/// Some entries of the vectors of an operator, and a factor for each. With the `m × n` matrix `S` that selects and multiplies these
/// entries, the products of an operator `A` of `n × n` become `S A Sᵀ v`, for vectors `v` of `m` entries.
#[derive(Clone, Copy, Debug)]
pub struct Selection<'a> {
    /// The indices of the entries, in ascending order (`m`).
    pub entries: &'a [usize],
    /// Their factors (`m`).
    pub factors: &'a [f64],
}

/// Inner products `Vᵀ w`, and `‖w‖`.
pub type Sums = (Vec<f64>, f64);

/// The parts that [`Vectors::settle_and_dot`] removes from a vector `w` and from the last column.
#[derive(Clone, Copy, Debug)]
pub struct Settling<'a> {
    /// The parts of the last column along the columns before it, one for each. Empty if there are none.
    pub late: &'a [f64],
    /// The coefficients of `w` on the last columns, as they are before the last column changes.
    pub along: &'a [f64],
    /// Small coefficients of `w` on the columns before the last one, one for each; 0 for the columns of `along`. They count only if there
    /// are late parts.
    pub ahead: &'a [f64],
}

/// The error of [`Operator::apply_within`](super::Operator::apply_within) for vectors that another operator made.
pub(crate) fn made_elsewhere() -> Error {
    Error::Numerical("the vectors of a product were made by another operator".into())
}

/// Returns true if a memory combines columns up to this one. Overwrites `w`. Fails with the error of the memory.
pub(crate) fn can_combine(vectors: &mut dyn Vectors, last: usize) -> Result<bool> {
    match vectors.combine(None, &[(1.0, Some(last))], 1.0) {
        Err(failed @ Error::Device { .. }) => Err(failed),
        combined => Ok(combined.is_ok()),
    }
}

/// `sum ← sum + V y`, over the columns from `first`, one for each coefficient. Overwrites `w`. After an error of the memory, `sum` is
/// unchanged.
pub(crate) fn accumulate(vectors: &mut dyn Vectors, first: usize, y: &[f64], sum: &mut [f64]) -> Result<()> {
    vectors.load(sum)?;
    let h: Vec<f64> = std::iter::repeat_n(0.0, first).chain(y.iter().map(|y| -y)).collect();
    vectors.remove(&h)?;
    sum.copy_from_slice(&vectors.work()?);
    Ok(())
}

/// Computes `‖w‖` from the known value of `wᵀw`, without intermediate overflow or underflow.
pub(crate) fn norm_of_square(square: f64, w: &[f64]) -> f64 {
    if is_ordinary(square) {
        return square.sqrt();
    }
    let largest = w.iter().fold(0.0_f64, |largest, value| {
        if value.is_nan() || largest.is_nan() { f64::NAN } else { largest.max(value.abs()) }
    });
    if largest == 0.0 || !largest.is_finite() {
        return largest;
    }
    largest * w.iter().map(|value| (value / largest).powi(2)).sum::<f64>().sqrt()
}

/// Whether no significant square in a sum of squares of this value has overflowed or underflowed.
pub(crate) fn is_ordinary(square: f64) -> bool {
    (1e-280..1e300).contains(&square)
}
