//! A part of the transport matrix as the Krylov methods see it.

use super::matrix::Direction;
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
    /// By direction.
    ahead: [Ahead; 2],
}

impl<'a> MatrixOperator<'a> {
    /// Of a frozen matrix: itself on the processor, or as part of an [`super::Assembled`] wherever that placed it. The channel is
    /// below [`super::Channels::count`].
    pub fn new(matrix: &'a dyn Products, part: Part, channel: usize) -> Self {
        Self { matrix, part, channel, ahead: Default::default() }
    }

    fn product(&mut self, direction: Direction, from: &[f64], to: &mut [f64]) -> Result<()> {
        let (part, channel) = (self.part, self.channel);
        match (self.matrix.on_processor(), direction) {
            (Some(matrix), _) => self.ahead[direction as usize].product(from, to, ABREAST, |from, to| {
                matrix.multiply_block(direction, part, channel, from, to);
                Ok(())
            }),
            (None, Direction::Forward) => self.matrix.product(part, channel, from, to),
            (None, Direction::Backward) => self.matrix.transposed_product(part, channel, from, to),
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

    fn announce(&mut self, xs: &[Vec<f64>]) {
        self.ahead[Direction::Forward as usize].announce(xs);
    }
}

impl Adjoint for MatrixOperator<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.product(Direction::Backward, y, x)
    }

    fn announce_adjoint(&mut self, ys: &[Vec<f64>]) {
        self.ahead[Direction::Backward as usize].announce(ys);
    }
}
