//! The interface of linear operators for the Krylov methods. Vectors are real and may have negative entries, and a product may fail.

mod both_ways;
pub(crate) mod vectors;
mod watched;

pub use both_ways::{Exchanged, Gram};
pub use vectors::{Selection, Settling, Sums, Vectors};
pub use watched::{Observed, Product, Recorded, Relayed};

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::observer::Observer;

/// The symmetry of an operator, as far as it is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// `A = Aᵀ`, to rounding or by construction.
    Symmetric,
    /// Nothing is known.
    General,
}

/// The direction of a product: `A x`, from the projector to the camera, or `Aᵀ y`, with projector and camera exchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// `A x`.
    Forward,
    /// `Aᵀ y`.
    Adjoint,
}

/// A linear operator `A` of `rows × cols`. A product is expensive (on a rig it is a photo) and can fail (a rig can be unplugged).
///
/// An implementation defines [`Operator::apply`] or [`Operator::apply_block`]. The default of each calls the other.
pub trait Operator {
    /// The length of `y` in `y = A x`.
    fn rows(&self) -> usize;
    /// The length of `x` in `y = A x`.
    fn cols(&self) -> usize;
    /// The symmetry, as far as it is known.
    fn symmetry(&self) -> Symmetry;
    /// `y ← A x`; every entry of `y` is overwritten.
    ///
    /// # Errors
    /// The error that stopped the product. The entries of `y` are then unspecified.
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.apply_block(&[x], &mut [y])
    }

    /// `y_k ← A x_k` for each `x_k` in `xs`, in order. The results are bitwise equal to the results of single products, and a block of `k`
    /// products counts as `k` products. `xs` and `ys` have the same length. The default takes the products one by one.
    ///
    /// # Errors
    /// The errors of [`Operator::apply`]. All vectors in `ys` are then unspecified.
    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        debug_assert_eq!(xs.len(), ys.len());
        xs.iter().zip(ys).try_for_each(|(x, y)| self.apply(x, y))
    }

    /// The number of products in a block that takes about as long as a single product. A method that knows several vectors in advance
    /// requests blocks of this size. The default is 1. It suits operators whose products are photos, because no photo is then taken before
    /// it is needed.
    fn block_size(&self) -> usize {
        1
    }

    /// The observer of computations with this operator. The observer sees each step and may stop the computation. The default `()` does
    /// nothing. A wrapper returns the observer of the operator that it wraps.
    fn observer(&self) -> &dyn Observer {
        &()
    }

    /// The standard errors of the products in the last call of [`Operator::apply`], [`Operator::apply_block`] (or of their counterparts for
    /// the transpose) or [`Operator::apply_within`], in order. Each standard error is the expected `‖y − A x‖₂` due to noise. The default
    /// is empty: the products are exact, or their errors are unknown.
    fn standard_errors(&self) -> Vec<f64> {
        Vec::new()
    }

    /// The variance of each entry of the last product, if it was a single product. Empty if these are not known.
    fn variances(&self) -> Vec<f64> {
        Vec::new()
    }

    /// The number of frames that a camera has taken so far for the rig behind this operator. A photo may take several frames: for
    /// exposures, repetitions, the positive and the negative part of a pattern, and bit planes. Frames of black and white, frames that
    /// measure the drift of the lamp, and frames that came from a journal count too. The default `None` means that products are computed
    /// and cost no frames.
    fn frames(&self) -> Option<u64> {
        None
    }

    /// The part of the standard error of `xᵀ A x` that is common to all products, so that averaging over products does not reduce it. The
    /// default is 0, which also stands for an unknown error. A rig that subtracts direct light has such an error, because it measures
    /// direct light only once. Fails with the errors of [`Operator::apply`], because this measurement may still have to be taken.
    fn common_error(&mut self, x: &[f64]) -> Result<f64> {
        let _ = x;
        Ok(0.0)
    }

    /// Tells the operator whether the following products only confirm a result. Returns true if products cost nothing, for example with a
    /// matrix in memory. Such products are neither counted nor shown as photos while `on` is true. The default returns false: every product
    /// is a photo.
    fn confirming(&mut self, on: bool) -> bool {
        let _ = on;
        false
    }

    /// The claim about this operator that [`Operator::keep_claim`] kept for this question, if there is one. An operator keeps claims in
    /// place of the products that confirmed them. The default keeps none. Fails with the errors of reading.
    fn claim(&mut self, question: &str) -> Result<Option<Vec<u8>>> {
        let _ = question;
        Ok(None)
    }

    /// Keeps a claim, unless there is one for this question. The default forgets it. Fails with the errors of writing.
    fn keep_claim(&mut self, question: &str, claim: &[u8]) -> Result<()> {
        let _ = (question, claim);
        Ok(())
    }

    /// Vectors for `columns` columns in the memory where products are computed, for an operator that is square. With a selection `S`,
    /// products are `S A Sᵀ v`. The default `None` means that products take their vectors from the host's memory, or that there is no
    /// room.
    ///
    /// # Errors
    /// The error of that memory; [`Error::Dimension`] for a selection that does not fit.
    fn vectors(&self, columns: usize, selection: Option<Selection<'_>>) -> Result<Option<Box<dyn Vectors>>> {
        let _ = (columns, selection);
        Ok(None)
    }

    /// `w ← A v`, or `w ← S A Sᵀ v`, for column `v` of vectors that [`Operator::vectors`] of this operator made. The direction says
    /// whether the product is with `A` or with its transpose.
    ///
    /// # Errors
    /// The errors of [`Operator::apply`] or [`Adjoint::apply_adjoint`]; [`Error::Numerical`] for vectors of another kind or size. The
    /// vectors of another operator of this kind and size are not told apart.
    fn apply_within(&mut self, vectors: &mut dyn Vectors, column: usize, direction: Direction) -> Result<()> {
        let _ = (vectors, column, direction);
        Err(vectors::made_elsewhere())
    }

    /// The standard error of the last product, if it was a single product. It is 0 if the product is exact or its error is unknown.
    fn standard_error(&self) -> f64 {
        self.standard_errors().first().copied().unwrap_or(0.0)
    }
}

