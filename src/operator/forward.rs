//! References and boxes of operators are operators; an operator around another one forwards what it does not change.

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

            fn standard_errors(&self) -> Vec<f64> {
                (**self).standard_errors()
            }

            fn frames(&self) -> Option<u64> {
                (**self).frames()
            }

            fn common_error(&mut self, x: &[f64]) -> Result<f64> {
                (**self).common_error(x)
            }

            fn confirming(&mut self, on: bool) -> bool {
                (**self).confirming(on)
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

/// Methods of [`Operator`] that an operator around another one forwards to it: in the `impl`, the field that holds the other
/// operator, and the names of the methods.
macro_rules! delegate {
    ($field:tt: $($method:ident),+ $(,)?) => { $( $crate::operator::delegate!(@$method $field); )+ };
    (@rows $field:tt) => {
        fn rows(&self) -> usize {
            self.$field.rows()
        }
    };
    (@cols $field:tt) => {
        fn cols(&self) -> usize {
            self.$field.cols()
        }
    };
    (@symmetry $field:tt) => {
        fn symmetry(&self) -> $crate::operator::Symmetry {
            self.$field.symmetry()
        }
    };
    (@apply $field:tt) => {
        fn apply(&mut self, x: &[f64], y: &mut [f64]) -> $crate::error::Result<()> {
            self.$field.apply(x, y)
        }
        fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> $crate::error::Result<()> {
            self.$field.apply_block(xs, ys)
        }
    };
    (@block_size $field:tt) => {
        fn block_size(&self) -> usize {
            self.$field.block_size()
        }
    };
    (@observer $field:tt) => {
        fn observer(&self) -> &dyn $crate::observer::Observer {
            self.$field.observer()
        }
    };
    (@frames $field:tt) => {
        fn frames(&self) -> Option<u64> {
            self.$field.frames()
        }
    };
    (@common_error $field:tt) => {
        fn common_error(&mut self, x: &[f64]) -> $crate::error::Result<f64> {
            self.$field.common_error(x)
        }
    };
    (@confirming $field:tt) => {
        fn confirming(&mut self, on: bool) -> bool {
            self.$field.confirming(on)
        }
    };
    (@standard_errors $field:tt) => {
        fn standard_errors(&self) -> Vec<f64> {
            self.$field.standard_errors()
        }
    };
}

pub(crate) use delegate;
