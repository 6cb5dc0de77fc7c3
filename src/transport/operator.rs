//! A part of the transport matrix as the Krylov methods see it.

use super::tiles::ABREAST;
use super::{Part, Products};
use crate::error::Result;
use crate::operator::{Adjoint, Ahead, Operator, Symmetry};

/// `y = P x` for one part and channel of a transport matrix. Each product stands for one photo; those that were announced are taken
/// four at a time, where it is the processor that multiplies.
#[derive(Clone, Debug)]
pub struct MatrixOperator<'a> {
    matrix: &'a dyn Products,
    part: Part,
    channel: usize,
    ahead: Ahead,
    ahead_adjoint: Ahead,
}

impl<'a> MatrixOperator<'a> {
    /// Of a frozen matrix: itself on the processor, or as part of an [`super::Assembled`] wherever that placed it. The channel is
    /// below [`super::Channels::count`].
    pub fn new(matrix: &'a dyn Products, part: Part, channel: usize) -> Self {
        Self { matrix, part, channel, ahead: Ahead::default(), ahead_adjoint: Ahead::default() }
    }
}

impl Operator for MatrixOperator<'_> {
    fn rows(&self) -> usize {
        self.matrix.frozen().resolution().pixels()
    }

    fn cols(&self) -> usize {
        self.matrix.frozen().projector_resolution().pixels()
    }

    fn symmetry(&self) -> Symmetry {
        if self.matrix.frozen().is_symmetric() { Symmetry::Symmetric } else { Symmetry::General }
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        let Some(matrix) = self.matrix.on_processor() else {
            return self.matrix.product(self.part, self.channel, x, y);
        };
        self.ahead.product(x, y, ABREAST, |xs, ys| {
            matrix.apply_block(self.part, self.channel, xs, ys);
            Ok(())
        })
    }

    fn announce(&mut self, xs: &[Vec<f64>]) {
        self.ahead.announce(xs);
    }
}

impl Adjoint for MatrixOperator<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        let Some(matrix) = self.matrix.on_processor() else {
            return self.matrix.transposed_product(self.part, self.channel, y, x);
        };
        self.ahead_adjoint.product(y, x, ABREAST, |ys, xs| {
            matrix.apply_transpose_block(self.part, self.channel, ys, xs);
            Ok(())
        })
    }

    fn announce_adjoint(&mut self, ys: &[Vec<f64>]) {
        self.ahead_adjoint.announce(ys);
    }
}
