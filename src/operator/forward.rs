//! References and boxes of operators are operators.

use super::{Adjoint, Operator, Symmetry};
use crate::error::Result;
use crate::observer::Observer;

macro_rules! forward {
    ($($pointer:ty),*) => { $(
        impl<O: Operator + ?Sized> Operator for $pointer {
            fn rows(&self) -> usize {
                (**self).rows()
            }

            fn cols(&self) -> usize {
                (**self).cols()
            }

            fn symmetry(&self) -> Symmetry {
                (**self).symmetry()
            }

            fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
                (**self).apply(x, y)
            }

            fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
                (**self).apply_block(xs, ys)
            }

            fn block_size(&self) -> usize {
                (**self).block_size()
            }

            fn observer(&self) -> &dyn Observer {
                (**self).observer()
            }
        }

        impl<O: Adjoint + ?Sized> Adjoint for $pointer {
            fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
                (**self).apply_adjoint(y, x)
            }

            fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
                (**self).apply_adjoint_block(ys, xs)
            }
        }
    )* };
}

forward!(&mut O, Box<O>);
