//! Linear operators as the Krylov methods see them: signed real vectors, and a product that may fail.

mod ahead;
mod each;

pub use ahead::Ahead;
pub use each::each_product;

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

    /// Says which vectors come next, unless whoever asks stops before; replaces what was announced before. An operator that takes
    /// several products for little more than one ([`Ahead`]) does so when the first is asked for. Nothing else changes: no product
    /// counts before it is asked for, and each has the same bits. One whose products are photos has no use for it.
    fn announce(&mut self, _xs: &[Vec<f64>]) {}

    /// Who watches the computations with this operator, and may stop them; by default nobody. An operator around another one has the
    /// observer of that one.
    fn observer(&self) -> &dyn Observer {
        &()
    }
}

/// An operator whose transpose can be applied too.
pub trait Adjoint: Operator {
    /// `x ← Aᵀ y`; every entry of `x` is overwritten.
    ///
    /// # Errors
    /// As [`Operator::apply`].
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()>;

    /// As [`Operator::announce`], for products with the transpose.
    fn announce_adjoint(&mut self, _ys: &[Vec<f64>]) {}
}

/// An operator that remembers what it was asked, and what it answered.
pub struct Recorded<'a, O: ?Sized> {
    operator: &'a mut O,
    /// Each product, in order; one with the transpose is kept like any other.
    pub products: Vec<Product>,
}

/// What was multiplied, and what came of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Product {
    /// `x`.
    pub from: Vec<f64>,
    /// `A x`.
    pub to: Vec<f64>,
}

impl<'a, O: Operator + ?Sized> Recorded<'a, O> {
    /// Nothing was asked yet.
    pub fn new(operator: &'a mut O) -> Self {
        Self { operator, products: Vec::new() }
    }

    fn keep(&mut self, from: &[f64], to: &[f64]) {
        self.products.push(Product { from: from.to_vec(), to: to.to_vec() });
    }
}

impl<O: Operator + ?Sized> Operator for Recorded<'_, O> {
    fn rows(&self) -> usize {
        self.operator.rows()
    }

    fn cols(&self) -> usize {
        self.operator.cols()
    }

    fn symmetry(&self) -> Symmetry {
        self.operator.symmetry()
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.operator.apply(x, y)?;
        self.keep(x, y);
        Ok(())
    }

    fn announce(&mut self, xs: &[Vec<f64>]) {
        self.operator.announce(xs);
    }
}

impl<O: Adjoint + ?Sized> Adjoint for Recorded<'_, O> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.operator.apply_adjoint(y, x)?;
        self.keep(y, x);
        Ok(())
    }

    fn announce_adjoint(&mut self, ys: &[Vec<f64>]) {
        self.operator.announce_adjoint(ys);
    }
}
