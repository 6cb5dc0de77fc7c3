//! An operator made of a closure.

use super::{Operator, Symmetry};
use crate::error::{Error, Result};

/// An operator whose product is a closure: a matrix or a function of your own.
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
    /// `product(x, y)` writes `A x` (`rows` entries) to every entry of `y`, for `x` of `cols` entries.
    /// `symmetry` is taken on trust.
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