/// An operator whose transpose can be applied too. An implementation defines [`Adjoint::apply_adjoint`] or
/// [`Adjoint::apply_adjoint_block`].
pub trait Adjoint: Operator {
    /// `x ← Aᵀ y`; every entry of `x` is overwritten. Fails with the errors of [`Operator::apply`].
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.apply_adjoint_block(&[y], &mut [x])
    }

    /// `x_k ← Aᵀ y_k` for each `y_k` in `ys`, in order, by the rules of [`Operator::apply_block`]. Fails with the errors of
    /// [`Operator::apply_block`].
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        debug_assert_eq!(xs.len(), ys.len());
        ys.iter().zip(xs).try_for_each(|(y, x)| self.apply_adjoint(y, x))
    }

    /// Takes a block of products in the given direction. Fails with the errors of [`Operator::apply_block`].
    fn products(&mut self, direction: Direction, from: &[&[f64]], to: &mut [&mut [f64]]) -> Result<()> {
        match direction {
            Direction::Forward => self.apply_block(from, to),
            Direction::Adjoint => self.apply_adjoint_block(from, to),
        }
    }
}

/// Borrows the vectors as a block for [`Operator::apply_block`].
pub(crate) fn block(vectors: &[Vec<f64>]) -> Vec<&[f64]> {
    vectors.iter().map(Vec::as_slice).collect()
}

pub(crate) fn block_mut(vectors: &mut [Vec<f64>]) -> Vec<&mut [f64]> {
    vectors.iter_mut().map(Vec::as_mut_slice).collect()
}

