//! An operator that counts the frames of its products.

use super::{Adjoint, Operator, delegate};
use crate::error::Result;

/// An operator that notes after each product how many frames a camera has taken for it and for those before it.
pub struct Metered<'a, O: ?Sized> {
    operator: &'a mut O,
    before: Option<u64>,
    /// The frames after each product, in order, counted from where this counter began; empty where products are computed
    /// ([`Operator::frames`]).
    pub frames: Vec<u64>,
}

impl<'a, O: Operator + ?Sized> Metered<'a, O> {
    /// `operator`, with a counter that begins at 0.
    pub fn new(operator: &'a mut O) -> Self {
        let before = operator.frames();
        Self { operator, before, frames: Vec::new() }
    }

    /// Notes the frames so far for each of `products` products.
    fn note(&mut self, products: usize) {
        if let Some((now, before)) = self.operator.frames().zip(self.before) {
            self.frames.resize(self.frames.len() + products, now - before);
        }
    }
}

impl<O: Operator + ?Sized> Operator for Metered<'_, O> {
    delegate!(operator: rows, cols, symmetry, block_size, observer, standard_errors, common_error, frames);

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.operator.apply(x, y)?;
        self.note(1);
        Ok(())
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.operator.apply_block(xs, ys)?;
        self.note(xs.len());
        Ok(())
    }
}

impl<O: Adjoint + ?Sized> Adjoint for Metered<'_, O> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.operator.apply_adjoint(y, x)?;
        self.note(1);
        Ok(())
    }

    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.operator.apply_adjoint_block(ys, xs)?;
        self.note(ys.len());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::{Closure, Symmetry};

    /// A rig whose products take two frames each, after seven for its references.
    struct TwoFrames(u64);

    impl Operator for TwoFrames {
        fn rows(&self) -> usize {
            3
        }

        fn cols(&self) -> usize {
            3
        }

        fn symmetry(&self) -> Symmetry {
            Symmetry::Symmetric
        }

        fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
            self.0 += 2;
            y.copy_from_slice(x);
            Ok(())
        }

        fn frames(&self) -> Option<u64> {
            Some(self.0)
        }
    }

    #[test]
    fn frames_are_counted_from_where_the_counter_began() -> Result<()> {
        let mut rig = TwoFrames(7);
        let mut metered = Metered::new(&mut rig);
        let (x, mut y, mut z) = ([1.0, 2.0, 3.0], [0.0; 3], [0.0; 3]);
        metered.apply(&x, &mut y)?;
        metered.apply_block(&[&x, &x], &mut [&mut y, &mut z])?;
        assert_eq!(metered.frames, [2, 6, 6]);
        assert_eq!((y, metered.frames()), (x, Some(13)));
        Ok(())
    }

    #[test]
    fn computed_products_cost_no_frames() -> Result<()> {
        let mut computed = Closure::new(3, 3, Symmetry::Symmetric, |x: &[f64], y: &mut [f64]| {
            y.copy_from_slice(x);
            Ok(())
        });
        let mut metered = Metered::new(&mut computed);
        metered.apply(&[1.0; 3], &mut [0.0; 3])?;
        assert!(metered.frames.is_empty() && metered.frames().is_none());
        Ok(())
    }
}
