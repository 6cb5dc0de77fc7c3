//! A part of the transport matrix as the Krylov methods see it.

use super::{Part, Products};
use crate::error::Result;
use crate::operator::{Adjoint, Operator, Symmetry};

/// `y = P x` for one part and channel of a transport matrix. Each product stands for one photo.
#[derive(Clone, Copy, Debug)]
pub struct MatrixOperator<'a> {
    /// The frozen matrix: itself on the processor, or as part of an [`super::Assembled`] wherever that placed it.
    pub matrix: &'a dyn Products,
    /// Which light.
    pub part: Part,
    /// Which channel, below [`super::Channels::count`].
    pub channel: usize,
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
        self.matrix.product(self.part, self.channel, x, y)
    }
}

impl Adjoint for MatrixOperator<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.matrix.transposed_product(self.part, self.channel, y, x)
    }
}