/// Forwards methods of [`Operator`] from a wrapper to the operator inside it. The arguments are the field that holds the inner operator,
/// and the methods to forward. `apply` stands for the products of [`Operator`], `adjoint` for the products of [`Adjoint`]. The field name
/// `deref` stands for the target of a pointer.
macro_rules! delegate {
    ($field:tt: $($method:ident),+ $(,)?) => { $( $crate::operator::delegate!(@$method $field); )+ };
    (@rows $field:tt) => {
        fn rows(&self) -> usize {
            $crate::operator::inner!(self, $field).rows()
        }
    };
    (@cols $field:tt) => {
        fn cols(&self) -> usize {
            $crate::operator::inner!(self, $field).cols()
        }
    };
    (@symmetry $field:tt) => {
        fn symmetry(&self) -> $crate::operator::Symmetry {
            $crate::operator::inner!(self, $field).symmetry()
        }
    };
    (@apply $field:tt) => {
        fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> $crate::error::Result<()> {
            $crate::operator::inner!(self, $field).apply_block(xs, ys)
        }
    };
    (@vectors $field:tt) => {
        fn vectors(
            &self,
            columns: usize,
            selection: Option<$crate::operator::Selection<'_>>,
        ) -> $crate::error::Result<Option<Box<dyn $crate::operator::Vectors>>> {
            $crate::operator::inner!(self, $field).vectors(columns, selection)
        }
    };
    (@apply_within $field:tt) => {
        fn apply_within(
            &mut self,
            vectors: &mut dyn $crate::operator::Vectors,
            column: usize,
            direction: $crate::operator::Direction,
        ) -> $crate::error::Result<()> {
            $crate::operator::inner!(self, $field).apply_within(vectors, column, direction)
        }
    };
    (@block_size $field:tt) => {
        fn block_size(&self) -> usize {
            $crate::operator::inner!(self, $field).block_size()
        }
    };
    (@observer $field:tt) => {
        fn observer(&self) -> &dyn $crate::observer::Observer {
            $crate::operator::inner!(self, $field).observer()
        }
    };
    (@frames $field:tt) => {
        fn frames(&self) -> Option<u64> {
            $crate::operator::inner!(self, $field).frames()
        }
    };
    (@common_error $field:tt) => {
        fn common_error(&mut self, x: &[f64]) -> $crate::error::Result<f64> {
            $crate::operator::inner!(self, $field).common_error(x)
        }
    };
    (@confirming $field:tt) => {
        fn confirming(&mut self, on: bool) -> bool {
            $crate::operator::inner!(self, $field).confirming(on)
        }

        fn claim(&mut self, question: &str) -> $crate::error::Result<Option<Vec<u8>>> {
            $crate::operator::inner!(self, $field).claim(question)
        }

        fn keep_claim(&mut self, question: &str, claim: &[u8]) -> $crate::error::Result<()> {
            $crate::operator::inner!(self, $field).keep_claim(question, claim)
        }
    };
    (@adjoint $field:tt) => {
        fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> $crate::error::Result<()> {
            $crate::operator::inner!(self, $field).apply_adjoint_block(ys, xs)
        }
    };
    (@standard_errors $field:tt) => {
        fn standard_errors(&self) -> Vec<f64> {
            $crate::operator::inner!(self, $field).standard_errors()
        }
    };
    (@variances $field:tt) => {
        fn variances(&self) -> Vec<f64> {
            $crate::operator::inner!(self, $field).variances()
        }
    };
}

/// The operator inside a wrapper.
macro_rules! inner {
    ($wrapper:ident, deref) => {
        (**$wrapper)
    };
    ($wrapper:ident, $field:tt) => {
        $wrapper.$field
    };
}

pub(crate) use {delegate, inner};

/// Implements the traits for a pointer to an operator.
macro_rules! forward {
    ($($pointer:ty),*) => { $(
        impl<O: Operator + ?Sized> Operator for $pointer {
            delegate!(deref: rows, cols, symmetry, apply, block_size, observer);
            delegate!(deref: standard_errors, variances, frames, common_error, confirming, vectors, apply_within);
        }

        impl<O: Adjoint + ?Sized> Adjoint for $pointer {
            delegate!(deref: adjoint);
        }
    )* };
}

forward!(&mut O, Box<O>);

/// `A x` in a new vector.
pub(crate) fn product(operator: &mut dyn Operator, x: &[f64]) -> Result<Vec<f64>> {
    let mut y = vec![0.0; operator.rows()];
    operator.apply(x, &mut y)?;
    Ok(y)
}

/// Computes `A before(x)` for each of `xs`, as one block of products. For each `x` and its product, `after` writes `y`.
pub(crate) fn between(
    operator: &mut dyn Operator,
    (xs, ys): (&[&[f64]], &mut [&mut [f64]]),
    before: impl Fn(&[f64]) -> Vec<f64>,
    after: impl Fn(&[f64], &[f64], &mut [f64]),
) -> Result<()> {
    let from: Vec<Vec<f64>> = xs.iter().map(|x| before(x)).collect();
    let mut to = vec![vec![0.0; operator.rows()]; xs.len()];
    operator.apply_block(&block(&from), &mut block_mut(&mut to))?;
    for ((x, product), y) in xs.iter().zip(&to).zip(ys) {
        after(x, product, y);
    }
    Ok(())
}

