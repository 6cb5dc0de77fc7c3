//! A part of the transport matrix as an operator for the Krylov methods.

use super::matrix::Direction;
use super::tiles::BLOCK_WIDTH;
use super::{Part, Products};
use crate::error::Result;
use crate::operator::{Adjoint, Operator, Symmetry};

/// `y = P x` for one part and channel of a transport matrix. Each product stands for one photo. On the
/// processor, a block is multiplied four vectors at a time.
#[derive(Clone, Copy, Debug)]
pub struct MatrixOperator<'a> {
    matrix: &'a dyn Products,
    part: Part,
    channel: usize,
}

impl<'a> MatrixOperator<'a> {
    /// The operator of a traced matrix: a [`super::TransportMatrix`] on the processor, or an
    /// [`super::Assembled`] on its backend. The channel is below [`super::Channels::count`].
    pub fn new(matrix: &'a dyn Products, part: Part, channel: usize) -> Self {
        Self { matrix, part, channel }
    }

    fn product(&self, direction: Direction, from: &[f64], to: &mut [f64]) -> Result<()> {
        match direction {
            Direction::Forward => self.matrix.product(self.part, self.channel, from, to),
            Direction::Backward => self.matrix.transposed_product(self.part, self.channel, from, to),
        }
    }

    fn block(&self, direction: Direction, from: &[&[f64]], to: &mut [&mut [f64]]) -> Result<()> {
        match self.matrix.on_processor() {
            Some(matrix) => {
                matrix.multiply_block(direction, self.part, self.channel, from, to);
                Ok(())
            }
            None => from.iter().zip(to).try_for_each(|(from, to)| self.product(direction, from, to)),
        }
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
        self.product(Direction::Forward, x, y)
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.block(Direction::Forward, xs, ys)
    }

    fn block_size(&self) -> usize {
        if self.matrix.on_processor().is_some() { BLOCK_WIDTH } else { 1 }
    }

    fn confirming(&mut self, _: bool) -> bool {
        true
    }
}

impl Adjoint for MatrixOperator<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.product(Direction::Backward, y, x)
    }

    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.block(Direction::Backward, ys, xs)
    }
}
