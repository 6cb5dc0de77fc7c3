//! An operator that records its products.

use super::{Adjoint, Operator, delegate};
use crate::error::Result;

/// An operator that records each product: what was multiplied, and the result.
pub struct Recorded<'a, O: ?Sized> {
    operator: &'a mut O,
    /// Each product, in order; those with the transpose are among them.
    pub products: Vec<Product>,
}

/// A vector and its product.
#[derive(Clone, Debug, PartialEq)]
pub struct Product {
    /// `x`.
    pub from: Vec<f64>,
    /// `A x`.
    pub to: Vec<f64>,
}

impl<'a, O: Operator + ?Sized> Recorded<'a, O> {
    /// `operator`, with no product recorded yet.
    pub fn new(operator: &'a mut O) -> Self {
        Self { operator, products: Vec::new() }
    }

    fn record(&mut self, from: &[f64], to: &[f64]) {
        self.products.push(Product { from: from.to_vec(), to: to.to_vec() });
    }
}

impl<O: Operator + ?Sized> Operator for Recorded<'_, O> {
    delegate!(operator: rows, cols, symmetry, block_size, observer, standard_errors, common_error, frames);

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.operator.apply(x, y)?;
        self.record(x, y);
        Ok(())
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.operator.apply_block(xs, ys)?;
        xs.iter().zip(ys).for_each(|(x, y)| self.record(x, y));
        Ok(())
    }
}

impl<O: Adjoint + ?Sized> Adjoint for Recorded<'_, O> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.operator.apply_adjoint(y, x)?;
        self.record(y, x);
        Ok(())
    }

    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.operator.apply_adjoint_block(ys, xs)?;
        ys.iter().zip(xs).for_each(|(y, x)| self.record(y, x));
        Ok(())
    }
}
