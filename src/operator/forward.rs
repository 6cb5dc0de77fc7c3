//! References and boxes of operators are operators.

use super::{Adjoint, Operator, Symmetry};
use crate::error::Result;
use crate::observer::Observer;

/// What an operator is: the same as `$inner`.
macro_rules! forward_shape {
    ($self:ident => $inner:expr) => {
        fn rows(&$self) -> usize {
            $inner.rows()
        }

        fn cols(&$self) -> usize {
            $inner.cols()
        }

        fn symmetry(&$self) -> Symmetry {
            $inner.symmetry()
        }

        fn block_size(&$self) -> usize {
            $inner.block_size()
        }
    };
}

/// Products: those of `$inner`.
macro_rules! forward_products {
    ($self:ident => $inner:expr) => {
        fn apply(&mut $self, x: &[f64], y: &mut [f64]) -> Result<()> {
            $inner.apply(x, y)
        }

        fn apply_block(&mut $self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
            $inner.apply_block(xs, ys)
        }
    };
}

/// Products with the transpose: those of `$inner`.
macro_rules! forward_adjoint_products {
    ($self:ident => $inner:expr) => {
        fn apply_adjoint(&mut $self, y: &[f64], x: &mut [f64]) -> Result<()> {
            $inner.apply_adjoint(y, x)
        }

        fn apply_adjoint_block(&mut $self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
            $inner.apply_adjoint_block(ys, xs)
        }
    };
}

pub(super) use {forward_adjoint_products, forward_products, forward_shape};

macro_rules! forward {
    ($($pointer:ty),*) => { $(
        impl<O: Operator + ?Sized> Operator for $pointer {
            forward_shape!(self => (**self));
            forward_products!(self => (**self));

            fn observer(&self) -> &dyn Observer {
                (**self).observer()
            }
        }

        impl<O: Adjoint + ?Sized> Adjoint for $pointer {
            forward_adjoint_products!(self => (**self));
        }
    )* };
}

forward!(&mut O, Box<O>);