/// Refuses an operator that is not `n × n`. `what` names the operator in the error.
pub(crate) fn check_square(what: &'static str, n: usize, operator: &dyn Operator) -> Result<()> {
    let found = format!("{}x{}", operator.rows(), operator.cols());
    Error::check_size(what, format!("{n}x{n}"), found)
}

/// The largest number of products requested as one block. It limits the number of vectors in memory.
const LARGEST_BLOCK: usize = 8;

/// Multiplies each of `xs` (`cols` entries each) by `operator`, in blocks of [`Operator::block_size`]. Calls `with` for each vector and its
/// product, in order.
///
/// # Errors
/// The first error of a product or of `with`. No further block of products is then taken.
pub fn each_product(
    operator: &mut dyn Operator,
    xs: impl IntoIterator<Item = Vec<f64>>,
    mut with: impl FnMut(&[f64], Vec<f64>) -> Result<()>,
) -> Result<()> {
    let (rows, size) = (operator.rows(), operator.block_size().clamp(1, LARGEST_BLOCK));
    let mut xs = xs.into_iter();
    loop {
        let next: Vec<Vec<f64>> = xs.by_ref().take(size).collect();
        if next.is_empty() {
            return Ok(());
        }
        let mut products = vec![vec![0.0; rows]; next.len()];
        operator.apply_block(&block(&next), &mut block_mut(&mut products))?;
        next.iter().zip(products).try_for_each(|(x, y)| with(x, y))?;
    }
}

/// An operator whose product is a closure. It wraps, for example, a user's matrix or function.
///
/// ```
/// use krylux::krylov::{EigsOptions, eigs};
/// use krylux::operator::{Closure, Symmetry};
///
/// // −1, 2, −1 on 50 nodes, whose eigenvalues are 2 − 2 cos(k π / 51).
/// # fn main() -> krylux::Result<()> {
/// let mut laplacian = Closure::new(50, 50, Symmetry::Symmetric, |x: &[f64], y: &mut [f64]| {
///     for i in 0..50 {
///         let left = if i > 0 { x[i - 1] } else { 0.0 };
///         y[i] = 2.0 * x[i] - left - x.get(i + 1).unwrap_or(&0.0);
///     }
///     Ok(())
/// });
/// let largest = eigs(&mut laplacian, &EigsOptions { count: 1, ..EigsOptions::default() })?.values[0];
/// assert!((largest - (2.0 - 2.0 * (50.0 * std::f64::consts::PI / 51.0).cos())).abs() < 1e-12);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Closure<F> {
    rows: usize,
    cols: usize,
    symmetry: Symmetry,
    product: F,
}

impl<F: FnMut(&[f64], &mut [f64]) -> Result<()>> Closure<F> {
    /// Makes an operator from `product(x, y)`, which takes `x` of `cols` entries and writes `A x` to all `rows` entries of `y`. `symmetry`
    /// is not verified.
    pub fn new(rows: usize, cols: usize, symmetry: Symmetry, product: F) -> Self {
        Self { rows, cols, symmetry, product }
    }
}

impl<F: FnMut(&[f64], &mut [f64]) -> Result<()>> Operator for Closure<F> {
    fn rows(&self) -> usize {
        self.rows
    }

    fn cols(&self) -> usize {
        self.cols
    }

    fn symmetry(&self) -> Symmetry {
        self.symmetry
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        Error::check_size("entries of the vector to multiply", self.cols, x.len())?;
        Error::check_size("entries of the product", self.rows, y.len())?;
        (self.product)(x, y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_product_is_the_closure_s_and_wrong_lengths_are_refused() {
        let mut calls = 0;
        let mut sum = Closure::new(1, 3, Symmetry::General, |x: &[f64], y: &mut [f64]| {
            calls += 1;
            y[0] = x.iter().sum();
            Ok(())
        });
        let (mut first, mut second) = ([f64::NAN], [f64::NAN]);
        let (xs, mut ys): ([&[f64]; 2], [&mut [f64]; 2]) =
            ([&[1.0, 2.0, 3.0], &[-1.0, 0.0, 0.5]], [&mut first, &mut second]);
        assert!(sum.apply_block(&xs, &mut ys).is_ok());
        assert!(sum.apply(&[1.0; 2], &mut [0.0]).is_err() && sum.apply(&[1.0; 3], &mut [0.0; 2]).is_err());
        assert_eq!((first, second, calls), ([6.0], [-0.5], 2));
    }
}
